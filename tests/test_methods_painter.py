"""Painting in the order of one depth for each object or triangle: where that is right, and how much is wrong where it is not."""

import numpy as np
import pytest

import abuffer as ab
from abuffer import ParameterError

N = 128
CAMERA = ab.Camera.orthographic((0, 0, 5), (0, 0, 0), height=2)
SIZE = {"width": N, "height": N, "precision": "float64"}
METHODS = ("object_sorted", "triangle_sorted")
KEYS = ("centroid", "nearest", "farthest")
RED, GREEN, BLUE = (1, 0, 0, 0.5), (0, 1, 0, 0.5), (0, 0, 1, 0.5)


def off(meshes, method, **kw):
    """Where and by how much a method's image is wrong, (N, N)."""
    exact = ab.render(meshes, CAMERA, **SIZE).image
    return np.abs(ab.render(meshes, CAMERA, **SIZE, method=method, **kw).image - exact).max(axis=-1)


def plane(slope, color, at=0.0, size=9.0):
    """A triangle that covers the image, at z = at + slope · x."""
    corners = np.array([[-size, -size, 0], [size, -size, 0], [0, 2 * size, 0]], float)
    corners[:, 2] = at + slope * corners[:, 0]
    return ab.Mesh(corners, colors=color)


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("method", METHODS)
def test_layers_that_do_not_overlap_in_depth_are_exact_in_any_order_of_submission(method, key):
    layers = [plane(0.01, color, at=z) for color, z in ((RED, 0.5), (GREEN, -0.5), (BLUE, 0.0))]
    for order in ([0, 1, 2], [1, 2, 0], [2, 1, 0]):
        assert off([layers[i] for i in order], method, key=key).max() < 1e-15


@pytest.mark.parametrize("method", METHODS)
def test_of_two_crossing_triangles_one_half_is_wrong_by_the_swap_identity(method):
    """ΔC = α_A α_B (c_A − c_B): a quarter, on one side of the line where they cross, half of the image."""
    wrong = off([plane(0.5, RED), plane(-0.5, GREEN, at=1e-3)], method)
    area = (wrong > 1e-12).sum()
    assert abs(area - N * N / 2) <= N  # give or take the pixels along the line
    np.testing.assert_allclose(wrong[wrong > 1e-12], 0.25)


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("method", METHODS)
def test_no_order_paints_a_cycle(method, key):
    """Three long triangles, each over the next: any order is wrong where at least one pair of them meets."""
    bars = []
    for i, color in enumerate((RED, GREEN, BLUE)):
        turn = np.radians(120 * i)
        # Beside the middle, one end of it near and one far.
        corners = np.array([[-0.9, 0.1, -0.2], [0.9, 0.25, 0.2], [-0.9, 0.4, -0.2]])
        rotation = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
        bars.append(ab.Mesh(corners @ rotation.T, colors=color))
    exact = ab.render(bars, CAMERA, **SIZE, fragments="count")
    meet = exact.counts == 2
    assert 100 < meet.sum() < 1000
    wrong = off(bars, method, key=key) > 1e-12
    assert (wrong <= meet).all()
    # The three places are alike but for pixels along their edges, and one is wrong at least.
    assert wrong.sum() >= meet.sum() / 3 - 12


def assert_wrong(wrong, area, perimeter):
    """What is off has an area in world units, give or take the pixels along its edges."""
    pixel = 2 / N
    measured = (wrong > 1e-12).sum() * pixel**2
    assert abs(measured - area) <= perimeter * pixel, f"{measured:.4g} are wrong, not {area:.4g}"


def rectangle(x, y, z, color):
    corners = [[x[0], y[0], z], [x[1], y[0], z], [x[1], y[1], z], [x[0], y[1], z]]
    return ab.Mesh(corners, [[0, 1, 2], [0, 2, 3]], colors=color)


def joined(*meshes):
    """One object of several, whose triangles come in their order."""
    colors = np.concatenate([np.broadcast_to(mesh.colors, (mesh.face_count, 4)) for mesh in meshes])
    return ab.Mesh(np.concatenate([mesh.triangles() for mesh in meshes]), colors=colors)


