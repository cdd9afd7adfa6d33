"""What a Scene takes, and how adding changes it."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import abuffer as ab

TRIANGLE = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])
MIRROR = np.diag([-1.0, 1, 1, 1])


def triangle(**options):
    return ab.Mesh(TRIANGLE, **options)


def one(meshes):
    assert len(meshes) == 1
    return meshes[0]


# what it takes


def test_a_scene_may_be_empty():
    for scene in (ab.Scene(), ab.Scene([]), ab.Scene(()), ab.Scene([[]])):
        assert scene.meshes == ()
        assert scene.triangle_count == 0


def test_a_scene_takes_meshes_scenes_and_lists_of_these_in_order():
    a, b, c, d = (triangle(name=name) for name in "abcd")
    scene = ab.Scene([a, (b, [c]), ab.Scene(d), []])
    assert [mesh.name for mesh in scene.meshes] == ["a", "b", "c", "d"]
    assert ab.Scene(a).meshes == (a,)


def test_a_mesh_added_as_it_is_stays_the_same_object():
    mesh = triangle()
    scene = ab.Scene()
    assert scene.add(mesh)[0] is mesh
    assert scene.meshes[0] is mesh


def test_a_scene_takes_trimesh_objects_and_paths(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box()
    box.export(tmp_path / "box.ply")
    scene = ab.Scene([box, trimesh.Scene(box), tmp_path / "box.ply", str(tmp_path / "box.ply")])
    assert [mesh.face_count for mesh in scene.meshes] == [12] * 4
    for mesh in scene.meshes:
        np.testing.assert_array_equal(mesh.triangles(), box.triangles)


def test_adding_a_scene_takes_what_it_holds_then():
    scene = ab.Scene(triangle())
    assert len(scene.add(scene)) == 1
    assert len(scene.meshes) == 2


@pytest.mark.parametrize("item", [None, 3, TRIANGLE, {"a": 1}, ab.Mesh])
def test_what_a_scene_does_not_take(item):
    with pytest.raises(ab.SceneError, match=f"cannot add this {type(item).__name__}: give a Mesh, a Scene"):
        ab.Scene().add(item)


def test_on_an_error_nothing_is_added():
    scene = ab.Scene()
    with pytest.raises(ab.SceneError):
        scene.add([triangle(), None])
    assert scene.meshes == ()


def test_meshes_cannot_be_changed_behind_the_scenes_back():
    assert isinstance(ab.Scene(triangle()).meshes, tuple)


def test_a_scene_pickles():
    scene = pickle.loads(pickle.dumps(ab.Scene([triangle(name="a"), triangle()])))
    assert [mesh.name for mesh in scene.meshes] == ["a", None]


def test_repr_counts():
    assert repr(ab.Scene([triangle(), ab.Mesh([])])) == "Scene(2 meshes, 1 triangles)"


# overrides


def test_add_returns_the_meshes_as_they_were_added():
    scene = ab.Scene(triangle())
    added = scene.add([triangle(), triangle()], color=(1, 0, 0))
    assert tuple(added) == scene.meshes[1:]
    assert [mesh.colors.tolist() for mesh in added] == [[1, 0, 0, 1]] * 2


def test_color_replaces_and_alpha_multiplies():
    mesh = one(ab.Scene().add(triangle(colors=np.eye(3)), color=(1, 0.5, 0, 0.5), alpha=0.25))
    np.testing.assert_array_equal(mesh.colors, (1, 0.5, 0, 0.125))
    assert mesh.color_mode == "one"


def test_alpha_multiplies_once_on_every_way_in():
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box(vertex_colors=(255, 255, 255, 51))
    items = [triangle(colors=(1, 1, 1, 0.2)), ab.Scene(triangle(colors=(1, 1, 1, 0.2))), [box], box]
    for item in items:
        mesh = one(ab.Scene().add(item, alpha=0.5))
        np.testing.assert_allclose(mesh.colors[..., 3], 0.1, rtol=1e-15)


def test_names_of_several_meshes_have_the_name_in_front():
    scene = ab.Scene()
    assert one(scene.add(triangle(name="a"), name="x")).name == "x"
    assert [m.name for m in scene.add([triangle(name="a"), triangle()], name="x")] == ["x/a", "x"]
    assert [m.name for m in scene.add([triangle(name="a"), triangle()])] == ["a", None]


def test_options_of_a_mesh_are_kept_unless_given():
    given = triangle(opaque=True, alpha_cutoff=0.25, cull="back")
    kept = one(ab.Scene().add(given, color=(1, 0, 0)))
    assert (kept.opaque, kept.alpha_cutoff, kept.cull, kept.blend) == (True, 0.25, "back", "over")
    changed = one(ab.Scene().add(given, alpha_cutoff=0.5, cull="front", blend="over"))
    assert (changed.opaque, changed.alpha_cutoff, changed.cull) == (True, 0.5, "front")


@pytest.mark.parametrize("kind", ["mesh", "scene", "list", "trimesh"])
def test_blend_replaces_the_items_own(kind):
    mesh = triangle(blend="multiply")
    item = {"mesh": mesh, "scene": ab.Scene(mesh), "list": [mesh]}.get(kind)
    if item is None:
        item = pytest.importorskip("trimesh").Trimesh(TRIANGLE, [(0, 1, 2)])
    scene = ab.Scene()
    own = ab.Blend("dst")
    for blend in ("additive", own):
        assert one(scene.add(item, blend=blend)).blend is blend
    assert one(scene.add(item)).blend == ("over" if kind == "trimesh" else "multiply")


def test_a_blend_goes_with_the_other_options_that_are_given_with_it():
    """What the item's own blend would refuse does not matter."""
    multiplied = triangle(blend="multiply")
    assert one(ab.Scene().add(multiplied, blend="over", opaque=True)).opaque
    assert one(ab.Scene().add(multiplied, blend="over", color=(2.0, 0, 0))).colors[0] == 2
    assert one(ab.Scene().add(triangle(opaque=True), blend="screen", opaque=False)).blend == "screen"
    assert one(ab.Scene().add(triangle(opaque=True), blend="screen", alpha=0.5)).blend == "screen"
    with pytest.raises(ab.ParameterError, match="give opaque=False"):
        ab.Scene().add(triangle(opaque=True), blend="screen")
    with pytest.raises(ab.ParameterError, match="give opaque=False"):
        ab.Scene().add(multiplied, opaque=True)


