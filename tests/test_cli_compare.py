"""The commands that compare and inspect: in processes of their own, as they are used."""

import json
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from PIL import Image

import abuffer as ab
from abuffer.commands import progress

pytest.importorskip("matplotlib", reason="pip install 'abuffer[compare]'")
pytest.importorskip("jinja2", reason="pip install 'abuffer[compare]'")

OBJ = """\
v -1 -1 0
v 1 -1 0
v 0 1 0
v -1 -1 .5
v 1 -1 .5
v 0 1 .5
f 1 2 3
f 4 5 6
"""
SMALL = ("--width", "48", "--height", "36", "--device", "cpu")
QUICK = (*SMALL, "--repeats", "2")


def command(*argv):
    return [sys.executable, "-m", "abuffer", *map(str, argv)]


def run(folder, *argv, **kw):
    """The finished process, in `folder`."""
    return subprocess.run(command(*argv), capture_output=True, text=True, encoding="utf-8", cwd=folder, **kw)


def failed(folder, status, *argv):
    """The one line on stderr of a command that fails with this exit status."""
    done = run(folder, *argv)
    assert (done.returncode, done.stdout) == (status, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith("abuffer: error: ")
    return line.removeprefix("abuffer: error: ")


def lines_of(table):
    """The cells of each line of a printed table."""
    return [re.split(r"\s{2,}", line.strip()) for line in table.splitlines()]


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """What a comparison wrote, and what it printed."""
    folder = tmp_path_factory.mktemp("compared")
    (folder / "two.obj").write_text(OBJ)
    options = ("--methods", "exact", "wboit:weight=8", "k_buffer:k=1,tail=average", "--sweep", "mlab:k=1,2")
    done = run(
        folder,
        "compare",
        "two.obj",
        "cyclic",
        "-o",
        "out/report",
        *options,
        *QUICK,
        "--alpha",
        ".5",
        "--background",
        "1",
    )
    assert done.returncode == 0, done.stderr
    return folder / "out" / "report", done


def test_what_was_measured_is_saved_and_is_what_the_library_measures(compared):
    folder, _ = compared
    saved = ab.Comparison.load(folder)
    model = ab.Scene()
    model.add(str(folder.parents[1] / "two.obj"), alpha=0.5)
    methods = ["exact", {"method": "wboit", "weight": "8"}, {"method": "k_buffer", "k": 1, "tail": "average"}]
    wanted = ab.compare(
        {"two": model, "cyclic": ab.scenes.cyclic()},
        width=48, height=36, devices=["cpu"], repeats=1, methods=methods, sweep={"mlab": {"k": [1, 2]}}, background=1,
    )  # fmt: skip
    assert without_times(saved.rows) == without_times(wanted.rows)
    for key, image in wanted.rendered.items():
        np.testing.assert_array_equal(saved.rendered[key], image)


def test_a_line_is_printed_for_each_row_and_last_where_the_report_is(compared):
    folder, done = compared
    head, *lines, last = lines_of(done.stdout)
    assert head == ["scene", "method", "device", "wall ms", "RMSE", "largest", "bytes/pixel"]
    rows = ab.Comparison.load(folder).rows
    assert [line[:3] for line in lines] == [[row["scene"], row["label"], "cpu"] for row in rows]
    for line, row in zip(lines, rows, strict=True):
        assert [float(cell) for cell in line[3:]] == pytest.approx(
            [row["wall_ms"], row["rmse"], row["max_abs"], row["bytes_per_pixel"]],
            rel=5e-3,  # three digits
            abs=5e-3,  # or two behind the point
        )
    assert last == [os.path.join("out", "report", "report.html")]


def test_a_report_and_a_plot_are_beside_it(compared):
    folder, _ = compared
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert page.startswith("<!doctype html>")
    assert all(label in page for label in ("wboit weight=8", "k_buffer k=1 tail=average", "mlab k=2"))
    with Image.open(folder / "plot.png") as plot:
        assert plot.format == "PNG"
        assert np.asarray(plot.convert("L")).min() < 100  # something is drawn


def test_a_suite_is_all_of_its_scenes(tmp_path):
    done = run(tmp_path, "compare", "standard", "-o", "out", "--methods", "exact", *SMALL, "--repeats", "1")
    assert done.returncode == 0, done.stderr
    assert [line[0] for line in lines_of(done.stdout)[1:-1]] == list(ab.scenes.suite("standard"))


def test_several_devices_and_pipelines_are_compared_and_a_failure_is_a_line(tmp_path, needs_gpu):
    (tmp_path / "two.obj").write_text(OBJ)
    devices = ("--device", "cpu", "--device", "gpu", "--width", "48", "--height", "36", "--repeats", "2")
    done = run(tmp_path, "compare", "two.obj", "-o", "out", "--methods", "exact", "wboit@hardware", *devices)
    assert done.returncode == 0, done.stderr
    lines = {(label, device == "cpu"): cells for _, label, device, *cells in lines_of(done.stdout)[1:-1]}
    assert set(lines) == {(label, is_cpu) for label in ("exact", "wboit@hardware") for is_cpu in (True, False)}
    assert "needs a GPU" in lines["wboit@hardware", True][0]
    assert len(lines["wboit@hardware", False]) == 4


def without_times(rows):
    return json.dumps(
        [{name: value for name, value in row.items() if "_ms" not in name and name != "frames"} for row in rows]
    )


MANY = ("--methods", "exact", "wboit", "--width", "64", "--height", "48", "--device", "cpu", "--repeats", "150")


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for one process")
def test_ctrl_c_keeps_what_is_done_and_resume_measures_the_rest(tmp_path):
    started = subprocess.Popen(
        command("compare", "cyclic", "smoke", "-o", "out", *MANY),
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, encoding="utf-8", cwd=tmp_path,
    )  # fmt: skip
    saved = tmp_path / "out" / "comparison.json"
    while not saved.exists() and started.poll() is None:
        time.sleep(0.005)
    started.send_signal(signal.SIGINT)  # smoke is not done: 150 turns take longer than this
    out, err = started.communicate()
    assert (started.returncode, out) == (130, "")
    assert err.splitlines()[-1] == (
        "abuffer: stopped: finished scenes are in 'out'; the same command with --resume goes on from there"
    )
    assert "Traceback" not in err
    kept = json.loads(saved.read_text(encoding="utf-8"))["rows"]
    assert [(row["scene"], row["label"]) for row in kept] == [("cyclic", "exact"), ("cyclic", "wboit")]

    resumed = run(tmp_path, "compare", "cyclic", "smoke", "-o", "out", *MANY, "--resume")
    assert resumed.returncode == 0, resumed.stderr
    assert "cyclic" not in resumed.stderr and "smoke" in resumed.stderr
    rows = json.loads(saved.read_text(encoding="utf-8"))["rows"]
    assert json.dumps(rows[:2]) == json.dumps(kept)  # with their times, which no second measurement would repeat
    whole = run(tmp_path, "compare", "cyclic", "smoke", "-o", "whole", *MANY[:-1], "1")
    assert whole.returncode == 0, whole.stderr
    resumed, whole = (ab.Comparison.load(tmp_path / folder).rows for folder in ("out", "whole"))
    assert without_times(resumed) == without_times(whole)
    assert (tmp_path / "out" / "report.html").exists()


def test_a_comparison_is_not_measured_over_unless_it_is_resumed(compared):
    folder, _ = compared
    before = (folder / "comparison.json").read_bytes()
    line = failed(folder, 2, "compare", "cyclic", "-o", folder, *QUICK)
    assert "holds a comparison already: --resume goes on with it" in line
    assert (folder / "comparison.json").read_bytes() == before


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (["compare", "standrd"], "did you mean 'standard'?"),
        (["compare", "hare"], "did you mean 'hair'?"),
        (["compare", "hair", "hair"], "there are two scenes named hair"),
        (["compare", "nothing.obj"], "there is no file 'nothing.obj'"),
        (["compare", "cyclic", "--methods", "wbolt"], "did you mean 'wboit'?"),
        (["compare", "cyclic", "--methods", "wboit@hardwear"], "did you mean 'hardware'?"),
        (["compare", "cyclic", "--methods", "mlab:kk=3"], "did you mean 'k'?"),
        (["compare", "cyclic", "--methods", "mlab:k=0"], "k must be"),
        (["compare", "cyclic", "--methods", "mlab:k"], "as in mlab:k=8, got 'mlab:k'"),
        (["compare", "cyclic", "--methods", "mlab:k=2,k=4"], "gives each parameter once"),
        (["compare", "cyclic", "--methods", "mlab:method=exact"], "gives each parameter once"),
        (["compare", "cyclic", "--methods", "mlab:"], "as in mlab:k=8, got 'mlab:'"),
        (["compare", "cyclic", "--sweep", "mlab"], "as in mlab:k=2,4,8, got 'mlab'"),
        (["compare", "cyclic", "--sweep", "mlap:k=1,2"], "did you mean 'mlab'?"),
        (["compare", "cyclic", "--background", "red"], "--background must be numbers such as 1,1,1"),
        (["compare", "cyclic", "--repeats", "0"], "repeats must be at least 1"),
        (["compare", "cyclic", "--width", "10"], "give both width and height"),
        (["inspect", "hare"], "did you mean 'hair'?"),
        (["inspect", "standard"], "a model that is no file must be one of"),
    ],
)
def test_what_is_wrong_is_one_line_and_status_2_before_anything_is_measured(tmp_path, argv, message):
    line = failed(tmp_path, 2, *argv, *(("-o", "out") if argv[0] == "compare" else ()))
    assert message in line
    assert not (tmp_path / "out" / "comparison.json").exists()


