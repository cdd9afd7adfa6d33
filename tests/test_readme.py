"""README.md and docs/conventions.md say what is true: their code runs and prints what stands there, their tables are the
real ones, their links lead somewhere, and each convention has a test of its name at the end of this file."""

import contextlib
import importlib.metadata
import io
import itertools
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

import abuffer as ab
from abuffer.__main__ import main

ROOT = Path(__file__).parents[1]
README, CONVENTIONS = ROOT / "README.md", ROOT / "docs" / "conventions.md"
PAGES = pytest.mark.parametrize("page", [README, CONVENTIONS], ids=lambda page: page.stem)


def blocks(page):
    """(language, text) of every fenced block."""
    return re.findall(r"^```(\w+)\n(.*?)^```$", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


def examples(page):
    """(code, what it prints, or None) of every Python block: a text block right after it is its output."""
    found = [*blocks(page), (None, None)]
    pairs = itertools.pairwise(found)
    return [(code, out if follower == "text" else None) for (kind, code), (follower, out) in pairs if kind == "python"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty working directory with the models that the pages name, on a machine without a GPU."""
    trimesh = pytest.importorskip("trimesh")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ABUFFER_DEVICE", "cpu")  # what is printed is the same everywhere
    trimesh.creation.icosphere(subdivisions=3, radius=0.8).export("bunny.ply")
    trimesh.creation.box((1, 1, 1)).export("model.glb")
    return tmp_path


@PAGES
def test_every_example_runs_prints_what_the_text_says_and_writes_what_it_names(page, folder):
    pytest.importorskip("pandas")
    namespace = {}
    for number, (code, wanted) in enumerate(examples(page), 1):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(code, f"{page.name}, Python block {number}", "exec"), namespace)
        assert wanted is None or printed.getvalue() == wanted, f"{page.name}, Python block {number}"
        for name in re.findall(r'\.save\("(.+?)"\)', code):
            assert (folder / name).stat().st_size > 1000


def test_every_block_of_the_readme_that_prints_has_its_output_there():
    printing = [(code, out) for code, out in examples(README) if "print(" in code]
    assert len(printing) >= 5
    assert all(out for _, out in printing)


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


@pytest.mark.parametrize("table", [ab.methods, ab.pipelines])
def test_the_tables_of_the_readme_are_the_real_ones(table):
    """Also where the examples cannot run, and whatever they print."""
    assert f"```text\n{table()}\n```\n" in README.read_text(encoding="utf-8")


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


@convention("Cut-outs")
def test_alpha_cutoff_makes_holes_and_nothing_in_between():
    corners = [[-4, -4, 0], [4, -4, 0], [4, 4, 0], [-4, 4, 0]]
    fading = [(1, 1, 1, 0), (1, 1, 1, 1), (1, 1, 1, 1), (1, 1, 1, 0)]  # to the right
    leaf = ab.Mesh(corners, [[0, 1, 2], [0, 2, 3]], fading, color_mode="vertex", opaque=True, alpha_cutoff=0.5)
    alpha = render(leaf).image[..., 3]
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


@convention("Alpha out")
def test_alpha_out_is_what_is_held_back_of_the_light():
    layers = [square(0, (1, 1, 1, 0.5)), square(1, (1, 1, 1, 0.25))]
    through = render(layers, background=(1, 1, 1, 0.2)).image[0, 0, 3]
    assert through == pytest.approx(1 - 0.5 * 0.75 * 0.8)
    # Over another background later is the same as over it at once.
    frame, behind = render(layers), np.array((0.2, 0.4, 0.6, 1.0))
    later = frame.image + (1 - frame.image[..., 3:]) * behind
    np.testing.assert_allclose(later, render(layers, background=behind).image, rtol=1e-6)


@convention("Background")
def test_the_background_is_the_farthest_layer_one_colour_or_an_image():
    glass = (1, 0, 0, 0.5)
    behind = np.random.default_rng(0).random((24, 32, 4))
    image = render(square(0, glass), background=behind).image
    np.testing.assert_allclose(image[7, 9], over(glass, behind[7, 9]), rtol=1e-6)
    np.testing.assert_allclose(render([], background=(0.5, 0.5, 0.5, 0.5)).image[0, 0], (0.25, 0.25, 0.25, 0.5))


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
