"""The benchmarks run, at a scale that times nothing: each scene is what its name says, and what fails is a row."""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from abuffer._methods import METHODS
from abuffer.own_methods import BUILT_IN

RUN = Path(__file__).parents[1] / "benchmarks" / "run.py"


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    path = tmp_path_factory.mktemp("run") / "rows.json"
    command = [sys.executable, RUN, "--scale", "0.002", "--repeats", "1", "--json", path]
    # No driver there: what a GPU would give is a row that says so.
    environment = os.environ | {"VK_ICD_FILENAMES": "/nowhere", "VK_DRIVER_FILES": "/nowhere"}
    done = subprocess.run(
        [*command, "--devices", "cpu", "nowhere"], env=environment, capture_output=True, text=True, encoding="utf-8"
    )
    assert (done.returncode, done.stderr) == (0, "")
    return json.loads(path.read_text())


def covered(found, scene):
    """Pixels by the range of their lists' lengths, without those that have none."""
    facts = next(facts for facts in found["scenes"] if facts["scene"] == scene)
    return {lengths: pixels for lengths, pixels in facts["pixels by list length"].items() if lengths != "0" and pixels}


def test_every_scene_is_measured_on_the_cpu(found):
    rows = [row for row in found["rows"] if row["asked"] == "cpu"]
    assert len(rows) == len(found["scenes"]) > 10
    for row in rows:
        if row["scene"] == "a real model" and importlib.util.find_spec("pymeshfix") is None:
            assert "pip install" in row["error"]
        else:
            assert "error" not in row
            assert row["fragments"] > 0
            assert row["÷ floor"] > 1


def test_what_cannot_be_measured_is_a_row_with_its_error(found):
    rows = [row for row in found["rows"] if row["asked"] == "nowhere"]
    assert {row["pipeline"] for row in rows} == {"tiles", "linked_list", "prefix_sum"}
    assert all("Error: " in row["error"] for row in rows)


def test_one_hot_pixel_is_one(found):
    assert list(covered(found, "one hot pixel").values()) == [1]


def test_one_tile_is_one(found):
    assert sum(covered(found, "all triangles in one tile").values()) <= 16 * 16


def test_layers_fill_the_screen(found):
    assert list(covered(found, "2,000 screen-filling layers")) == ["1024–2047"]


def test_smoke_is_uneven(found):
    lengths = list(covered(found, "smoke"))
    assert lengths[0] == "1" and int(lengths[-1].split("–")[0]) >= 128


def test_methods_are_timed_in_their_published_form_and_as_replays(tmp_path, needs_gpu):
    path = tmp_path / "rows.json"
    scene = "200 of ~400 px"
    command = [sys.executable, RUN.with_name("methods.py"), "--scale", "0.0005", "--frames", "2", "--json", path]
    done = subprocess.run([*command, "--scenes", scene], capture_output=True, text=True, encoding="utf-8")
    assert (done.returncode, done.stderr) == (0, "")
    rows = {(row["method"], row["pipeline"]): row for row in json.loads(path.read_text())}
    for id in BUILT_IN:
        if not METHODS[id].sorts:
            timed = {pipeline for method, pipeline in rows if method == id}
            # A software driver's loops may be too short for a replay of peelings.
            rest = {"linked_list", "prefix_sum", *(["tiles"] if id.endswith("peeling") else [])}
            assert timed >= set(METHODS[id].pipelines) - rest, (id, timed)
    assert all(ms > 0 for row in rows.values() for ms in row["ms"])
    assert rows["exact", "tiles"]["max"] < 1e-5 < rows["wboit", "hardware"]["rmse"]
