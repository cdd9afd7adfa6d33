"""Peers: what they are told and what they say is what it is, and one that cannot draw is a row that says why.

The peers here are fakes, which run in this Python; tests/test_pyrender.py has a real one.
"""

import json
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest

import abuffer as ab
import peers_environment
import peers_protocol
from abuffer._srgb import encode_srgb

SIZE = WIDTH, HEIGHT = 32, 24
COMMAND = Path(peers_protocol.__file__).with_name("peers.py")
BACKGROUND = (0.25, 0.5, 0.75)
CAMERA = ab.Camera.look_at((0.5, 0.25, 9), (0, 0, 0))

FAKE = """
import numpy as np

def prepared(scene, variant):
    count = 0

    def frame():
        nonlocal count
        count += 1
        shape = scene.height, scene.width
{body}

    return {{"frame": frame, "srgb": {srgb}, "version": "1.2", "device": "paper", "notes": variant}}
"""
# Each mesh is one colour in all pixels, the first the farthest.
SHEETS = """
image = scene.background
for mesh in scene.meshes:
    alpha = 1 if mesh.opaque else mesh.colors[0, 3]
    image = image * (1 - alpha) + mesh.colors[0, :3] * alpha
return np.broadcast_to(image, (*shape, 3))
"""
COUNT = "return np.full((*shape, 4), count, np.uint8)"


@pytest.fixture
def fake(tmp_path):
    """Writes a peer whose frame is so made, and returns its path."""

    def written(body, srgb=False, name="fake", first=""):
        path = tmp_path / f"{name}.py"
        path.write_text(first + FAKE.format(body=textwrap.indent(body, " " * 8), srgb=srgb))
        return path

    return written


def sheets(*colors, **options):
    """Triangles over the whole view, a mesh each, the first the farthest."""
    corners = [[(-60, -60, z), (60, -60, z), (0, 90, z)] for z in range(len(colors))]
    return [ab.Mesh([c], colors=rgba, **options) for c, rgba in zip(corners, colors, strict=True)]


SCENE = ab.Scene([*sheets((1, 0, 0), opaque=True), *sheets((0, 1, 0, 0.25), (0, 0, 1, 0.75))])


def arrays(scene=SCENE, **changes):
    return peers_protocol.arrays_of(scene, CAMERA, SIZE, **{"background": BACKGROUND} | changes)


def test_a_peer_gets_the_scene_and_its_image_comes_back(fake):
    found = peers_protocol.drawn(fake(SHEETS), "what it knows", arrays())
    exact = ab.render(SCENE, CAMERA, width=WIDTH, height=HEIGHT, background=BACKGROUND, precision="float64")
    np.testing.assert_allclose(found.image, exact.image, atol=1e-6)  # colours are float32
    assert found.covered.all()
    assert (found.version, found.device, found.notes) == ("1.2", "paper", "what it knows")
    other = peers_protocol.drawn(fake(SHEETS), "", arrays(ab.Scene(SCENE.meshes[::-1])))
    assert np.abs(other.image - exact.image).max() > 0.1


def test_pixels_that_show_no_surface_are_told(fake):
    nothing = ab.Scene([ab.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]])])
    half = "image = np.zeros((*shape, 3)); image[:, 5:] = scene.meshes[0].opaque; return image"
    found = peers_protocol.drawn(fake(half), "", arrays(nothing))
    assert not found.image[..., :3].any()  # translucent, and so it does not draw it
    assert found.covered[:, 5:].all() and not found.covered[:, :5].any()


def test_frames_that_warm_up_are_not_timed(fake):
    found = peers_protocol.drawn(fake(COUNT), "", arrays(), repeats=3)
    assert len(found.ms) == 3 and min(found.ms) >= 0
    assert (found.image * 255 == 5).all()  # two were drawn before


def test_what_is_slow_is_told_from_fewer_frames(fake):
    late = "import __main__; __main__.ENOUGH = -1  # from the start\n"
    found = peers_protocol.drawn(fake(COUNT, first=late), "", arrays(), repeats=3)
    assert len(found.ms) == 1
    assert (found.image * 255 == 1).all()