@pytest.mark.parametrize(
    ("own", "options", "opaque", "cutoff"),
    [
        ({}, {}, False, None),
        ({}, {"opaque": True}, True, None),
        ({}, {"opaque": True, "alpha_cutoff": 0.5}, True, 0.5),
        ({"opaque": True}, {"opaque": False}, False, None),
        ({"opaque": True}, {"alpha": 1.0}, True, None),
        ({"opaque": True}, {"alpha": 0.5}, False, None),
        ({"opaque": True}, {"alpha": 0.5, "opaque": True}, True, None),
        ({"opaque": True}, {"color": (1, 0, 0, 0.5)}, False, None),
        ({"opaque": True}, {"color": (1, 0, 0)}, True, None),
        ({"opaque": True}, {"color": np.array([255, 0, 0, 128], np.uint8)}, False, None),
        ({"opaque": True, "alpha_cutoff": 0.25}, {"alpha": 0.5}, False, None),
        ({"opaque": True, "alpha_cutoff": 0.25}, {"opaque": False}, False, None),
        ({"opaque": True, "alpha_cutoff": 0.25}, {"alpha": 0.5, "alpha_cutoff": 0.1}, True, 0.1),
        ({"opaque": True, "alpha_cutoff": 0.25}, {"opaque": True}, True, 0.25),
    ],
)
def test_an_alpha_below_one_makes_it_translucent_unless_opaque_is_given(own, options, opaque, cutoff):
    mesh = one(ab.Scene().add(triangle(**own), **options))
    assert (mesh.opaque, mesh.alpha_cutoff) == (opaque, cutoff)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"alpha": 2}, ab.ParameterError, "alpha must be between"),
        ({"alpha": "half"}, ab.ParameterError, "alpha must be a number"),
        ({"color": (2, 0, 0)}, ab.SceneError, r"color\[0\] is 2: int64 may only be 0 and 1"),
        ({"color": (0, 0, 0, -1.0)}, ab.SceneError, r"color\[3\] is -1.0"),
        ({"opaque": "yes"}, ab.ParameterError, "opaque must be True or False"),
        ({"alpha_cutoff": 0.5}, ab.ParameterError, "alpha_cutoff is for opaque meshes: give opaque=True"),
        ({"blend": "add"}, ab.ParameterError, "blend must be one of"),
        ({"blend": "additive", "opaque": True}, ab.ParameterError, "not blended: give opaque=False"),
        ({"blend": "screen", "color": (2.0, 0, 0)}, ab.SceneError, r"colors\[0\] is 2.0: blend modes multiply and"),
        ({"cull": "none"}, ab.ParameterError, "cull must be one of"),
        ({"space": "rgb"}, ab.ParameterError, "space must be one of 'srgb', 'linear', got 'rgb'"),
        ({"shade": (0, 0, 0)}, ab.ParameterError, "shade is .*direction"),
        ({"transform": np.eye(3)}, ab.ParameterError, "transform must have shape"),
    ],
)
@pytest.mark.parametrize("kind", ["mesh", "trimesh"])
def test_options_that_are_refused(options, error, message, kind):
    item = triangle() if kind == "mesh" else pytest.importorskip("trimesh").creation.box()
    with pytest.raises(error, match=message):
        ab.Scene().add(item, **options)


