"""The notebooks run, and what is stored in them is what a run of them left."""

import json
import os
import re
from pathlib import Path

import pytest

nbformat = pytest.importorskip("nbformat", reason="pip install nbclient ipykernel")
nbclient = pytest.importorskip("nbclient", reason="pip install nbclient ipykernel")
pytest.importorskip("ipykernel", reason="pip install nbclient ipykernel")
pytest.importorskip("matplotlib", reason="pip install 'abuffer[notebook]'")
pytest.importorskip("pandas", reason="pip install 'abuffer[notebook]'")

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))
EACH = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
LARGEST = 600_000  # bytes, so that GitHub shows them
# What begins a path of somebody's machine.
OWN_PATHS = re.compile(r"/(?:home|root|tmp|Users|work|mnt|opt|usr|var)/|[A-Z]:\\\\", re.IGNORECASE)


def read(path):
    return nbformat.read(path, as_version=4)


def code(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def outputs(notebook):
    return [output for cell in code(notebook) for output in cell.outputs]


def run(notebook, folder):
    """All its cells, in images of a tenth of the size."""
    environment = os.environ | {"ABUFFER_NOTEBOOK_SCALE": "0.1"}
    client = nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": folder}})
    client.execute(env=environment)


def test_there_are_three():
    assert [path.stem for path in NOTEBOOKS] == ["first_render", "own_blend_and_method", "speed_and_accuracy"]


@pytest.mark.slow
@EACH
@pytest.mark.filterwarnings("default")  # Jupyter's own
def test_every_cell_runs(path, tmp_path):
    notebook = read(path)
    stored = code(read(path))
    for cell in code(notebook):
        cell.outputs = []
    run(notebook, tmp_path)  # raises where a cell does
    for cell, before in zip(code(notebook), stored, strict=True):
        assert kinds(cell) == kinds(before), cell.source
    assert list(tmp_path.iterdir()) == []


def kinds(cell):
    """What a cell's outputs are: text that is printed, in however many pieces, pictures, tables."""
    return {
        output.name if output.output_type == "stream" else (output.output_type, *sorted(output.data))
        for output in cell.outputs
    }


@pytest.mark.filterwarnings("default")
def test_a_cell_that_fails_would_be_seen(tmp_path):
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell("import abuffer\nabuffer.render(1 / 0)")])
    with pytest.raises(nbclient.exceptions.CellExecutionError, match="ZeroDivisionError"):
        run(notebook, tmp_path)


@EACH
def test_what_is_stored_is_one_whole_run_from_the_top(path):
    notebook = read(path)
    assert [cell.execution_count for cell in code(notebook)] == list(range(1, len(code(notebook)) + 1))
    assert all(output.output_type != "error" for output in outputs(notebook))
    assert all(output.name == "stdout" for output in outputs(notebook) if output.output_type == "stream")
    pictures = [output for output in outputs(notebook) if "image/png" in output.get("data", {})]
    assert len(pictures) >= 4


@EACH
def test_what_is_stored_names_no_path_of_the_machine_that_it_ran_on(path):
    text = path.read_text(encoding="utf-8")
    shown = [json.dumps(cell) for cell in read(path).cells]
    without_pictures = re.sub(r'"image/png": "[^"]*"', "", "\n".join(shown))
    assert not OWN_PATHS.search(without_pictures)
    assert OWN_PATHS.search(json.dumps("/home/me/a.png")) and OWN_PATHS.search(json.dumps(r"C:\Users\me"))
    assert len(text.encode()) < LARGEST


@EACH
def test_it_begins_with_how_to_install_it_and_names_the_device(path):
    notebook = read(path)
    first = notebook.cells[0]
    assert first.cell_type == "markdown" and "%pip install" in first.source  # shown, and run by no test
    assert not any(re.search(r"\bpip\b", cell.source) for cell in code(notebook))
    said = json.dumps(code(notebook)[0].outputs)
    assert "cpu" in said and "processor" in said


@EACH
def test_links_lead_somewhere(path):
    text = "\n".join(cell.source for cell in read(path).cells if cell.cell_type == "markdown")
    links = [link for link in re.findall(r"\]\(([^)]+)\)", text) if "://" not in link]
    assert links
    for link in links:
        assert (path.parent / link).is_file(), link


def test_the_readme_links_them_all():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert all(f"](examples/{path.name})" in text for path in NOTEBOOKS)
