"""The command line."""

import json
import subprocess
import sys
import time

import numpy as np
import pytest
from PIL import Image

import abuffer as ab
from abuffer import bench, measured
from abuffer.__main__ import main
from abuffer.commands.progress import LONG, status

OBJ = """\
v -1 -1 0
v 1 -1 0
v 0 1 0
f 1 2 3
"""


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "triangle.obj"
    path.write_text(OBJ)
    return str(path)


def failed(capsys, status, *argv):
    """The one line on stderr of a command that fails with this exit status."""
    assert main([str(a) for a in argv]) == status
    printed = capsys.readouterr()
    assert printed.out == ""
    (line,) = printed.err.splitlines()
    assert line.startswith("abuffer: error: ")
    return line.removeprefix("abuffer: error: ")


def test_render_writes_a_png_and_one_line(model, tmp_path, capsys):
    assert main(["render", model, "-o", str(tmp_path / "a.png"), "--width", "32", "--height", "24"]) == 0
    with Image.open(tmp_path / "a.png") as image:
        assert image.size == (32, 24)
    (line,) = capsys.readouterr().out.splitlines()
    assert line.startswith(f"{tmp_path / 'a.png'}: 32x24, ")
    assert "fragments" in line


def test_render_does_what_the_library_does(model, tmp_path):
    options = "--alpha .4 --shade --width 40 --height 30 --background 1,.5,0 --azimuth 70 --elevation -5"
    assert main(["render", model, "-o", str(tmp_path / "a.npz"), "--precision", "float64", *options.split()]) == 0
    scene = ab.Scene()
    scene.add(model, alpha=0.4, shade=True)
    camera = ab.Camera.fit(scene, azimuth=70, elevation=-5)
    expected = ab.render(scene, camera, width=40, height=30, background=(1, 0.5, 0), precision="float64")
    np.testing.assert_array_equal(ab.Frame.load(tmp_path / "a.npz").image, expected.image)


def test_render_takes_up_field_of_view_colour_and_opaque(model, tmp_path):
    options = "--up=0,0,1 --fov 30 --color 1,.5,0,.25 --opaque --width 40 --height 30"
    assert main(["render", model, "-o", str(tmp_path / "a.npz"), *options.split()]) == 0
    scene = ab.Scene()
    scene.add(model, color=(1, 0.5, 0, 0.25), opaque=True)
    camera = ab.Camera.fit(scene, up=(0, 0, 1), fov_y=30)
    expected = ab.render(scene, camera, width=40, height=30).image
    assert set(np.unique(expected[..., 3])) == {0, 1}
    np.testing.assert_array_equal(ab.Frame.load(tmp_path / "a.npz").image, expected)


def test_render_takes_samples_memory_and_a_pipeline(model, tmp_path):
    options = ["--samples", "8", "--memory", "1MB", "--pipeline", "tiles", "--width", "40", "--height", "30"]
    out, lists = tmp_path / "a.npz", tmp_path / "f.npz"
    assert main(["render", model, "-o", str(out), "--fragments", str(lists), *options]) == 0
    frame = ab.Frame.load(out)
    expected = ab.render(model, width=40, height=30, samples=8, device="cpu")
    np.testing.assert_array_equal(frame.image, expected.image)
    assert frame.plan["pipeline"] == "tiles"
    assert ab.Fragments.load(lists).samples == 8


def test_render_takes_samples_and_a_pipeline_of_a_gpu(model, tmp_path, needs_gpu):
    options = ["--samples", "4", "--device", "gpu", "--pipeline", "prefix_sum", "--width", "40", "--height", "30"]
    assert main(["render", model, "-o", str(tmp_path / "a.npz"), *options]) == 0
    frame = ab.Frame.load(tmp_path / "a.npz")
    expected = ab.render(model, width=40, height=30, samples=4, device="gpu", pipeline="prefix_sum")
    np.testing.assert_array_equal(frame.image, expected.image)
    assert frame.plan["pipeline"] == "prefix_sum"


def box(path, **material):
    """A grey box of a material of glTF, opaque unless it says otherwise."""
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.creation.box((1, 1, 1))
    material = trimesh.visual.material.PBRMaterial(baseColorFactor=[51, 51, 51, 255], **material)
    mesh.visual = trimesh.visual.TextureVisuals(material=material)
    mesh.export(path)
    return str(path)


@pytest.mark.parametrize("mode", ab.BLENDS)
def test_a_blend_is_that_of_all_models_opaque_ones_too(model, tmp_path, mode):
    glb = box(tmp_path / "box.glb")
    size = {"width": 40, "height": 30}
    options = f"--blend {mode} --background 1,.5,.25 --width 40 --height 30".split()
    assert main(["render", model, glb, "-o", str(tmp_path / "a.npz"), *options]) == 0
    scene = ab.Scene()
    scene.add([model, glb], blend=mode, opaque=None if mode == "over" else False)
    expected = ab.render(scene, background=(1, 0.5, 0.25), **size)
    np.testing.assert_array_equal(ab.Frame.load(tmp_path / "a.npz").image, expected.image)
    assert [mesh.blend for mesh in scene.meshes] == [mode, mode]
    assert [mesh.opaque for mesh in scene.meshes] == [False, mode == "over"]


