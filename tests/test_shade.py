"""Lambert shading baked into colours."""

import numpy as np
import pytest

import abuffer as ab
import scenes
from abuffer.shade import lambert

SLANTED = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 1.0)]  # its normal is (0, −1, 1)/√2


@pytest.mark.parametrize(
    ("light", "cosine"),
    [((0, 0, 5), 0.5**0.5), ((0, 0, -1), 0.5**0.5), ((0, 1, 1), 0), ((0, 1e-200, -1e-200), 1)],
)
def test_lambert_is_two_sided_and_leaves_alpha(light, cosine):
    mesh = lambert(ab.Mesh(SLANTED, colors=(1.0, 2.0, 0.5, 0.25)), light)
    shade = 0.35 + 0.65 * cosine
    np.testing.assert_allclose(mesh.colors, [(shade, 2 * shade, shade / 2, 0.25)] * 3, rtol=1e-6)


@pytest.mark.parametrize("scale", [1e-30, 1e30])
def test_lambert_does_not_depend_on_the_size(scale):
    small = lambert(ab.Mesh(np.array(SLANTED) * scale), (0, 0, 1))
    np.testing.assert_allclose(small.colors, lambert(ab.Mesh(SLANTED), (0, 0, 1)).colors, rtol=1e-6)


@pytest.mark.parametrize(
    ("mode", "shape", "result"),
    [
        (None, (4,), "vertex"),
        ("vertex", (12, 4), "vertex"),
        ("face", (20, 4), "corner"),
        (None, (20, 3, 4), "corner"),
    ],
    ids=["one", "vertex", "face", "corner"],
)
def test_lambert_on_every_colour_mode(mode, shape, result):
    vertices, faces = scenes.icosphere(0)
    vertices = vertices * (1, 2, 3)
    colors = np.random.default_rng(1).random(shape)
    mesh = lambert(ab.Mesh(vertices, faces, colors, color_mode=mode), (1, 1, 1))
    assert mesh.color_mode == result
    normals = np.zeros((12, 3))  # the sum of the normals, of the area's length, of the faces at each vertex
    for face in faces:
        a, b, c = vertices[face]
        normals[face] += np.cross(b - a, c - a)
    factor = 0.35 + 0.65 * abs(normals @ (1, 1, 1)) / np.linalg.norm(normals, axis=1) / 3**0.5
    if result == "corner":
        factor = factor[faces]
        colors = np.broadcast_to(colors if len(shape) == 3 else colors[:, None], (20, 3, 4))
    np.testing.assert_allclose(mesh.colors[..., :3], colors[..., :3] * factor[..., None], rtol=1e-5)
    np.testing.assert_allclose(mesh.colors[..., 3], np.broadcast_to(colors[..., 3], factor.shape), rtol=1e-6)


def test_lambert_of_a_degenerate_face_is_ambient():
    mesh = lambert(ab.Mesh([(1.0, 1.0, 1.0)] * 3, colors=(1, 1, 1, 1)))
    np.testing.assert_allclose(mesh.colors[:, :3], 0.35, rtol=1e-6)


def test_lambert_keeps_everything_else():
    given = ab.Mesh(SLANTED, colors=(1, 1, 1, 1), blend="over", opaque=True, alpha_cutoff=0.5, cull="back", name="n")
    mesh = lambert(given)
    kept = ("blend", "opaque", "alpha_cutoff", "cull", "name", "faces")
    assert [getattr(mesh, key) for key in kept] == [getattr(given, key) for key in kept]
    np.testing.assert_array_equal(mesh.positions, given.positions)


@pytest.mark.parametrize("light", [(0, 0, 0), (1, 2), "up", (0, 0, np.nan), False])
def test_a_light_that_is_no_direction(light):
    with pytest.raises(ab.ParameterError, match=r"shade is .*direction"):
        lambert(ab.Mesh(SLANTED), light)
