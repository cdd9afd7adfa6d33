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


def test_a_depth_of_its_middle_says_too_little_of_a_long_triangle():
    """It begins behind a small one and ends far in front of the eye's other side; by its farthest vertex it is painted right."""
    long = ab.Mesh([[-0.9, -0.2, -0.5], [0.9, 0.0, 3.5], [-0.9, 0.2, -0.5]], colors=RED)
    small = ab.Mesh([[-0.9, -0.2, 0.3], [-0.6, 0.0, 0.3], [-0.9, 0.2, 0.3]], colors=GREEN)
    assert off([small, long], "triangle_sorted", key="centroid").max() > 0.2
    assert off([small, long], "triangle_sorted", key="nearest").max() > 0.2
    assert off([small, long], "triangle_sorted", key="farthest").max() < 1e-15


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


def test_equal_depths_are_painted_as_they_were_submitted():
    coplanar = [plane(0, RED), plane(0, GREEN)]
    for method in METHODS:
        assert off(coplanar, method).max() < 1e-15
        assert off(coplanar[::-1], method).max() < 1e-15


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
