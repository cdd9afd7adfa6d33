"""README.md and the pages in docs say what is true: their code runs and prints what stands there, their tables are the
real ones, their links lead somewhere, and each convention has a test of its name at the end of this file."""

import contextlib
import importlib.metadata
import io
import itertools
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import abuffer as ab
from abuffer.__main__ import main
from abuffer._methods import METHODS

ROOT = Path(__file__).parents[1]
README, DOCS = ROOT / "README.md", ROOT / "docs"
# Pages whose examples run.
CONVENTIONS, LISTS, BLENDING = DOCS / "conventions.md", DOCS / "lists.md", DOCS / "blending.md"
ADDING, SCENES, COMPARING = (DOCS / f"{name}.md" for name in ("adding-a-method", "scenes", "comparing"))
VALIDATING = DOCS / "validating.md"
PAGES = pytest.mark.parametrize(
    "page", [README, CONVENTIONS, LISTS, BLENDING, ADDING, SCENES, COMPARING, VALIDATING], ids=lambda page: page.stem
)


def blocks(page):
    """(language, text) of every fenced block."""
    return re.findall(r"^```(\w+)\n(.*?)^```$", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


def examples(page):
    """(code, what it prints, or None) of every Python block: a text block right after it is its output.

    Output in a txt block, not text, depends on the device: it is given as what its lines begin with.
    """
    found = [*blocks(page), (None, None)]
    outputs = {"text": lambda out: out, "txt": first_words}
    pairs = itertools.pairwise(found)
    return [
        (code, outputs.get(follower, lambda _: None)(out))
        for (kind, code), (follower, out) in pairs
        if kind == "python"
    ]


def first_words(text):
    return [line.split()[0] for line in text.splitlines()]


def has_adapter():
    return any("linked_list" in row["pipelines"] for row in ab.devices().values())


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty working directory with the models that the pages name, on a machine without a GPU."""
    trimesh = pytest.importorskip("trimesh")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ABUFFER_DEVICE", "cpu")  # what is printed is the same everywhere
    trimesh.creation.icosphere(subdivisions=3, radius=0.8).export("bunny.ply")
    trimesh.creation.box((1, 1, 1)).export("model.glb")
    registered = dict(METHODS)
    yield tmp_path
    METHODS.clear()
    METHODS.update(registered)


@PAGES
def test_every_example_runs_prints_what_the_text_says_and_writes_what_it_names(page, folder):
    """Those that name a GPU: where there is one."""
    pytest.importorskip("pandas")
    namespace = {}
    for number, (code, wanted) in enumerate(examples(page), 1):
        if '"gpu"' in code and not has_adapter():
            continue
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(code, f"{page.name}, Python block {number}", "exec"), namespace)
        out = printed.getvalue()
        assert wanted in (None, out, first_words(out)), f"{page.name}, Python block {number}"
        for name in re.findall(r'\.save\("(.+?)"\)', code):
            assert (folder / name).stat().st_size > 1000


@PAGES
def test_every_block_that_prints_has_its_output_there(page):
    printing = [(code, out) for code, out in examples(page) if "print(" in code]
    assert printing
    assert all(out for _, out in printing)


def test_the_examples_of_the_readme_need_no_gpu():
    assert len(examples(README)) >= 10
    assert not any('"gpu"' in code for code, _ in examples(README))


def test_the_commands_of_the_readme_run(folder, capsys):
    lines = [line for kind, text in blocks(README) if kind == "sh" for line in text.splitlines()]
    commands = [shlex.split(line)[1:] for line in lines if line.startswith("abuffer ")]
    assert len(commands) >= 4
    for command in commands:
        assert main(command) == 0
        assert capsys.readouterr().out
    assert ab.Fragments.load("both.npz").shape == (600, 800)


def test_the_make_targets_of_the_readme_exist():
    targets = re.findall(r"^make ([\w-]+)", README.read_text(encoding="utf-8"), re.MULTILINE)
    assert targets == ["demo", "test"]
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert all(re.search(rf"^{target}:", makefile, re.MULTILINE) for target in targets)


@pytest.mark.parametrize("table", [ab.pipelines])
def test_the_tables_of_the_readme_are_the_real_ones(table):
    """Also where the examples cannot run, and whatever they print."""
    assert f"```text\n{table()}\n```\n" in README.read_text(encoding="utf-8")


def test_the_table_of_blend_modes_has_them_all_and_says_which_commute():
    text = BLENDING.read_text(encoding="utf-8")
    assert re.findall(r'^\| `"(\w+)"` \|', text, re.MULTILINE) == list(ab.BLENDS)
    colors = [(0.9, 0.4, 0.1, 0.6), (0.3, 0.6, 0.9, 0.25)]  # given in this order whichever is in front

    def image(front, back, swapped):
        order = [1, 0] if swapped else [0, 1]
        modes = np.uint8([ab.BLENDS.index((front, back)[i]) for i in order])
        lists = ab.Fragments((1, 1), [0, 2], [1.0, 2.0], [colors[i] for i in order], blend=modes)
        return lists.composite(background=(0.2, 0.5, 0.8, 0.75))

    for mode in ab.BLENDS:
        row = re.search(rf"^\| \*\*{mode}\*\* \|(.+)\|$", text, re.MULTILINE).group(1)
        found = [np.abs(image(mode, other, False) - image(mode, other, True)).max() < 1e-12 for other in ab.BLENDS]
        assert [word.strip() == "yes" for word in row.split("|")] == found, mode


def test_the_table_of_node_formats_has_them_all_with_their_bytes(needs_gpu):
    text = LISTS.read_text(encoding="utf-8")
    rows = re.findall(r'^\| `"(\w+)"` \| (\d+) \|', text, re.MULTILINE)
    assert [name for name, _ in rows] == list(ab.options.NODE_CHOICES["node_format"])
    for name, size in rows:
        frame = render(square(0), node_format=name, device="gpu", pipeline="prefix_sum")
        assert frame.plan["node format"] == f"{name}, {size} bytes"
        assert frame.stats.bytes["nodes"] % int(size) == 0
        assert frame.stats.bytes["nodes"] >= int(size) * frame.stats.fragments > 0


def test_small_nodes_have_the_later_triangle_in_front_only_where_lists_are_asked_for(needs_gpu):
    red, blue = square(0, (1, 0, 0, 0.6)), square(0, (0, 0, 1, 0.6))  # alphas that 8 bits have
    for name in ab.options.NODE_CHOICES["node_format"]:
        one, other = (
            [render(scene, node_format=name, device="gpu", fragments=lists).image for lists in (False, True)]
            for scene in ([red, blue], [blue, red])
        )
        np.testing.assert_allclose(one[1][5, 5], over((0, 0, 1, 0.6), (1, 0, 0, 0.6)), rtol=1e-6)
        np.testing.assert_allclose(other[1][5, 5], over((1, 0, 0, 0.6), (0, 0, 1, 0.6)), rtol=1e-6)
        assert (one[0] == other[0]).all() == (name != "float32")


def test_the_picture_of_limits_and_what_is_said_of_it_are_what_the_script_makes(tmp_path):
    image = pytest.importorskip("PIL.Image")
    made = tmp_path / "limits" / "picture.png"
    command = [sys.executable, "-W", "error", ROOT / "examples" / "limit_policy.py", "--output", made]
    done = subprocess.run(command, capture_output=True, text=True, encoding="utf-8")
    assert (done.returncode, done.stderr) == (0, "")
    text = " ".join(LISTS.read_text(encoding="utf-8").split())
    assert set(re.findall(r"[\d,]+ of [\d,]+(?= fragments)", done.stdout)) == {"200,544 of 2,737,104"}
    assert "200,544 of 2,737,104" in text
    for policy, off, reverse in re.findall(r"^(\w+) 4: .*off by (\S+) at most; .* (\S+) from that$", done.stdout, re.M):
        assert f"The {policy.replace('_', ' ')} 4 are off by {off}" in text
        assert float(reverse) == 0 or f"by up to {reverse}" in text
    there, here = (np.asarray(image.open(path), dtype=int) for path in (DOCS / "limit_policy.png", made))
    assert there.shape == here.shape
    assert (np.abs(there - here) <= 1).all()


def test_an_antialiased_image_passes_the_check_with_the_edge_that_the_readme_names():
    assert "`edge=0.75`" in README.read_text(encoding="utf-8")
    rng = np.random.default_rng(0)
    scene = ab.Mesh(rng.uniform(-1, 1, (6, 3, 3)), colors=rng.random((6, 4)), color_mode="face")
    smooth = render(scene, width=192, height=144, samples=16)
    ab.testing.assert_matches_reference(smooth, scene, FRONT, edge=0.75)
    with pytest.raises(AssertionError, match="differs"):
        ab.testing.assert_matches_reference(smooth, scene, FRONT)


@PAGES
def test_links_to_files_lead_somewhere(page):
    links = re.findall(r"\]\(([^)]+)\)", page.read_text(encoding="utf-8"))
    local = [link for link in links if "://" not in link]
    assert local
    for link in local:
        assert (page.parent / link).is_file(), link


def test_the_first_screen_has_picture_code_and_commands():
    screen = README.read_text(encoding="utf-8").split("\n## ")[0]
    for part in ("docs/demo.png", "```python", "make demo", "make test", "pip install ."):
        assert part in screen


def test_the_readme_names_the_licence_and_the_extras_of_the_package():
    package, text = importlib.metadata.metadata("abuffer"), README.read_text(encoding="utf-8")
    assert text.rstrip().endswith(package["License-Expression"])
    named = re.findall(r"^\| `(\w+)` \|", text, re.MULTILINE)
    assert sorted(named) == sorted(package.get_all("Provides-Extra"))


# ---- the conventions, in the order in which docs/conventions.md has them ----

TESTED = []


def convention(title):
    """Marks the test of a convention."""

    def mark(test):
        TESTED.append(title)
        return test

    return mark


def test_every_convention_has_a_test_and_a_reason():
    lines = re.findall(r"^- \*\*(.+?)\*\*: (.+?)(?=\n\S|\n\n|\Z)", CONVENTIONS.read_text(encoding="utf-8"), re.M | re.S)
    assert [title for title, _ in lines] == TESTED
    for title, line in lines:
        assert line.count(" Why: ") + line.count("\n  Why: ") == 1, title


SIZE = {"width": 32, "height": 24}
FRONT = ab.Camera.look_at((0, 0, 3), (0, 0, 0))


def render(scene, camera=FRONT, **kw):
    return ab.render(scene, camera, **{"device": "cpu", **SIZE, **kw})


def square(z, color=(1, 1, 1, 0.5), size=4.0, **kw):
    """At depth 3 − z; of the default size it covers the image of FRONT."""
    corners = [[-size, -size, z], [size, -size, z], [size, size, z], [-size, size, z]]
    return ab.Mesh(corners, [[0, 1, 2], [0, 2, 3]], color, **kw)


def dot(x, y, z=0.0, size=0.1):
    """A small triangle around a point, towards the viewer."""
    return ab.Mesh([[x - size, y - size, z], [x + size, y - size, z], [x, y + size, z]], colors=(1, 1, 1, 0.5))


def middle(frame):
    """The mean [y, x] of what is covered, in pixels from the image's corner."""
    return np.argwhere(frame.image[..., 3] > 0).mean(axis=0) + 0.5


def over(*layers):
    """Straight RGBA layers, front first, as one premultiplied colour."""
    color, through = np.zeros(4), 1.0
    for *rgb, alpha in layers:
        color += through * alpha * np.array([*rgb, 1.0])
        through *= 1 - alpha
    return color


@convention("Axes")
def test_x_is_right_y_is_up_and_the_eye_looks_along_minus_z():
    camera = ab.Camera.from_pose(np.eye(4))
    assert middle(render(dot(0.4, 0, -2), camera))[1] > 16
    assert middle(render(dot(0, 0.4, -2), camera))[0] < 12
    assert render(dot(0, 0, 2), camera).stats.fragments == 0


@convention("Matrices")
def test_matrices_multiply_columns_and_a_transposed_one_is_refused():
    view, projection = FRONT.matrices(32, 24)
    point = np.array([0.3, 0.2, 0.5, 1])
    clip = projection @ view @ point
    xy, _ = FRONT.project([point[:3]], 32, 24)
    np.testing.assert_allclose(xy[0], (clip[:2] / clip[3] * (0.5, -0.5) + 0.5) * (32, 24))
    with pytest.raises(ab.ParameterError, match="transposed"):
        ab.Camera(view.T, projection)


@convention("Rigid views")
def test_scaled_sheared_and_mirrored_views_are_refused():
    shear = [[1, 0.5, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    for linear, what in ((np.diag([2.0, 2, 2, 1]), "scale 2"), (shear, "sheared"), (np.diag([-1.0, 1, 1, 1]), "mirr")):
        with pytest.raises(ab.ParameterError, match=what):
            ab.Camera(linear, FRONT.matrices(32, 24)[1])
        with pytest.raises(ab.ParameterError, match=what):
            ab.Camera.from_pose(linear)


@convention("Other cameras")
@pytest.mark.parametrize(("pixel_center", "x"), [(0.0, 20.5), (0.5, 20.0)])
def test_intrinsics_have_opencv_axes_and_either_pixel_centre(pixel_center, x):
    intrinsics = [[50, 0, 20], [0, 50, 10], [0, 0, 1]]
    camera = ab.Camera.from_intrinsics(intrinsics, np.eye(4), width=40, height=20, pixel_center=pixel_center)
    xy, depth = camera.project([[0, 0, 2], [0.1, 0.2, 2]], 40, 20)
    np.testing.assert_allclose(xy[0], (x, x - 10))
    np.testing.assert_allclose(xy[1] - xy[0], (2.5, 5))  # +X right, +Y down
    np.testing.assert_allclose(depth, 2)


@convention("Pixel centres")
def test_the_centre_of_a_pixel_is_at_one_half():
    xy, _ = FRONT.project([[0, 0, 0]], 33, 25)
    np.testing.assert_allclose(xy, [[16.5, 12.5]])
    frame = render(dot(0, 0, size=0.02), width=33, height=25)
    assert np.argwhere(frame.image[..., 3] > 0).tolist() == [[12, 16]]


@convention("Rows")
def test_row_0_is_on_top():
    image = render([dot(0, 0.8)]).image
    assert image[:12].any()
    assert not image[12:].any()


@convention("Field of view")
def test_fov_y_is_the_whole_vertical_angle_in_degrees():
    camera = ab.Camera.look_at((0, 0, 3), (0, 0, 0), fov_y=60)
    top = 3 * np.tan(np.radians(30))
    xy, _ = camera.project([[0, top, 0], [0, -top, 0]], 32, 24)
    np.testing.assert_allclose(xy[:, 1], [0, 24], atol=1e-12)
    with pytest.warns(UserWarning, match="radians"):
        ab.Camera.look_at((0, 0, 3), (0, 0, 0), fov_y=np.pi / 3)


@convention("Aspect")
def test_pixels_are_square_and_a_camera_keeps_its_aspect():
    for width, height in ((32, 24), (24, 32)):
        xy, _ = FRONT.project([[0, 0, 0], [1, 0, 0], [0, 1, 0]], width, height)
        assert xy[1, 0] - xy[0, 0] == pytest.approx(xy[0, 1] - xy[2, 1])
    camera = ab.Camera.from_intrinsics([[50, 0, 20], [0, 50, 10], [0, 0, 1]], np.eye(4), width=40, height=20)
    with pytest.raises(ab.ParameterError, match="aspect"):
        render(square(0), camera, width=40, height=40)


@convention("Depth")
def test_depth_is_along_the_axis_and_not_along_the_ray():
    frags = render(square(0), fragments=True, precision="float64").fragments
    np.testing.assert_allclose(frags.depth, 3, rtol=1e-12)
    points = frags.points(FRONT)
    assert np.linalg.norm(points - (0, 0, 3), axis=1).max() > 3.3  # what it is along the ray in a corner
    assert frags.depth[frags.offsets[0]] == pytest.approx(frags.depth[frags.offsets[12 * 32 + 16]])


@convention("Near and far")
def test_nothing_in_front_of_the_eye_is_cut_unless_asked():
    layers = [square(3 - depth, size=10 * depth) for depth in (0.001, 1, 1000)]
    assert (render(layers, fragments="count").counts == 3).all()
    between = ab.Camera.look_at((0, 0, 3), (0, 0, 0), near=0.1, far=10)
    assert (render(layers, between, fragments="count").counts == 1).all()


@convention("Coverage")
def test_a_shared_edge_through_pixel_centres_is_counted_once():
    # The square's diagonal passes through the centre of every pixel on the image's own diagonal.
    assert (render(square(0), fragments="count", width=24, height=24).counts == 1).all()
    # A triangle between the centres of pixels gives nothing, however close it comes.
    step = 2 * 3 * np.tan(np.radians(22.5)) / 24
    between = ab.Mesh(np.array([[0.05, 0.05, 0], [0.45, 0.05, 0], [0.05, 0.45, 0]]) * step)
    assert render(between, fragments="count", width=24, height=24).stats.fragments == 0


@convention("Samples")
def test_a_fragment_has_a_mask_of_standard_samples_and_a_pixel_is_their_mean():
    step = 2 * 3 * np.tan(np.radians(22.5)) / 24  # a pixel at depth 3
    # Right of the line through a pixel's centre: samples 1 and 3 of (-2, -6), (6, -2), (-6, 2), (2, 6) sixteenths.
    right = ab.Mesh([[0.5 * step, -9, 0], [0.5 * step, 9, 0], [9, 0, 0]], colors=(1, 1, 1, 0.5))
    frame = render(right, samples=4, fragments=True)
    assert frame.counts[12].tolist() == [0] * 16 + [1] * 16
    assert frame.fragments[12, 16].coverage.tolist() == [0b1010]
    assert frame.fragments[12, 20].coverage.tolist() == [0b1111]
    np.testing.assert_allclose(frame.image[12, 15:18, 3], (0, 0.25, 0.5))
    assert render(right, fragments=True).fragments.coverage is None


@convention("Where a fragment is taken")
def test_colour_and_depth_are_those_of_the_centre_or_else_of_the_lowest_covered_sample():
    step = 2 * 3 * np.tan(np.radians(22.5)) / 24
    for edge, at in ((0.25, 0.5), (0.75, 0.5 + 6 / 16)):  # left and right of the centre, in pixels; sample 1
        x0, x1 = edge * step, 16 * step
        ramp = ab.Mesh(
            [[x0, -9, 0], [x1, -9, 0], [x1, 9, 0], [x0, 9, 0]],
            [[0, 1, 2], [0, 2, 3]],
            [(x / step / 16, 0, 0, 0.5) for x in (x0, x1, x1, x0)],
            color_mode="vertex",
        )
        red = render(ramp, samples=4, fragments=True, precision="float64").fragments[12, 16].color[0, 0]
        assert red == pytest.approx(at / 16, abs=1e-6)


@convention("Sides")
def test_meshes_are_two_sided_and_counter_clockwise_is_the_front():
    front = [[-1, -1, 0], [1, -1, 0], [0, 1, 0]]
    for corners, culled in ((front, "front"), (front[::-1], "back")):
        seen = {cull: render(ab.Mesh(corners, cull=cull)).stats.fragments > 0 for cull in (None, "back", "front")}
        assert seen == {None: True, "back": culled != "back", "front": culled != "front"}


@convention("Interpolation")
def test_colours_are_interpolated_in_perspective_straight_and_apart_from_alpha():
    # A strip from depth 1, red, to depth 3, blue and invisible; seen halfway up the image of its near half.
    p = [[-9, -1, -1], [9, -1, -1], [9, -1, -3], [-9, -1, -3]]
    colors = [(1, 0, 0, 1), (1, 0, 0, 1), (0, 0, 1, 0), (0, 0, 1, 0)]
    strip = ab.Mesh(p, [[0, 1, 2], [0, 2, 3]], colors, color_mode="vertex")
    camera = ab.Camera.look_at((0, 0, 0), (0, 0, -1), fov_y=90)
    frags = render(strip, camera, fragments=True, precision="float64").fragments
    assert len(frags) > 200
    towards = (frags.depth - 1) / 2  # linear on the surface, not on the screen
    expected = np.stack([1 - towards, 0 * towards, towards, 1 - towards], axis=1)
    np.testing.assert_allclose(frags.color, expected, atol=1e-9)


@convention("Primitive numbers")
def test_triangles_are_numbered_through_all_meshes_seen_or_not():
    point = ab.Mesh([[0, 0, 0]] * 3)
    scene = ab.Scene([square(-9, opaque=True), point, square(9), square(0, name="seen")])
    frags = render(scene, fragments=True).fragments
    assert set(frags.primitive) == {5, 6}
    mesh, face = scene.locate([0, 1, 2, 3, 4, 5, 6])
    assert mesh.tolist() == [0, 0, 1, 2, 2, 3, 3]
    assert face.tolist() == [0, 1, 0, 0, 1, 0, 1]


@convention("Not finite")
def test_what_is_not_finite_is_refused_by_name_and_what_overflows_is_counted():
    with pytest.raises(ab.SceneError, match=r"positions\[1, 2\] is nan"):
        ab.Mesh([[0, 0, 0], [1, 0, np.nan], [0, 1, 0]])
    huge = ab.Mesh([[-1e200, -1e200, -1], [1e200, -1e200, -1], [0, 1e200, -1]])
    frame = render([huge, square(0)])
    assert frame.stats.rejected_triangles == 1
    np.testing.assert_array_equal(frame.image, render(square(0)).image)


@convention("Order")
def test_the_order_of_arrival_changes_nothing():
    layers = [square(z, (1 - z, z, 0.5, 0.4)) for z in (0.0, 0.25, 0.5, 0.75)]
    images = [render([layers[i] for i in order]).image for order in ([0, 1, 2, 3], [3, 2, 1, 0], [2, 0, 3, 1])]
    np.testing.assert_array_equal(images[0], images[1])
    np.testing.assert_array_equal(images[0], images[2])
    wanted = over(*[(1 - z, z, 0.5, 0.4) for z in (0.75, 0.5, 0.25, 0.0)])
    np.testing.assert_allclose(images[0][0, 0], wanted, rtol=1e-6)


@convention("Equal depth")
def test_at_equal_depth_the_later_triangle_is_in_front_and_both_are_kept():
    red, blue = (1, 0, 0, 0.5), (0, 0, 1, 0.5)
    np.testing.assert_allclose(render([square(0, red), square(0, blue)]).image[5, 5], over(blue, red))
    np.testing.assert_allclose(render([square(0, blue), square(0, red)]).image[5, 5], over(red, blue))


@convention("Opaque geometry")
def test_opaque_geometry_is_the_background_of_its_pixels():
    wall, film = square(0, (0, 0.5, 1), opaque=True), square(0, (1, 0, 0, 0.5))
    frame = render([square(-1), wall, film], fragments=True)
    assert (frame.counts == 1).all()  # of the film, at the wall's own depth; nothing behind, and not the wall
    np.testing.assert_allclose(frame.fragments.background[5, 5], (0, 0.5, 1, 1))
    np.testing.assert_allclose(frame.image[5, 5], over((1, 0, 0, 0.5), (0, 0.5, 1, 1)))
    every = render([square(-1), wall, film], fragments="all")
    assert (every.counts == 3).all()
    np.testing.assert_array_equal(every.image, frame.image)
    # A wall in front of the right half of pixel 16 hides the film's samples there.
    edge = 2 * 3 * np.tan(np.radians(22.5)) / 24 / 2 * 2 / 3
    half = ab.Mesh(
        [[edge, -9, 1], [9, -9, 1], [9, 9, 1], [edge, 9, 1]], [[0, 1, 2], [0, 2, 3]], (0, 0.5, 1), opaque=True
    )
    frame = render([half, film], fragments=True, samples=4)
    assert frame.fragments[12, 16].coverage.tolist() == [0b0101]
    assert (frame.counts[:, 17:] == 0).all()


@convention("Cut-outs")
def test_alpha_cutoff_makes_holes_and_nothing_in_between():
    corners = [[-4, -4, 0], [4, -4, 0], [4, 4, 0], [-4, 4, 0]]
    fading = [(1, 1, 1, 0), (1, 1, 1, 1), (1, 1, 1, 1), (1, 1, 1, 0)]  # to the right
    leaf = ab.Mesh(corners, [[0, 1, 2], [0, 2, 3]], fading, color_mode="vertex", opaque=True, alpha_cutoff=0.5)
    for samples in (1, 8):
        alpha = render(leaf, samples=samples).image[..., 3]
        assert (alpha[:, :16] == 0).all()
        assert (alpha[:, 16:] == 1).all()


@convention("Colours are numbers")
def test_colours_are_blended_as_they_are_and_encoded_only_when_asked():
    frame = render(square(0, (0.5, 0.5, 0.5, 0.5)), background=(1, 1, 1))
    np.testing.assert_allclose(frame.image[0, 0], (0.75, 0.75, 0.75, 1))
    assert frame.to_uint8()[0, 0].tolist() == [191, 191, 191, 255]
    encoded = 255 * (1.055 * 0.75 ** (1 / 2.4) - 0.055)
    assert frame.to_uint8(srgb=True)[0, 0, 0] == round(encoded)


@convention("Colours of glTF")
def test_linear_colours_of_gltf_are_brought_to_srgb_when_loaded(folder):
    import trimesh

    model = trimesh.creation.box((1, 1, 1))
    model.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial(baseColorFactor=[51] * 4))
    model.export("grey.glb")
    (linear,), (srgb,) = (ab.Scene().add("grey.glb", space=space, opaque=False) for space in ("linear", "srgb"))
    np.testing.assert_allclose(linear.colors, [0.2] * 4, atol=1e-6)
    encoded = 1.055 * 0.2 ** (1 / 2.4) - 0.055
    np.testing.assert_allclose(srgb.colors, [encoded] * 3 + [0.2], atol=1e-6)  # alpha is linear


@convention("Colour types")
def test_what_the_types_of_colours_mean():
    bright = render(square(0, (7.5, 0, 0, 0.5))).image[0, 0]
    np.testing.assert_allclose(bright, (3.75, 0, 0, 0.5))
    np.testing.assert_allclose(square(0, np.uint8([51, 0, 255, 255])).colors, (0.2, 0, 1, 1))
    np.testing.assert_array_equal(square(0, (1, 0, 0, 1)).colors, (1, 0, 0, 1))
    for wrong in ((2, 0, 0), (-0.1, 0, 0), (0.0, 0, 0, 1.1)):
        with pytest.raises(ab.SceneError, match=r"colors\["):
            square(0, wrong)
    for mode in ab.BLENDS:
        refuses = (
            pytest.raises(ab.SceneError, match=mode) if mode in ("multiply", "screen") else contextlib.nullcontext()
        )
        with refuses:
            square(0, (7.5, 0, 0, 0.5), blend=mode)


@convention("Missing alpha")
def test_three_channels_have_alpha_1():
    np.testing.assert_array_equal(render(square(0, (0.5, 0.25, 0))).image[0, 0], (0.5, 0.25, 0, 1))
    np.testing.assert_array_equal(render([], background=(0.5, 0.25, 0)).image[0, 0], (0.5, 0.25, 0, 1))


@convention("Straight in, premultiplied out")
def test_colours_go_in_straight_and_come_out_premultiplied():
    color = (0.75, 0.5, 0.25, 0.25)
    frame = render(square(0, color), fragments=True)
    np.testing.assert_allclose(frame.fragments.color[0], color)
    np.testing.assert_allclose(frame.image[0, 0], (0.1875, 0.125, 0.0625, 0.25))
    np.testing.assert_allclose(frame.straight[0, 0], color)
    np.testing.assert_allclose(frame.fragments.composite()[0, 0], frame.image[0, 0])


@convention("Blend modes")
def test_each_mesh_is_blended_by_its_own_mode_onto_what_is_behind_it():
    c, alpha, d = np.array((0.5, 0.25, 0.75)), 0.5, np.array((0.2, 0.6, 0.4))
    wanted = {
        "over": d * (1 - alpha) + alpha * c,
        "additive": d + alpha * c,
        "multiply": d * (1 - alpha + alpha * c),
        "screen": 1 - (1 - d) * (1 - alpha * c),
        "premultiplied": d * (1 - alpha) + c,
    }
    assert list(wanted) == list(ab.BLENDS)
    for mode, result in wanted.items():
        layer = square(0, (*c, alpha), blend=mode)
        np.testing.assert_allclose(render(layer, background=d).image[5, 5, :3], result, rtol=1e-6)
        # Whatever is in front is blended onto that.
        mixed = render([square(1, (1, 1, 1, 0.25)), layer], background=d).image[5, 5, :3]
        np.testing.assert_allclose(mixed, 0.75 * result + 0.25, rtol=1e-6)


@convention("Blends of your own")
def test_a_blend_of_your_own_goes_back_to_front():
    seen = []

    def keep(dst, src, depth):
        seen.append(depth[0])
        return np.sqrt(dst * src[:, :3])

    layers = [square(z, (0.2 + z / 2, 0.5, 0.9, 0.5), blend=ab.Blend(numpy=keep)) for z in (0.0, 1.0)]
    wanted = np.sqrt(np.sqrt(np.array((0.2, 0.5, 0.9))) * (0.7, 0.5, 0.9))
    for order in ("front_to_back", "back_to_front"):
        image = render(layers, background=(1, 1, 1), blend_order=order).image
        np.testing.assert_allclose(image[5, 5, :3], wanted, rtol=1e-6)
    assert seen == [3, 2, 3, 2]


@convention("Alpha out")
def test_alpha_out_is_what_is_held_back_of_the_light():
    layers = [square(0, (1, 1, 1, 0.5)), square(1, (1, 1, 1, 0.25))]
    through = render(layers, background=(1, 1, 1, 0.2)).image[0, 0, 3]
    assert through == pytest.approx(1 - 0.5 * 0.75 * 0.8)
    # Over another background later is the same as over it at once.
    frame, behind = render(layers), np.array((0.2, 0.4, 0.6, 1.0))
    later = frame.image + (1 - frame.image[..., 3:]) * behind
    np.testing.assert_allclose(later, render(layers, background=behind).image, rtol=1e-6)
    for mode in ab.BLENDS:
        raised = render(square(0, (1, 1, 1, 0.5), blend=mode), background=(1, 1, 1, 0.25)).image[0, 0, 3]
        assert raised == (0.625 if mode in ("over", "premultiplied") else 0.25)


@convention("Background")
def test_the_background_is_the_farthest_layer_one_colour_or_an_image():
    glass = (1, 0, 0, 0.5)
    behind = np.random.default_rng(0).random((24, 32, 4))
    image = render(square(0, glass), background=behind).image
    np.testing.assert_allclose(image[7, 9], over(glass, behind[7, 9]), rtol=1e-6)
    np.testing.assert_allclose(render([], background=(0.5, 0.5, 0.5, 0.5)).image[0, 0], (0.25, 0.25, 0.25, 0.5))
    wall = square(-1, (0, 0, 1), opaque=True)
    assert render([wall, square(0, glass)], background=behind, fragments=True).fragments.background.shape == (24, 32, 4)
    frame = render(square(0, glass), background=behind, fragments=True, samples=2)
    assert frame.fragments.background.shape == (24, 32, 2, 4)
    np.testing.assert_array_equal(frame.fragments.background[:, :, 0], frame.fragments.background[:, :, 1])
    opaque = render([wall, square(0, glass)], background=behind, fragments=True, samples=2).fragments.background
    np.testing.assert_array_equal(opaque[7, 9], [(0, 0, 1, 1)] * 2)


@convention("Display")
def test_what_eight_straight_bits_cannot_hold_is_said():
    frame = render(square(0, (4.0, 0, 0, 0.5)))
    with pytest.warns(UserWarning, match="colour exceeds alpha"):
        assert frame.to_uint8()[0, 0].tolist() == [255, 0, 0, 255]
    with pytest.warns(UserWarning, match="colour exceeds 1"):
        render(square(0, (4.0, 0, 0))).to_uint8()
    assert frame.image[0, 0, 0] == 2
    assert render(square(0, (0.8, 0, 0, 0.5))).to_uint8()[0, 0].tolist() == [204, 0, 0, 128]


@convention("Nothing is dropped")
def test_a_thousand_layers_are_a_thousand_fragments():
    n, alpha = 1000, 0.01
    stack = [square(-k / 100, (1, 1, 1, alpha), size=40) for k in range(n)]
    frame = render(stack, width=4, height=3, fragments=True)
    assert (frame.counts == n).all()
    assert frame.stats.dropped_fragments == 0
    np.testing.assert_allclose(frame.image, 1 - (1 - alpha) ** n, rtol=1e-4)
    limited = render(stack, width=4, height=3, fragments=True, max_sorted_fragments=18)
    assert limited.stats.dropped_fragments == 12 * (n - 18)
    np.testing.assert_allclose(limited.image, 1 - (1 - alpha) ** 18, rtol=1e-5)
    assert (limited.counts == n).all()


@convention("Memory")
def test_less_memory_gives_the_same_bits_or_an_error():
    rng = np.random.default_rng(0)
    scene = ab.Mesh(rng.uniform(-1, 1, (800, 3, 3)), colors=rng.random((800, 4)), color_mode="face")
    size = {"width": 96, "height": 96, "fragments": True}
    plenty, little = render(scene, **size), render(scene, memory="40kB", **size)
    assert plenty.stats.bands == 1 < little.stats.bands
    np.testing.assert_array_equal(plenty.image, little.image)
    np.testing.assert_array_equal(plenty.fragments.key, little.fragments.key)
    with pytest.raises(ab.CapacityError, match="raise memory="):
        render(scene, memory=16, **size)


@convention("Precision")
def test_positions_are_relative_to_the_scene_in_float32_and_whole_in_float64():
    away = np.array([1e6, 2e6, -3e6])
    mesh = ab.Mesh(np.random.default_rng(2).integers(-64, 64, (30, 3, 3)) / 64)
    moved = mesh.transformed([[1, 0, 0, away[0]], [0, 1, 0, away[1]], [0, 0, 1, away[2]], [0, 0, 0, 1]])
    there = ab.Camera.look_at(away + (0, 0, 3), away)
    for precision in ("float32", "float64"):
        here = render(mesh, precision=precision, fragments="count")
        assert here.image.dtype == precision
        np.testing.assert_array_equal(render(moved, there, precision=precision, fragments="count").counts, here.counts)
    # In float32 these layers tie, and the later one is in front.
    near, far = square(1e-8, (1, 0, 0)), square(0, (0, 0, 1))
    for precision, seen in (("float64", (1, 0, 0, 1)), ("float32", (0, 0, 1, 1))):
        np.testing.assert_array_equal(render([near, far], precision=precision).image[12, 16], seen)


@convention("Repeats")
def test_the_same_call_gives_the_same_bits():
    rng = np.random.default_rng(1)
    scene = ab.Mesh(rng.uniform(-1, 1, (300, 3, 3)), colors=rng.random((300, 3, 4)))
    first = render(scene, width=64, height=64)
    for _ in range(3):
        assert (render(scene, width=64, height=64).image == first.image).all()