# transform, cull, shade


@pytest.mark.parametrize("kind", ["mesh", "trimesh"])
def test_transform_multiplies_columns(kind):
    item = triangle() if kind == "mesh" else pytest.importorskip("trimesh").Trimesh(TRIANGLE, [(0, 1, 2)])
    matrix = np.array([[0, -1, 0, 5], [2, 0, 0, 6], [0, 0, 3, 7], [0, 0, 0, 1.0]])
    mesh = one(ab.Scene().add(item, transform=matrix))
    np.testing.assert_array_equal(mesh.positions, [(5, 6, 7), (5, 8, 7), (4, 6, 7)])


@pytest.mark.parametrize("kind", ["mesh", "trimesh"])
@pytest.mark.parametrize("matrix", [np.eye(4), MIRROR], ids=["plain", "mirrored"])
def test_cull_is_of_the_items_own_sides_whatever_the_transform(kind, matrix):
    positions = TRIANGLE * 2 - 0.5  # counter-clockwise from the camera
    item = ab.Mesh(positions) if kind == "mesh" else pytest.importorskip("trimesh").Trimesh(positions, [(0, 1, 2)])
    camera = ab.Camera.orthographic((0, 0, 5), (0, 0, 0), height=4)
    for cull, seen in (("back", True), ("front", False)):
        scene = ab.Scene()
        scene.add(item, transform=matrix, cull=cull)
        counts = ab.render(scene, camera, width=32, height=32, device="cpu", fragments="count").counts
        assert counts.any() == seen


@pytest.mark.parametrize("kind", ["mesh", "trimesh"])
def test_the_light_stands_in_the_scene_not_in_the_item(kind):
    """A floor turned upright faces a light on z, whatever it faced before."""
    floor = TRIANGLE[:, [0, 2, 1]]
    item = ab.Mesh(floor) if kind == "mesh" else pytest.importorskip("trimesh").Trimesh(floor, [(0, 1, 2)])
    upright = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])
    lit = one(ab.Scene().add(item, color=(1, 1, 1), transform=upright, shade=(0, 0, 1)))
    np.testing.assert_allclose(lit.colors[:, :3], 1, rtol=1e-12)
    dark = one(ab.Scene().add(item, color=(1, 1, 1), transform=upright, shade=(0, 1, 0)))
    np.testing.assert_allclose(dark.colors[:, :3], 0.35, rtol=1e-12)