def test_a_device_that_is_not_there_is_status_1(tmp_path):
    assert "no device's name contains 'Voodoo'" in failed(
        tmp_path, 1, "compare", "cyclic", "-o", "out", "--device", "Voodoo"
    )


def test_a_picture_that_cannot_be_written_is_known_before_the_render(tmp_path):
    assert "--output must end in .png" in failed(tmp_path, 2, "inspect", "nothing.obj", "-o", "a.jpg")


def test_the_help_lists_every_command(tmp_path):
    done = run(tmp_path, "--help")
    listed = re.findall(r"^    (\w+)", done.stdout, re.MULTILINE)
    assert set(listed) == {"render", "compare", "inspect", "bench", "devices", "pipelines", "methods"}


# ---- inspect ----


def test_inspect_prints_what_the_library_finds_with_every_pixel_in_the_histogram(tmp_path):
    done = run(tmp_path, "inspect", "nested_spheres", "-o", "depths.png", *SMALL)
    assert done.returncode == 0, done.stderr
    s = ab.scenes.nested_spheres()
    found = ab.inspect(ab.render(s.scene, s.camera, width=48, height=36, device="cpu", fragments="count"))
    said, head, *lines = done.stdout.splitlines()
    assert said == repr(found)
    assert head.split() == ["fragments", "pixels"]
    bars = {}
    for line in lines:
        count, pixels, *bar = line.split()
        assert int(pixels.replace(",", "")) == found.histogram[int(count)]
        bars[int(count)] = len(bar[0]) if bar else 0
    assert list(bars) == list(range(1, found.deepest + 1))
    assert max(bars.values()) == bars[int(found.histogram[1:].argmax()) + 1] == 50
    with Image.open(tmp_path / "depths.png") as picture:
        assert picture.format == "PNG"