@pytest.mark.parametrize(("key", "is_wrong"), [("centroid", True), ("nearest", True), ("farthest", False)])
@pytest.mark.parametrize("method", METHODS)
def test_a_depth_of_its_own_says_too_little_of_a_long_triangle(method, key, is_wrong):
    """It runs far to the front beside a small one that it is behind: all of the small one is wrong. An order that is right
    there is, and the farthest vertices have it."""
    long = ab.Mesh([[-1, -0.9, -1], [1, 0, 3], [-1, 0.9, -1]], colors=RED)  # z = 2 x + 1
    small = ab.Mesh([[-0.95, -0.6, 0.2], [-0.45, 0, 0.2], [-0.95, 0.6, 0.2]], colors=GREEN)
    for meshes in ([small, long], [long, small]):
        wrong = off(meshes, method, key=key)
        if is_wrong:
            assert_wrong(wrong, area=0.5 * 1.2 / 2, perimeter=1.2 + 2 * np.hypot(0.5, 0.6))
            np.testing.assert_allclose(wrong[wrong > 1e-12], 0.25)  # α_A α_B (c_A − c_B)
        else:
            assert wrong.max() < 1e-15


@pytest.mark.parametrize("key", KEYS)
def test_objects_within_others_are_wrong_wherever_both_are_seen(key):
    """Front and back of a box around those of another: no order of the two objects is right, one of triangles is."""
    outer, inner = (
        joined(*(rectangle((-r, r), (-r, r), z, color) for z in (-r, r))) for r, color in ((0.8, RED), (0.4, GREEN))
    )
    for meshes in ([outer, inner], [inner, outer]):
        assert_wrong(off(meshes, "object_sorted", key=key), area=0.8**2, perimeter=4 * 0.8)
        assert off(meshes, "triangle_sorted", key=key).max() < 1e-15