def test_several_models_are_one_scene(model, tmp_path):
    other = tmp_path / "other.obj"
    other.write_text(OBJ.replace(" 0\n", " 1\n"))
    out = str(tmp_path / "a.npz")
    assert (
        main(["render", model, str(other), "-o", out, "--fragments", str(tmp_path / "f.npz"), "--elevation", "0"]) == 0
    )
    lists = ab.Fragments.load(tmp_path / "f.npz")
    assert lists.counts.max() == 2
    assert set(lists.primitive) == {0, 1}


def test_plan_is_printed_on_demand(model, tmp_path, capsys):
    assert main(["render", model, "-o", str(tmp_path / "a.png"), "--plan", "--device", "cpu"]) == 0
    assert "\ndevice: cpu (" in capsys.readouterr().out


def test_methods_are_printed(capsys):
    assert main(["methods"]) == 0
    assert "exact" in capsys.readouterr().out


def test_pipelines_are_printed(capsys):
    assert main(["pipelines"]) == 0
    assert "linked_list" in capsys.readouterr().out


def test_devices_are_printed(capsys):
    assert main(["devices"]) == 0
    assert "cpu" in capsys.readouterr().out


def test_the_version_is_printed(capsys):
    with pytest.raises(SystemExit) as end:
        main(["--version"])
    assert end.value.code == 0
    assert capsys.readouterr().out == f"abuffer {ab.__version__}\n"


def test_no_command_is_a_usage_error(capsys):
    with pytest.raises(SystemExit) as end:
        main([])
    assert end.value.code == 2
    assert "COMMAND" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--method", "exakt"], "did you mean 'exact'?"),
        (["--width", "10"], "give both width and height"),
        (["--background", "red"], "--background must be numbers such as 1,1,1, got 'red'"),
        (["--background", "1,1"], "background must"),
        (["--up", "z"], "--up must be numbers such as 1,1,1, got 'z'"),
        (["--up", "0,1"], "up must have shape (3,)"),
        (["--memory", "lots"], "memory must be bytes"),
        (["--samples", "3"], "samples must be one of 1, 2, 4, 8, 16, got 3"),
        (["--blend", "addition"], "did you mean 'additive'?"),
        (["--blend", "screen", "--opaque"], "--opaque surfaces are not blended"),
        (["--blend", "screen", "--color", "2,0,0"], "blend modes multiply and screen take RGB in [0, 1]"),
        (["--pipeline", "tile"], "did you mean 'tiles'?"),
        (["--pipeline", "linked_list", "--device", "cpu"], "linked_list"),
        (["--alpha", "2"], "alpha must be between 0"),
        (["--fragments", "lists.csv"], "--fragments must end in .npz"),
    ],
)
def test_a_wrong_option_is_one_line_and_status_2(model, tmp_path, capsys, options, message):
    line = failed(capsys, 2, "render", model, "-o", tmp_path / "a.png", *options)
    assert message in line
    assert not (tmp_path / "a.png").exists()


def test_a_missing_model_is_status_2(tmp_path, capsys):
    assert "nothing.obj" in failed(capsys, 2, "render", tmp_path / "nothing.obj", "-o", tmp_path / "a.png")


@pytest.mark.parametrize(
    ("output", "message"), [("a.jpg", "must end in .png or .npz"), ("no/a.png", "not a directory")]
)
def test_an_output_that_cannot_be_written_is_known_before_the_render(tmp_path, capsys, output, message):
    assert message in failed(capsys, 2, "render", tmp_path / "nothing.obj", "-o", tmp_path / output)


def test_other_errors_are_status_1(model, tmp_path, capsys, monkeypatch):
    def broken(*_, **__):
        raise ab.DeviceError("the device\nwas lost")

    monkeypatch.setattr(ab, "render", broken)
    assert failed(capsys, 1, "render", model, "-o", tmp_path / "a.png") == "the device was lost"


def test_too_little_memory_is_status_1_and_says_how_much_it_takes(model, tmp_path, capsys):
    line = failed(capsys, 1, "render", model, "-o", tmp_path / "a.png", "--memory", "4", "--device", "cpu")
    assert "4 bytes are needed" in line
    assert "raise memory=" in line