# bounds


def test_bounds_are_of_all_meshes_in_float64():
    scene = ab.Scene([triangle(), ab.Mesh(np.array(TRIANGLE + (5, -2, 1), np.float32)), ab.Mesh([])])
    assert scene.bounds.dtype == np.float64
    np.testing.assert_array_equal(scene.bounds, [(0, -2, 0), (6, 1, 1)])


def test_positions_that_no_face_has_are_not_in_the_bounds():
    mesh = ab.Mesh([*TRIANGLE, (1e9, 0, 0)], [(0, 1, 2)])
    np.testing.assert_array_equal(ab.Scene(mesh).bounds, [(0, 0, 0), (1, 1, 0)])


@pytest.mark.parametrize("items", [[], [ab.Mesh([])], [ab.Mesh(TRIANGLE, [])]])
def test_an_empty_scene_has_no_bounds(items):
    with pytest.raises(ab.SceneError, match="the scene is empty"):
        _ = ab.Scene(items).bounds


@pytest.mark.parametrize("scale", [1e-200, 1.0, 1e200])
def test_the_bounding_sphere_reaches_the_farthest_position_at_any_scale(scale):
    center, radius = ab.Scene(ab.Mesh(TRIANGLE * scale)).bounding_sphere()
    np.testing.assert_array_equal(center, np.array((0.5, 0.5, 0)) * scale)
    assert radius == pytest.approx(0.5**0.5 * scale, rel=1e-15)


# locate


def test_locate_counts_over_all_meshes_even_empty_ones():
    scene = ab.Scene([ab.Mesh(np.zeros((6, 3))), ab.Mesh([]), triangle(opaque=True)])
    mesh, face = scene.locate([0, 1, 2])
    np.testing.assert_array_equal(mesh, [0, 0, 2])
    np.testing.assert_array_equal(face, [0, 1, 0])
    assert (mesh.dtype, face.dtype) == (np.int64, np.int64)


def test_locate_keeps_the_shape():
    mesh, face = ab.Scene(triangle()).locate(np.zeros((2, 0, 3), np.int32))
    assert mesh.shape == face.shape == (2, 0, 3)
    assert ab.Scene().locate([])[0].shape == (0,)
    mesh, face = ab.Scene(triangle()).locate(0)
    assert (mesh, face) == (0, 0)


@pytest.mark.parametrize(
    ("primitive", "message"),
    [
        ([0, 1], "primitives run from 0 to 0, got 0 to 1"),
        ([-1], "primitives run from 0 to 0, got -1"),
        ([0.5], "primitives must be integers, got dtype float64"),
    ],
)
def test_locate_refuses_what_is_not_there(primitive, message):
    with pytest.raises(ab.ParameterError, match=message):
        ab.Scene(triangle()).locate(primitive)
    with pytest.raises(ab.ParameterError):
        ab.Scene().locate(primitive)


@settings(derandomize=True, deadline=None)
@given(st.lists(st.integers(0, 4), max_size=6))
def test_locate_finds_every_triangle(sizes):
    scene = ab.Scene([ab.Mesh(np.full((3 * n, 3), float(i))) for i, n in enumerate(sizes)])
    assert scene.triangle_count == sum(sizes)
    mesh, face = scene.locate(np.arange(sum(sizes)))
    expected = [(i, j) for i, n in enumerate(sizes) for j in range(n)]
    assert list(zip(mesh.tolist(), face.tolist(), strict=True)) == expected
    np.testing.assert_array_equal(scene.triangles()[:, 0, 0], mesh)