def test_of_deep_pixels_the_histogram_has_ranges_that_hold_all_pixels(tmp_path):
    done = run(tmp_path, "inspect", "smoke", *SMALL)
    s = ab.scenes.smoke()
    found = ab.inspect(ab.render(s.scene, s.camera, width=48, height=36, device="cpu", fragments="count"))
    lines = [line.split() for line in done.stdout.splitlines()[2:]]
    assert 8 <= len(lines) <= 16
    assert sum(int(line[1].replace(",", "")) for line in lines) == (found.counts > 0).sum()
    ranges = [tuple(map(int, line[0].split("-"))) for line in lines]
    assert (ranges[0][0], ranges[-1][-1]) == (1, found.deepest)


def test_a_scene_that_is_not_seen_has_no_bars(tmp_path):
    (tmp_path / "glass.obj").write_text(OBJ)
    seen = run(tmp_path, "inspect", "glass.obj", *SMALL)
    assert seen.stdout.count("#") > 0
    trimesh = pytest.importorskip("trimesh")
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "opaque.glb")  # opaque surfaces are in no list
    done = run(tmp_path, "inspect", "opaque.glb", *SMALL)
    assert done.returncode == 0, done.stderr
    assert "0 fragments" in done.stdout and "#" not in done.stdout


# ---- progress ----


def test_steps_are_a_bar_on_a_terminal(capsys, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")  # rich takes stderr for a terminal then
    with progress.steps() as step:
        step(3, 12, "hair: wboit")
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "hair: wboit" in printed.err and "3/12" in printed.err and "abuffer:" not in printed.err


@pytest.mark.parametrize("rich", [True, False])
def test_steps_are_lines_elsewhere_and_without_rich(capsys, monkeypatch, rich):
    if not rich:
        monkeypatch.setenv("FORCE_COLOR", "1")
        monkeypatch.setitem(sys.modules, "rich.console", None)
    monkeypatch.setattr(progress, "EVERY", 0.0)
    with progress.steps() as step:
        step(0, 12, "hair: exact")
        time.sleep(0.01)
        step(6, 12, "hair: wboit")
    first, second = capsys.readouterr().err.splitlines()
    assert first == "abuffer: hair: exact (0 of 12 steps)"
    assert re.fullmatch(r"abuffer: hair: wboit \(6 of 12 steps, about \d+ s left\)", second)


def test_lines_do_not_come_one_after_another(capsys):
    with progress.steps() as step:
        for done in range(100):
            step(done, 100, "hair: exact")
    assert len(capsys.readouterr().err.splitlines()) == 1
