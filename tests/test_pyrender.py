"""Beside pyrender, a renderer that sorts whole objects: right where objects can be sorted, wrong where they cross.

Only colours are compared: pyrender blends alpha by its own value too.
"""

import os

import numpy as np
import pytest

import abuffer as ab
import oracle
import peers_protocol
import scenes
from comparison import CPU32, CPU64, assert_frame_matches

# Three seconds, but the first time on a machine pyrender's environment is made, which takes a minute.
pytestmark = pytest.mark.slow

WIDTH, HEIGHT, FOV_Y = 160, 120, 40.0
BACKGROUND = (0.2, 0.3, 0.4, 1.0)  # opaque
COLORS = [(0.9, 0.2, 0.1, 0.5), (0.1, 0.7, 0.3, 0.4), (0.2, 0.3, 0.9, 0.6)]
# pyrender's image has 8 bits. A blend of two colours of 8 bits is off by half a unit for the colour, half a unit for the
# alpha, and up to one for the rounding of the sum. What lies in front lets through a part of it.
UNITS_PER_LAYER = 2
CLOSE = 1 / 16  # pixels: drivers snap vertices to a grid of their own, of 4 bits at least


@pytest.fixture(scope="module", autouse=True)
def pyrender():
    """pyrender draws here. Where it cannot, for want of EGL or of the network, its tests are skipped, and say why."""
    try:
        boards().by_pyrender()
    except RuntimeError as error:
        if os.environ.get("ABUFFER_REQUIRE_GPU") == "1":
            pytest.fail(f"pyrender does not run here: {error}")
        pytest.skip(f"pyrender does not run here: {str(error).splitlines()[-1]}")


class Objects:
    """Meshes of one colour with a pose each, for both renderers and the oracle."""

    def __init__(self, eye, meshes):
        """meshes: of (positions, faces, rgba, pose)."""
        self.camera = ab.Camera.from_pose(translation(eye), fov_y=FOV_Y)
        self.meshes = meshes
        self.scene = ab.Scene()
        for positions, faces, rgba, pose in meshes:
            self.scene.add(ab.Mesh(positions, faces, rgba), transform=pose)

    def by_pyrender(self):
        """(H, W, 3) in 0..255."""
        origins = [pose[:3, 3] for *_, pose in self.meshes]
        arrays = peers_protocol.arrays_of(self.scene, self.camera, (WIDTH, HEIGHT), BACKGROUND, origins)
        return 255 * peers_protocol.drawn("pyrender", "sorted objects", arrays, repeats=1).image[..., :3]

    def by_us(self, precision=CPU64):
        size = {"width": WIDTH, "height": HEIGHT}
        return precision.render(self.scene, self.camera, background=BACKGROUND, fragments=True, **size)

    def by_oracle(self):
        """Its hits, and the distance of each pixel's centre from the nearest edge."""
        triangles = self.scene.triangles()
        colors = np.concatenate([np.tile(mesh.colors, (mesh.face_count, 3, 1)) for mesh in self.scene.meshes])
        camera = oracle.OracleCamera(*self.camera.matrices(WIDTH, HEIGHT))
        edges = oracle.edge_distance(triangles, camera, WIDTH, HEIGHT)
        return oracle.trace(triangles, colors, camera, WIDTH, HEIGHT), edges


def translation(offset):
    pose = np.eye(4)
    pose[:3, 3] = offset
    return pose


def turned(x, y, z):
    """A rotation about each axis in turn, radians."""
    pose = np.eye(4)
    for angle, (i, j) in ((x, (1, 2)), (y, (2, 0)), (z, (0, 1))):
        step = np.eye(4)
        step[i, i] = step[j, j] = np.cos(angle)
        step[i, j], step[j, i] = -np.sin(angle), np.sin(angle)
        pose = step @ pose
    return pose


def balls(order=(0, 1, 2)):
    """Three balls behind each other. The faces that look away come first: the one order that is right for a convex body
    in a renderer that sorts nothing within an object."""
    eye = np.array([0, 0, 6])
    vertices, faces = scenes.icosphere(2)
    positions = (0.8 * vertices).astype(np.float32)
    meshes = []
    for i in order:
        center = np.array([(-0.6, 0.1, -2), (0.1, -0.2, 0), (0.5, 0.3, 1.6)][i])
        corners = positions[faces] + center
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        away = ((corners[:, 0] - eye) * normals).sum(axis=1) > 0
        meshes.append((positions, np.concatenate([faces[away], faces[~away]]), COLORS[i], translation(center)))
    return Objects(eye, meshes)


