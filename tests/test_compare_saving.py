"""Comparisons on disk: whole, replaced whole, and gone on with where what is asked for is the same."""

import json
import math
import shutil

import numpy as np
import pytest

import abuffer as ab
from abuffer import ParameterError, _core, comparing
from abuffer._methods import METHODS
from abuffer.comparing import store
from abuffer.comparing.environment import environment
from comparisons import CAMERA, QUICK, SHEETS, SIZE, sheets


@pytest.fixture(scope="module")
def compared():
    scenes = {"sheets": SHEETS, "random": ab.scenes.random_triangles(n=60)}
    return ab.compare(scenes, CAMERA, **SIZE, **QUICK, sweep={"mlab": {"k": [1, 2, 8]}})


def test_it_is_saved_and_loaded_whole(compared, tmp_path):
    compared.save(tmp_path)
    again = ab.Comparison.load(tmp_path)
    assert json.dumps(again.rows) == json.dumps(compared.rows)
    assert again.environment == compared.environment
    assert list(again.rendered) == list(compared.rendered)
    for key, image in compared.rendered.items():
        np.testing.assert_array_equal(again.rendered[key], image)
    for scene in compared.scenes:
        np.testing.assert_array_equal(again.references[scene], compared.references[scene])
        np.testing.assert_array_equal(again.exact[scene].fragments.depth, compared.exact[scene].fragments.depth)
    with pytest.raises(ParameterError, match="holds no comparison"):
        ab.Comparison.load(tmp_path / "nothing")


def without_times(rows):
    return repr([{name: value for name, value in row.items() if "_ms" not in name} for row in rows])


