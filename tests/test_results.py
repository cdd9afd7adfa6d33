"""The page of results says what its rows say."""

import importlib.util
import json
import re
from pathlib import Path

import pytest

pytest.importorskip("matplotlib", reason="pip install 'abuffer[compare]'")

DOCS = Path(__file__).parents[1] / "docs"


@pytest.fixture(scope="module")
def results():
    spec = importlib.util.spec_from_file_location("results", DOCS / "results.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", ["cpu", "gpu"])
def test_every_method_is_measured_on_every_scene(results, name):
    import abuffer as ab
    from abuffer.own_methods import BUILT_IN

    compared, _ = results.compared_of(name)
    assert compared.scenes == list(ab.scenes.suite("standard"))
    for scene in compared.scenes:
        rows = compared.select(scene=scene)
        assert {row["method"] for row in rows} == BUILT_IN
        assert not [row["label"] for row in rows if row["failure"]]
        assert not [row["label"] for row in rows if not row["deterministic"]]


def test_the_page_is_that_of_its_rows(results, tmp_path, monkeypatch):
    (tmp_path / "results").mkdir()
    for path in (DOCS / "results").glob("*[!g]"):
        (tmp_path / "results" / path.name).write_bytes(path.read_bytes())
    monkeypatch.setattr(results, "FOLDER", tmp_path / "results")
    results.write()
    assert (tmp_path / "results.md").read_text(encoding="utf-8") == (DOCS / "results.md").read_text(encoding="utf-8")
    # What a changed row would change.
    path = tmp_path / "results" / "gpu.json"
    found = json.loads(path.read_text(encoding="utf-8"))
    next(row for row in found["rows"] if row["label"] == "wboit@hardware")["rmse"] = 0.123
    path.write_text(json.dumps(found), encoding="utf-8")
    results.write()
    assert "1.2e-01" in (tmp_path / "results.md").read_text(encoding="utf-8")


def test_findings_hold_in_the_rows(results):
    """Each number of the text that a row has."""
    compared, _ = results.compared_of("gpu")

    def rmse(scene, label):
        return compared.select(scene=scene, label=label)[0]["rmse"]

    sheets = [rmse("thin_sheets", f"wboit weight={weight}") for weight in ("none", "7", "8", "10", "9")]
    assert sheets == pytest.approx([0.18, 0.24, 0.35, 0.46, 0.14], abs=0.005)
    assert rmse("stack", "wboit weight=none") == pytest.approx(0.34, abs=0.005)
    assert rmse("stack", "wboit weight=10") == pytest.approx(0.054, abs=5e-4)
    for label in ("wboit weight=7", "weighted_average", "mboit moments=8", "wavelet rank=5", "fourier terms=5"):
        assert rmse("coplanar", label) == pytest.approx(0.1, abs=0.005)
    assert rmse("stack", "mboit moments=8") == pytest.approx(3.6e-2, abs=5e-4)
    assert rmse("stack", "mlab k=4") == pytest.approx(2.8e-3, abs=5e-5)
    assert rmse("smoke", "fourier terms=5") == pytest.approx(3.5e-4, abs=5e-6)
    assert rmse("thin_sheets", "fourier terms=5") == pytest.approx(1.1e-3, abs=5e-5)
    exact = [rmse(scene, "exact") for scene in ("random_triangles", "hair", "opaque_and_glass")]
    assert exact == pytest.approx([2.7e-4, 6.9e-4, 7.4e-4], abs=1e-5)
    text = (DOCS / "results.md").read_text(encoding="utf-8")
    assert re.search(r"equation 7 by 0\.24, 8\s+by 0\.35 and 10 by 0\.46; 9 by 0\.14", text)