def boards(order=(0, 1, 2)):
    """Three boards through each other, all with their origin in the middle: each is in front of each other somewhere."""
    positions = np.float32([[-1.2, -0.9, 0], [1.2, -0.9, 0], [1.2, 0.9, 0], [-1.2, 0.9, 0]])
    poses = [turned(0.2, -0.5, 0), turned(0, 0.6, 0.1), turned(0.9, -0.3, 0)]
    return Objects((0, 0, 4), [(positions, np.array([[0, 1, 2], [0, 2, 3]]), COLORS[i], poses[i]) for i in order])


def off(image, reference):
    """Largest difference of a pixel's colours, (H, W), in units of 1/255."""
    return np.abs(image - 255 * reference[..., :3]).max(axis=-1)


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
def test_separable_objects_agree_to_display_precision(order):
    objects = balls(order)
    theirs, ours = objects.by_pyrender(), objects.by_us()
    inside = objects.by_oracle()[1] >= CLOSE
    distance = off(theirs, ours.image)
    assert ours.counts.max() == 6
    assert inside.mean() > 0.9
    print(f"\npyrender, separable: {distance[inside].max():.2f}/255 off at most, {inside.mean():.1%} compared")
    assert (distance <= np.maximum(UNITS_PER_LAYER * ours.counts, 1))[inside].all()
    # The comparison fails where it should: for a picture with one ball of a slightly other alpha.
    positions, faces, (*rgb, alpha), pose = objects.meshes[0]
    other = Objects((0, 0, 6), [(positions, faces, (*rgb, alpha + 0.1), pose), *objects.meshes[1:]])
    assert (off(theirs, other.by_us().image) > UNITS_PER_LAYER * ours.counts)[inside].any()


def test_crossing_objects_do_not_agree_and_we_are_the_right_one():
    objects = boards()
    hits, edges = objects.by_oracle()
    inside = edges >= CLOSE
    several = inside & (hits.counts > 1)
    assert several.sum() > 4000
    exact = oracle.composite(hits, BACKGROUND)

    for precision in (CPU32, CPU64):
        assert_frame_matches(objects.by_us(precision), hits, edges, precision, BACKGROUND)
    theirs = objects.by_pyrender()
    reference = objects.by_us().image
    wrong, wrong_by_oracle = off(theirs, reference), off(theirs, exact)
    print(
        f"\npyrender, crossing: {(wrong > 10)[inside].mean():.1%} of all pixels and {(wrong > 10)[several].mean():.1%} "
        f"of those with several layers are off by more than 10/255, {wrong[inside].max():.0f}/255 at most"
    )
    # Measured: 18 %, 57 % and 61. The geometry decides this, not the driver.
    assert (wrong > 10)[inside].mean() > 0.15
    assert (wrong > 10)[several].mean() > 0.5
    assert wrong[inside].max() > 50
    np.testing.assert_allclose(wrong[inside], wrong_by_oracle[inside], atol=1e-3)  # both references say the same
    # Where there is nothing to sort they agree.
    assert wrong[inside & (hits.counts <= 1)].max() <= UNITS_PER_LAYER


def test_what_pyrender_loses_is_named():
    """It draws objects one after the other and writes their depth, so what is drawn later is lost behind it."""
    objects = boards()
    theirs = objects.by_pyrender() / 255
    with pytest.raises(AssertionError, match="depth writes left on") as failure:
        ab.testing.assert_matches_reference(
            theirs, objects.scene, objects.camera, background=BACKGROUND, tolerance=3 * UNITS_PER_LAYER / 255
        )
    assert "fragments behind what was submitted before were lost (0.00% off)" in str(failure.value)


def test_another_order_of_insertion_changes_their_picture_and_not_ours():
    first, second = boards((0, 1, 2)), boards((2, 0, 1))
    inside = first.by_oracle()[1] >= CLOSE
    theirs = np.abs(first.by_pyrender() - second.by_pyrender()).max(axis=-1)
    print(f"\npyrender, inserted in another order: {(theirs > 10)[inside].mean():.1%} of all pixels change")
    assert (theirs > 10)[inside].mean() > 0.1
    for precision in (CPU32, CPU64):
        np.testing.assert_array_equal(first.by_us(precision).image, second.by_us(precision).image)
