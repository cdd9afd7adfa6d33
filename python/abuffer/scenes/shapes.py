"""Random numbers and shapes of the standard scenes.

Two groups are to get the same triangles whatever numpy and processor they have. So arrays are made by +, −, ×, ÷ and √
alone, element by element, which IEEE 754 rounds everywhere alike, of uniform numbers, whose stream numpy keeps. Sines,
powers, sums over an axis and products of matrices are not alike. What comes out is float32.
"""

import numpy as np

from ..mesh import Mesh

LIGHT = (-2 / 7, 6 / 7, 3 / 7)  # towards it: from above left, on the viewer's side


def numbers(seed) -> np.random.Generator:
    """Of which only `random` is to be used: its stream is part of numpy's promise, those of other distributions are not."""
    return np.random.Generator(np.random.PCG64(seed))


def between(rng, low, high, shape=()):
    return low + (high - low) * rng.random(shape)


def bell(rng, shape=()):
    """Of mean 0 and variance 1, between ±√12: a sum of four."""
    return (rng.random(shape) + rng.random(shape) + rng.random(shape) + rng.random(shape) - 2) * np.sqrt(3.0)


def shuffled(rng, count):
    """0 to count − 1 in a random order."""
    return np.argsort(rng.random(count), kind="stable")


def around(turns):
    """Cosines and sines of about so many turns: on the circle as roundings allow, and at quarters exactly there."""
    quarters = np.asarray(turns, np.float64) * 4 + 0.5
    quarter = np.floor(quarters)
    t = (2 * (quarters - quarter) - 1) * (np.sqrt(2.0) - 1)  # the tangent of half the angle from the quarter's middle
    c, s = (1 - t * t) / (1 + t * t), 2 * t / (1 + t * t)
    quarter = quarter.astype(np.int64) % 4
    return np.choose(quarter, [c, -s, -c, s]), np.choose(quarter, [s, c, -s, -c])


def length(vectors):
    """(..., 1) of (..., 3)."""
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    return np.sqrt(x * x + y * y + z * z)[..., None]


def hue(turns):
    """(..., 3) of (...): 0 and 1 red, a third green, two thirds blue; none of them dark."""
    away = np.abs((np.asarray(turns, np.float64)[..., None] * 6 + np.array([0.0, 4.0, 2.0])) % 6 - 3)
    return 0.1 + 0.9 * np.clip(away - 1, 0, 1)


def lit(normals):
    """(..., 1): how bright a diffuse surface is that faces `normals`, unit (..., 3), never black."""
    x, y, z = normals[..., 0], normals[..., 1], normals[..., 2]
    facing = 0.5 + 0.5 * (x * LIGHT[0] + y * LIGHT[1] + z * LIGHT[2])
    return (0.3 + 0.7 * facing * facing)[..., None]


def rgba(rgb, alpha):
    """(..., 4) of (..., 3) and (...)."""
    rgb = np.asarray(rgb, np.float64)
    return np.concatenate([rgb, np.broadcast_to(np.asarray(alpha)[..., None], (*rgb.shape[:-1], 1))], axis=-1)


def mesh(positions, faces, colors, **options) -> Mesh:
    """A Mesh of float32 arrays."""
    return Mesh(np.asarray(positions, np.float32), faces, np.asarray(colors, np.float32), **options)


def quads(corners, colors, **options) -> Mesh:
    """A mesh of (Q, 4, 3) corners, each of one colour, (Q, 4)."""
    corners = np.asarray(corners, np.float64)
    faces = 4 * np.arange(len(corners))[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    colors = np.repeat(np.asarray(colors, np.float64), 2, axis=0)
    return mesh(corners.reshape(-1, 3), faces.reshape(-1, 3), colors, color_mode="face", **options)


def rectangle(left, bottom, right, top, z=0.0):
    """(4, 3), counter-clockwise from the front."""
    return np.array([[left, bottom, z], [right, bottom, z], [right, top, z], [left, top, z]], np.float64)


def sphere(segments):
    """The unit sphere, an octahedron with so many segments an edge: (V, 3) and 8 · segments² faces that share vertices."""
    cells = [(i, j) for i in range(segments) for j in range(segments - i)]
    corners = [[(i, j), (i + 1, j), (i, j + 1)] for i, j in cells]
    corners += [[(i + 1, j), (i + 1, j + 1), (i, j + 1)] for i, j in cells if i + j + 1 < segments]
    xy = np.array(corners)
    octant = np.concatenate([xy, segments - xy[..., :1] - xy[..., 1:]], axis=-1)
    triangles = []
    for signs in np.ndindex(2, 2, 2):
        mirrored = octant * (1 - 2 * np.array(signs))
        triangles.append(mirrored[:, ::-1] if sum(signs) % 2 else mirrored)
    points, faces = np.unique(np.concatenate(triangles).reshape(-1, 3), axis=0, return_inverse=True)
    points = points.astype(np.float64)
    return points / length(points), faces.reshape(-1, 3)


def strips(points, widths, colors) -> Mesh:
    """Ribbons along polylines that face an eye far away on +Z, as one mesh.

    Args:
        points: (S, P, 3).
        widths: (S, P), across.
        colors: (S, P, 4).
    """
    count, steps = points.shape[:2]
    ahead = np.concatenate([points[:, 1:], points[:, -1:]], axis=1)
    behind = np.concatenate([points[:, :1], points[:, :-1]], axis=1)
    along = ahead - behind
    along[..., 2] = 0
    along = along / np.maximum(length(along), 1e-9)
    aside = np.stack([-along[..., 1], along[..., 0], 0 * along[..., 0]], axis=-1) * (widths / 2)[..., None]
    positions = np.stack([points - aside, points + aside], axis=2)  # (S, P, 2, 3)
    first = 2 * (np.arange(count)[:, None] * steps + np.arange(steps - 1))[..., None, None]
    faces = first + np.array([[0, 1, 2], [1, 3, 2]])
    return mesh(
        positions.reshape(-1, 3), faces.reshape(-1, 3), np.repeat(colors.reshape(-1, 4), 2, axis=0), color_mode="vertex"
    )


def fans(centers, radii, inner, outer, sides=24) -> Mesh:
    """Discs that face +Z, as one mesh: colours fade from the centre's to the rim's.

    Args:
        centers: (N, 3).
        radii: (N,).
        inner, outer: (N, 4).
    """
    c, s = around(np.arange(sides) / sides)
    circle = np.stack([c, s, 0 * c], axis=-1)
    rim = centers[:, None] + radii[:, None, None] * circle
    positions = np.concatenate([centers[:, None], rim], axis=1)
    colors = np.concatenate([inner[:, None], np.repeat(outer[:, None], sides, axis=1)], axis=1)
    k = np.arange(sides)
    fan = np.stack([0 * k, 1 + k, 1 + (k + 1) % sides], axis=-1)
    faces = (sides + 1) * np.arange(len(centers))[:, None, None] + fan
    return mesh(positions.reshape(-1, 3), faces.reshape(-1, 3), colors.reshape(-1, 4), color_mode="vertex")