@pytest.mark.parametrize("key", KEYS)
def test_an_object_that_reaches_around_another_is_wrong_on_one_side_of_it(key):
    """A step whose left half is in front of a square and its right half behind: half of the square, whatever the order."""
    step = joined(rectangle((-0.8, 0), (-0.8, 0.8), 0.5, RED), rectangle((0, 0.8), (-0.8, 0.8), -0.5, RED))
    square = rectangle((-0.6, 0.6), (-0.6, 0.6), 0, GREEN)
    for meshes in ([step, square], [square, step]):
        wrong = off(meshes, "object_sorted", key=key)
        assert_wrong(wrong, area=0.6 * 1.2, perimeter=2 * (0.6 + 1.2))
        left, right = (wrong[:, : N // 2] > 1e-12).any(), (wrong[:, N // 2 :] > 1e-12).any()
        assert left != right
        assert off(meshes, "triangle_sorted", key=key).max() < 1e-15


def test_within_an_object_triangles_are_painted_as_they_were_submitted():
    """Of a shell the front before the back: all of it is wrong. The other way none is."""
    front, back = (rectangle((-0.8, 0.8), (-0.5, 0.5), z, color) for z, color in ((0.5, RED), (-0.5, GREEN)))
    wrong = off([joined(front, back)], "object_sorted")
    assert_wrong(wrong, area=1.6 * 1.0, perimeter=2 * (1.6 + 1.0))
    np.testing.assert_allclose(wrong[wrong > 1e-12], 0.25)
    assert off([joined(back, front)], "object_sorted").max() < 1e-15
    assert off([joined(front, back)], "triangle_sorted").max() < 1e-15


def shells():
    trimesh = pytest.importorskip("trimesh")
    spheres = [trimesh.creation.icosphere(subdivisions=2, radius=r) for r in (0.9, 0.6)]
    colors = (RED, GREEN)
    return [ab.Mesh(s.vertices, s.faces, colors=c) for s, c in zip(spheres, colors, strict=True)]


def test_nested_objects_cannot_be_painted_one_after_the_other_and_their_triangles_can():
    wrong = {method: off(shells(), method) > 1e-9 for method in METHODS}
    covered = ab.render(shells(), CAMERA, **SIZE, fragments="count").counts > 0
    assert wrong["object_sorted"][covered].mean() > 0.3
    assert wrong["triangle_sorted"][covered].mean() < 0.02


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("method", METHODS)
def test_equal_depths_are_painted_as_they_were_submitted(method, key):
    """The later is in front, as everywhere: nothing is wrong, where another order would be all over their overlap."""
    first, second = (rectangle(span, span, 0, color) for span, color in (((-0.8, 0.4), RED), ((-0.4, 0.8), GREEN)))
    for coplanar in ([first, second], [second, first]):
        assert off(coplanar, method, key=key).max() < 1e-15
    exact, swapped = (ab.render(meshes, CAMERA, **SIZE).image for meshes in ([first, second], [second, first]))
    assert_wrong(np.abs(exact - swapped).max(axis=-1), area=0.8**2, perimeter=4 * 0.8)


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("method", METHODS)
def test_triangles_of_one_plane_stay_in_their_order(method, key):
    """Some tens in each of three planes, one over the other: a sort that is not stable would tear them out of it."""
    rng = np.random.default_rng(8)
    corners, colors = rng.uniform(-1, 1, (90, 3, 3)), rng.uniform(0.2, 0.8, (90, 4))
    corners[..., 2] = rng.choice([-0.5, 0.0, 0.5], (90, 1))
    meshes = [ab.Mesh(triangle, colors=color) for triangle, color in zip(corners, colors, strict=True)]
    # Two composites of up to 90 layers, from either end.
    assert off(meshes, method, key=key).max() < 1e-13


@pytest.mark.parametrize("device", ["cpu", "gpu"])
@pytest.mark.parametrize("method", METHODS)
def test_lists_and_counts_are_those_of_the_scene(method, device, needs_gpu):
    scene = [plane(0.5, RED), plane(-0.5, GREEN), ab.Mesh(np.zeros((3, 3)) + [0, 0, 9], colors=BLUE)]
    given = {"width": N, "height": N, "device": device, "pipeline": "tiles", "fragments": True}
    exact, painted = (ab.render(scene, CAMERA, **given, method=m) for m in ("exact", method))
    np.testing.assert_array_equal(painted.fragments.primitive, exact.fragments.primitive)
    np.testing.assert_array_equal(painted.counts, exact.counts)
    assert painted.plan["painted"] == f"{method.removesuffix('_sorted')}s by centroid"


def test_meshes_that_cull_differently_are_painted_in_one_order():
    rng = np.random.default_rng(4)
    sides = [None, "back", "front"]
    meshes = [ab.Mesh(rng.uniform(-1, 1, (20, 3, 3)), colors=rng.uniform(0, 1, (20, 4)), cull=side) for side in sides]
    frame = ab.render(meshes, CAMERA, **SIZE, method="triangle_sorted", fragments=True)
    again = frame.fragments.composite("triangle_sorted", scene=meshes, camera=CAMERA)
    np.testing.assert_allclose(frame.image, again, atol=1e-14)
    assert np.abs(frame.image - frame.fragments.composite()).max() > 0.01


@pytest.mark.parametrize("mode", ["vertex", "face", "corner", "one"])
def test_colours_come_along_however_they_are_given(mode):
    rng = np.random.default_rng(6)
    positions, faces = rng.uniform(-1, 1, (12, 3)), rng.integers(0, 12, (9, 3))
    shape = {"vertex": (12, 4), "face": (9, 4), "corner": (9, 3, 4), "one": (4,)}[mode]
    mesh = ab.Mesh(positions, faces, colors=rng.uniform(0, 1, shape))
    assert mesh.color_mode == mode
    frame = ab.render(mesh, CAMERA, **SIZE, method="triangle_sorted", fragments=True)
    again = frame.fragments.composite("triangle_sorted", scene=mesh, camera=CAMERA)
    np.testing.assert_allclose(frame.image, again, atol=1e-12)


def test_lists_are_not_enough_to_sort_triangles():
    frags = ab.render(plane(0, RED), CAMERA, **SIZE, fragments=True).fragments
    for given in ({}, {"scene": plane(0, RED)}, {"camera": CAMERA}):
        with pytest.raises(
            ParameterError, match="sorts triangles, which lists do not hold: give scene= and camera= too"
        ):
            frags.composite("triangle_sorted", **given)
    with pytest.raises(ParameterError, match="another scene"):
        frags.composite("triangle_sorted", scene=[], camera=CAMERA)
    with pytest.raises(ParameterError, match="no option of that name"):
        frags.composite("unsorted", scene=plane(0, RED))


def test_meshes_without_faces_and_cameras_that_are_none():
    scene = [ab.Mesh(np.zeros((0, 3))), plane(0.5, RED), plane(-0.5, GREEN)]
    for method in METHODS:
        frame = ab.render(scene, CAMERA, **SIZE, method=method, fragments=True)
        again = frame.fragments.composite(method, scene=scene, camera=CAMERA)
        np.testing.assert_allclose(frame.image, again, atol=1e-14)
        with pytest.raises(ParameterError, match=r"camera must be an abuffer\.Camera, got int"):
            frame.fragments.composite(method, scene=scene, camera=5)