def test_an_encoded_image_is_decoded_and_its_alpha_is_not(fake):
    found = peers_protocol.drawn(fake("return np.full((*shape, 4), 0.5)", srgb=True), "", arrays())
    assert found.image[3, 4] == pytest.approx([0.21404114] * 3 + [0.5], abs=1e-8)  # ((0.5 + 0.055) / 1.055)^2.4
    levels = np.linspace(0, 1, 256).reshape(16, 16, 1).repeat(4, axis=2)
    encoded = np.concatenate([encode_srgb(levels[..., :3]), levels[..., 3:]], axis=2)
    np.testing.assert_allclose(peers_protocol.decoded(encoded), levels, atol=1e-7)  # of the curve's own two pieces


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("raise ValueError('no such driver')", "\nValueError: no such driver$"),
        ("return np.zeros((scene.width, scene.height, 4))", r"shape \(32, 24, 4\): asked was \(24, 32, 3 or 4\)"),
        ("return np.zeros(shape)", r"shape \(24, 32\)"),
        ("import os; os._exit(3)", "\nexit status 3$"),
    ],
)
def test_what_is_no_image_of_the_scene_is_an_error(fake, body, message):
    with pytest.raises(RuntimeError, match=message):
        peers_protocol.drawn(fake(body), "", arrays())


def test_a_peer_that_does_not_end_is_stopped(fake):
    with pytest.raises(RuntimeError, match=r"\nnot done after 0\.5 s$"):
        peers_protocol.drawn(fake("import time; time.sleep(60)"), "", arrays(), timeout=0.5)


@pytest.mark.parametrize(
    "camera",
    [CAMERA, ab.Camera.orthographic((1, 2, 9), (0, 0, 0), height=4), ab.Camera.look_at((0, 0, 0.5), (0, 0, 0))],
    ids=["perspective", "parallel", "in the scene"],
)
def test_matrices_are_those_of_opengl_and_cut_nothing_in_view(camera):
    scene = ab.Scene(ab.scenes.random_triangles(n=20).scene)
    found = peers_protocol.arrays_of(scene, camera, SIZE, BACKGROUND)
    points = np.concatenate([found["positions_0"], np.ones((60, 1))], axis=1)
    clip = points @ (found["projection"] @ found["view"]).T
    xy, depth = camera.project(scene.meshes[0].positions, *SIZE)
    near, far = found["range"]
    seen = depth > near
    assert seen.sum() > 20
    ndc = clip[seen, :3] / clip[seen, 3:]
    np.testing.assert_allclose((ndc[:, :2] * (0.5, -0.5) + 0.5) * SIZE, xy[seen], rtol=1e-9, atol=1e-9)
    assert np.abs(ndc[:, 2]).max() <= 1
    assert depth.max() < far
    assert (np.argsort(ndc[:, 2]) == np.argsort(depth[seen])).all()
    assert seen.all() or (camera.is_perspective and near <= far / 999)


@pytest.mark.parametrize("indexed", [True, False])
@pytest.mark.parametrize("mode", ["one", "vertex", "face", "corner"])
def test_colours_are_those_of_corners_whatever_they_are_given_for(mode, indexed):
    rng = np.random.default_rng(0)
    positions, faces = rng.random((6, 3), np.float32), np.array([[0, 1, 2], [2, 1, 5]]) if indexed else None
    shape = {"one": (4,), "vertex": (6, 4), "face": (2, 4), "corner": (2, 3, 4)}[mode]
    colors = rng.random(shape, np.float32)
    corners = np.arange(6).reshape(2, 3) if faces is None else faces
    wanted = {
        "one": lambda: np.broadcast_to(colors, (2, 3, 4)),
        "vertex": lambda: colors[corners],
        "face": lambda: np.broadcast_to(colors[:, None], (2, 3, 4)),
        "corner": lambda: colors,
    }[mode]()
    found = arrays(ab.Scene([ab.Mesh(positions, faces, colors, color_mode=mode)]))
    np.testing.assert_array_equal(found["colors_0"][found["faces_0"]], wanted)
    np.testing.assert_array_equal(found["positions_0"][found["faces_0"]], positions[corners])


def test_meshes_are_sorted_by_their_middles_where_nobody_says():
    scene = ab.Scene([ab.Mesh([[0, 0, 0], [4, 0, 0], [0, 2, 6]])])
    assert arrays(scene)["origin_0"].tolist() == [2, 1, 3]
    assert arrays(scene, origins=[(7, 8, 9)])["origin_0"].tolist() == [7, 8, 9]


@pytest.mark.parametrize("options", [{"blend": "additive"}, {"cull": "back"}, {"opaque": True, "alpha_cutoff": 0.5}])
def test_what_peers_cannot_draw_is_refused(options):
    with pytest.raises(RuntimeError, match=r"blended by over alone: mesh 0 is Mesh\(1 face"):
        arrays(ab.Scene(sheets((1, 0, 0, 0.5), **options)))
    with pytest.raises(RuntimeError, match="opaque background, and its alpha is 0"):
        arrays(background=(0, 0, 0, 0))