def test_a_resumed_comparison_is_that_of_an_uninterrupted_one(tmp_path):
    scenes = {"sheets": SHEETS, "random": ab.scenes.random_triangles(n=60), "cyclic": ab.scenes.cyclic()}
    arguments = {"camera": CAMERA, **SIZE, **QUICK, "methods": ["exact", "wboit"]}
    whole = ab.compare(scenes, **arguments)

    def interrupt(done, all, what):
        if what.startswith("random: turn 2"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        ab.compare(scenes, **arguments, save=tmp_path, progress=interrupt)
    assert ab.Comparison.load(tmp_path).scenes == ["sheets"]
    measured = []
    resumed = ab.compare(
        scenes, **arguments, save=tmp_path, resume=True, progress=lambda done, all, what: measured.append(what)
    )
    assert not any(what.startswith("sheets") for what in measured)
    assert without_times(resumed.rows) == without_times(whole.rows)
    for key, image in whole.rendered.items():
        np.testing.assert_array_equal(resumed.rendered[key], image)
    assert without_times(ab.Comparison.load(tmp_path).rows) == without_times(whole.rows)


ASKED = {"camera": CAMERA, **SIZE, **QUICK, "methods": ["exact", {"method": "mlab", "k": 1, "label": "lists"}]}
# What is asked for instead, and what that is.
OTHERS = {
    "another size": {"width": 40, "height": 30},
    "another reference": {"reference": "fragments"},
    "another camera": {"camera": ab.Camera.look_at((0, 0, 8), (0, 0, 0))},
    "another background": {"background": (0, 0, 1)},
    "another meshes": {"scenes": {"sheets": sheets((1, 0, 0, 0.5), (0, 1, 0, 0.25), (0, 0, 1, 0.5))}},
    r"other methods \(lists\)": {"methods": ["exact", {"method": "mlab", "k": 8, "label": "lists"}]},
    r"other methods \(lists, wboit\)": {"methods": ["exact", "wboit"]},
    r"other methods \(wboit\)": {"methods": [*ASKED["methods"], "wboit"]},
}


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    folder = tmp_path_factory.mktemp("saved")
    ab.compare({"sheets": SHEETS}, **ASKED, save=folder)
    return folder


@pytest.mark.parametrize("what", OTHERS)
def test_what_is_not_the_same_is_not_resumed(saved, what):
    """A new device would be measured beside rows of something else."""
    before = (saved / "comparison.json").read_bytes()
    with pytest.raises(ParameterError, match=f"sheets was measured with {what}.*: save to another folder"):
        ab.compare(**{"scenes": {"sheets": SHEETS}} | ASKED | OTHERS[what], save=saved, resume=True)
    assert (saved / "comparison.json").read_bytes() == before


def test_what_a_users_functions_compute_is_of_what_was_measured(tmp_path):
    """A blend and a method of the same name, whose code is another."""

    def scene(factor):
        own = ab.Blend(numpy=lambda dst, src, depth: dst + src[:, :3] * factor, name="mine")
        return {"blend": ab.Mesh(SHEETS.positions, colors=(1, 0, 0, 0.5), blend=own)}

    arguments = ASKED | {"methods": ["exact"], "save": tmp_path, "resume": True}
    assert ab.compare(scene(0.5), **arguments).rows[0]["failure"] == ""
    assert len(ab.compare(scene(0.5), **arguments).rows) == 1
    with pytest.raises(ParameterError, match="measured with another meshes"):
        ab.compare(scene(0.9), **arguments)

    arguments = ASKED | {"methods": ["exact", "mine"], "save": tmp_path / "methods", "resume": True}
    try:
        ab.register_method("mine", order="any", numpy=lambda color, depth, primitive, behind: behind * 0.5)
        ab.compare({"sheets": SHEETS}, **arguments)
        ab.register_method("mine", order="any", numpy=lambda color, depth, primitive, behind: behind * 0.9)
        with pytest.raises(ParameterError, match="measured with another code of methods"):
            ab.compare({"sheets": SHEETS}, **arguments)
    finally:
        METHODS.pop("mine", None)


@pytest.mark.parametrize(("name", "value"), [("processor", "another"), ("commit", "abc"), ("metrics", {})])
def test_rows_of_another_machine_are_not_resumed(saved, monkeypatch, name, value):
    monkeypatch.setattr(comparing, "environment", lambda devices: environment(devices) | {name: value})
    with pytest.raises(ParameterError, match=f"measured with {name}"):
        ab.compare({"sheets": SHEETS}, **ASKED, save=saved, resume=True)


def test_rows_of_another_driver_are_not_resumed(saved, monkeypatch):
    def other(devices):
        return environment(devices) | {"devices": {"cpu": {"driver": "another"}}}

    monkeypatch.setattr(comparing, "environment", other)
    with pytest.raises(ParameterError, match="measured with the driver of cpu"):
        ab.compare({"sheets": SHEETS}, **ASKED, save=saved, resume=True)


def test_a_folder_that_does_not_say_what_was_measured_is_read_and_not_resumed(tmp_path, saved):
    shutil.copytree(saved, tmp_path / "old")
    head = json.loads((tmp_path / "old" / "comparison.json").read_text())
    del head["scenes"][0]["asked"]
    (tmp_path / "old" / "comparison.json").write_text(json.dumps(head))
    assert ab.Comparison.load(tmp_path / "old").scenes == ["sheets"]
    with pytest.raises(ParameterError, match="not known what sheets was measured with"):
        ab.compare({"sheets": SHEETS}, **ASKED, save=tmp_path / "old", resume=True)


def test_an_interrupted_overwriting_leaves_no_mixture(tmp_path, compared, saved, monkeypatch):
    shutil.copytree(saved, tmp_path / "folder")
    monkeypatch.setattr(store, "_write", lambda path, arrays: exec("raise KeyboardInterrupt"))
    with pytest.raises(KeyboardInterrupt):
        compared.save(tmp_path / "folder")
    with pytest.raises(ParameterError, match="holds no comparison"):
        ab.Comparison.load(tmp_path / "folder")


def test_rows_of_another_version_are_not_resumed(saved, monkeypatch):
    monkeypatch.setattr(_core, "VERSION", "9.9")
    with pytest.raises(ParameterError, match=r"measured with abuffer '.*', and this is '9.9'"):
        ab.compare({"sheets": SHEETS}, **ASKED, save=saved, resume=True)


def test_without_resume_a_folder_is_not_measured_over(saved):
    with pytest.raises(ParameterError, match="holds a comparison: give resume=True"):
        ab.compare({"sheets": SHEETS}, **ASKED, save=saved)


def test_a_device_is_added_by_resuming(tmp_path, needs_gpu):
    ab.compare({"sheets": SHEETS}, **ASKED, save=tmp_path)
    both = ASKED | {"devices": ["cpu", "gpu"]}
    found = ab.compare({"sheets": SHEETS}, **both, save=tmp_path, resume=True)
    assert len(found.rows) == 4 and len(found.devices) == 2
    assert set(found.environment["devices"]) == set(found.devices)
    again = ab.compare({"sheets": SHEETS}, **ASKED, save=tmp_path, resume=True)
    assert set(again.environment["devices"]) == set(again.devices) == set(found.devices)
    assert max(row["rmse"] for row in found.select(label="exact")) < 1e-6


def test_a_folder_that_cannot_be_written_to_is_known_at_once(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ParameterError, match="cannot be written to"):
        ab.compare(SHEETS, **ASKED, save=tmp_path / "file", progress=lambda *_: pytest.fail("it was measured"))


def test_a_folder_is_overwritten_whole(tmp_path, compared):
    other = ab.compare(ab.scenes.cyclic(), **SIZE, **QUICK, methods=["exact"])
    other.save(tmp_path)
    compared.save(tmp_path)
    again = ab.Comparison.load(tmp_path)
    np.testing.assert_array_equal(again.exact["sheets"].image, compared.exact["sheets"].image)


def test_what_was_saved_before_does_not_stay(tmp_path, compared):
    """Two comparisons of one scene's name in turns, and a folder that is gone."""
    other = ab.compare({"sheets": sheets((1, 0, 0, 0.5))}, CAMERA, **SIZE, **QUICK, methods=["exact"])
    for each in (compared, other, compared):
        each.save(tmp_path / "folder")
    again = ab.Comparison.load(tmp_path / "folder")
    np.testing.assert_array_equal(again.exact["sheets"].image, compared.exact["sheets"].image)
    shutil.rmtree(tmp_path / "folder")
    compared.save(tmp_path / "folder")
    assert ab.Comparison.load(tmp_path / "folder").scenes == compared.scenes


def test_what_is_not_finite_is_in_json_that_all_can_read(tmp_path, compared):
    compared.save(tmp_path)
    text = (tmp_path / "comparison.json").read_text(encoding="utf-8")
    rows = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))["rows"]
    assert {row["gpu_ms"] for row in rows} == {"nan"}
    assert all(math.isnan(row["gpu_ms"]) for row in ab.Comparison.load(tmp_path).rows)