def test_samples_that_a_gpu_lacks_are_status_1(model, tmp_path, capsys, needs_gpu):
    counts = []
    for count in (1, 2, 4, 8, 16):
        try:
            ab.render(model, width=1, height=1, samples=count, device="gpu")
        except ab.UnsupportedError:
            counts.append(count)
    if not counts:
        pytest.skip("this GPU has all of them")
    line = failed(capsys, 1, "render", model, "-o", tmp_path / "a.png", "--samples", counts[0], "--device", "gpu")
    assert f"has no {counts[0]} samples a pixel" in line


def test_a_number_that_is_none_is_a_usage_error(model, tmp_path, capsys):
    with pytest.raises(SystemExit) as end:
        main(["render", model, "-o", str(tmp_path / "a.png"), "--samples", "many"])
    assert end.value.code == 2
    assert "argument --samples: invalid int value: 'many'" in capsys.readouterr().err


def test_a_directory_as_output_is_status_1(model, tmp_path, capsys):
    (tmp_path / "a.png").mkdir()
    assert "a.png" in failed(capsys, 1, "render", model, "-o", tmp_path / "a.png")


def test_ctrl_c_is_quiet(model, tmp_path, capsys, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(ab, "render", interrupted)
    assert main(["render", model, "-o", str(tmp_path / "a.png")]) == 130
    assert capsys.readouterr() == ("", "")


def test_warnings_are_one_line(model, tmp_path):
    # In a process of its own, where warnings are no errors: a model with a texture that is ignored.
    textured = tmp_path / "textured.obj"
    textured.write_text("mtllib a.mtl\nvt 0 0\n" + OBJ.replace("f 1 2 3", "usemtl m\nf 1/1 2/1 3/1"))
    (tmp_path / "a.mtl").write_text("newmtl m\nKd 1 0 0\nmap_Kd a.png\n")
    Image.new("RGB", (2, 2), (255, 0, 0)).save(tmp_path / "a.png")
    command = [sys.executable, "-m", "abuffer", "render", str(textured), "-o", str(tmp_path / "out.png")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0
    (line,) = done.stderr.splitlines()
    assert line.startswith("abuffer: warning: ")
    assert "texture" in line


def test_an_error_of_the_process_is_its_exit_status(tmp_path):
    command = [sys.executable, "-m", "abuffer", "render", "nothing.obj", "-o", "a.png"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("abuffer: error: ")
    assert "Traceback" not in done.stderr


def test_nothing_is_shown_of_progress_unless_stderr_is_a_terminal(capsys):
    with status("rendering"):
        time.sleep(LONG + 0.1)
    assert capsys.readouterr() == ("", "")


def test_long_work_shows_progress_on_a_terminal(capsys, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")  # rich takes stderr for a terminal then
    with status("rendering"):
        time.sleep(LONG + 0.3)
    assert "rendering" in capsys.readouterr().err


def test_short_work_shows_nothing_on_a_terminal(capsys, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    with status("rendering"):
        pass
    assert "rendering" not in capsys.readouterr().err


def test_without_rich_there_is_no_progress(capsys, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setitem(sys.modules, "rich.console", None)
    with status("rendering"):
        time.sleep(LONG + 0.1)
    assert capsys.readouterr() == ("", "")


# ---- bench ----


def test_bench_prints_each_case_and_the_row_that_auto_chooses_by(needs_gpu, monkeypatch, capsys):
    monkeypatch.setattr(bench, "SCENES", {"few": (2, 40), "many": (30, 6)})
    monkeypatch.setattr(bench, "WIDTH", 64)
    monkeypatch.setattr(bench, "HEIGHT", 48)
    assert main(["bench", "--repeats", "1", "--calibrate"]) == 0
    lines, start = capsys.readouterr().out.split("{", 1)
    assert [line.split()[:2] for line in lines.splitlines()[1:]] == [
        [case, scene] for case in measured.CASES for scene in ("few", "many")
    ]
    entry = json.loads("{" + start)
    assert entry["device"] in ab.devices()
    assert all(entry[case][scene] > 0 for case in measured.CASES for scene in ("few", "many"))


def test_a_case_that_fails_is_a_line_and_leaves_the_choice_as_it_was(monkeypatch, capsys):
    rows = [
        {"case": "image", "scene": "few", "error": "it lacks 4 samples"},
        {"case": "image", "scene": "many", "tiles_ms": 1.0, "linked_list_ms": 3.0, "ratio": 0.3333, "device": "Voodoo"},
    ]
    monkeypatch.setattr(bench, "compare", lambda *_: iter(rows))
    assert main(["bench", "--calibrate"]) == 0
    out = capsys.readouterr().out
    assert "it lacks 4 samples" in out
    assert json.loads(out[out.index("{") :]) == {"device": "Voodoo", "image": {"few": 1.0, "many": 0.33}}


def test_bench_needs_a_gpu_and_a_repeat(capsys):
    assert "--repeats" in failed(capsys, 2, "bench", "--repeats", "0")
    assert "pipelines of a GPU" in failed(capsys, 2, "bench", "--device", "cpu")