@pytest.fixture
def commands(tmp_path, monkeypatch):
    """Commands that would have made environments in tmp_path; of `fails` the last one fails."""
    found = []

    def run(command, timeout):
        found.append([str(word) for word in command])
        if "venv" in command:
            python = Path(command[-1]) / "bin" / "python"
            python.parent.mkdir(parents=True)
            python.touch()
        if any("fails" in str(word) for word in command):
            raise RuntimeError("no such package")

    monkeypatch.setattr(peers_environment, "FOLDER", tmp_path / "environments")
    monkeypatch.setattr(peers_environment, "run", run)
    return found


def test_an_environment_is_made_once_and_again_when_its_pins_change(tmp_path, commands):
    pins = tmp_path / "peer.txt"
    pins.write_text("numpy==2.2.6")
    python = peers_environment.python_of(tmp_path / "peer.py")
    assert python == tmp_path / "environments" / "peer" / "bin" / "python"
    assert len(commands) == 3 and commands[-1][-1] == str(pins)
    assert not any("--no-index" in command for command in commands)
    peers_environment.python_of(tmp_path / "peer.py")
    assert len(commands) == 3
    pins.write_text("numpy==2.2.5")
    peers_environment.python_of(tmp_path / "peer.py", wheels=tmp_path)
    assert len(commands) == 6
    assert all(command[command.index("--find-links") + 1] == str(tmp_path) for command in commands[4:])


def test_an_environment_that_was_left_half_made_is_made_again(tmp_path, commands):
    (tmp_path / "fails.txt").write_text("nothing==1")
    for _ in range(2):
        with pytest.raises(RuntimeError, match="no such package"):
            peers_environment.python_of(tmp_path / "fails.py")
    assert [command[2:4] for command in commands].count(["-m", "venv"]) == 2


def test_without_pins_a_peer_runs_in_this_python(tmp_path, commands):
    assert peers_environment.python_of(tmp_path / "peer.py") == Path(sys.executable)
    assert commands == []


def test_peers_and_methods_are_rows_of_one_table(fake, tmp_path):
    """One peer draws the background alone, another cannot draw."""
    blank = fake("return np.broadcast_to(scene.background, (*shape, 3))", name="blank")
    broken = fake("raise ValueError('no | driver')", name="broken")
    paths = tmp_path / "new" / "rows.json", tmp_path / "new" / "table.md"
    command = [sys.executable, COMMAND, "--scenes", "intersecting", "--size", "32", "24", "--repeats", "2"]
    command += ["--peers", blank, f"{broken}:fast", "--json", paths[0], "--markdown", paths[1]]
    # No driver there: a table of the CPU's.
    environment = os.environ | {"VK_ICD_FILENAMES": "/nowhere", "VK_DRIVER_FILES": "/nowhere"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, encoding="utf-8")
    assert (done.returncode, done.stderr) == (0, "")

    rows = {row["renderer"]: row for row in json.loads(paths[0].read_text())["rows"]}
    ours = ["exact, cpu", "wboit, cpu", "mlab, cpu", "depth_peeling, cpu"]
    assert list(rows) == [*ours, "blank", "broken, fast"]
    assert all(len(rows[name]["ms"]) == 3 and not rows[name]["failure"] for name in (*ours, "blank"))
    assert rows["exact, cpu"]["errors"]["max_abs"] < 1e-6 < rows["wboit, cpu"]["errors"]["max_abs"]

    standard = ab.scenes.intersecting()
    grey = round(255 * standard.background[0]) / 255
    look = {"width": WIDTH, "height": HEIGHT, "background": (grey,) * 3, "precision": "float64", "fragments": "count"}
    eight = [m.replaced(colors=np.uint8(np.round(255 * m.colors)), color_mode="face") for m in standard.scene.meshes]
    exact = ab.render(eight, standard.camera, **look)
    off = np.abs(exact.image[..., :3] - grey)
    assert rows["blank"]["errors"]["rmse"] == pytest.approx(np.sqrt((off**2).mean()))
    assert (
        rows["blank"]["errors_off_edges"]["max_abs"] <= rows["blank"]["errors"]["max_abs"] == pytest.approx(off.max())
    )
    assert rows["blank"]["coverage_differs"] == np.count_nonzero(exact.counts) > 100

    assert "ValueError: no | driver" in rows["broken, fast"]["failure"]
    text = paths[1].read_text(encoding="utf-8")
    assert "| broken, fast |  | cannot: ValueError: no / driver |" in text
    assert "| blank | 1.2 | paper |  |" in text
    tables = [line.count("|") for line in text.splitlines() if line.startswith(("| blank |", "| broken", "| exact"))]
    assert len(set(tables[1:])) == 1  # after that of peers, all rows are as long