def test_parameters_of_numpy_are_saved(tmp_path):
    methods = [{"method": "mlab", "k": np.int64(2)}, {"method": "fourier", "depth_range": np.array([1.0, 9.0])}]
    found = ab.compare(SHEETS, CAMERA, **SIZE, **QUICK, methods=methods, save=tmp_path)
    assert [row["parameters"] for row in found.rows] == [{"k": 2}, {"depth_range": [1.0, 9.0]}]
    assert ab.Comparison.load(tmp_path).rows[0]["parameters"] == {"k": 2}


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("comparison.json", b'{"format": "abuffer-comp'),
        ("comparison.json", b"[]"),
        ("comparison.json", b"\xff\xfe"),
        ("comparison.json", b'{"format": "abuffer-comparison-1"}'),
        ("comparison.json", b'{"format": "abuffer-comparison-9"}'),
        (
            "comparison.json",
            b'{"format": "abuffer-comparison-1", "scenes": [], "environment": {}, "rows": [{"scene": "a", "label": "b"}]}',
        ),
        ("images-0.npz", b"PK"),
        ("exact-0.npz", None),
    ],
)
def test_a_damaged_folder_is_named(tmp_path, saved, name, content):
    shutil.copytree(saved, tmp_path / "copy")
    if content is None:
        (tmp_path / "copy" / name).unlink()
    else:
        (tmp_path / "copy" / name).write_bytes(content)
    with pytest.raises(ParameterError, match=r"is damaged|is of format|is not an \.npz"):
        ab.Comparison.load(tmp_path / "copy")


def test_rows_of_another_renderer_are_saved_and_do_not_hinder_resuming(tmp_path):
    found = ab.compare({"sheets": SHEETS}, **ASKED, save=tmp_path)
    found.add_image("mine", np.zeros((36, 48, 4)), ms=[1.0])
    found.save(tmp_path)
    again = ab.compare({"sheets": SHEETS}, **ASKED, save=tmp_path, resume=True)
    assert [row["label"] for row in again.rows] == ["exact", "lists", "mine"]
    np.testing.assert_array_equal(again.images_of()["mine"], 0)
