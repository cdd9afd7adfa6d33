"""Benchmark scenes by name: each of NAMED is hard for something, which its docstring's first line says.

Each is a function of `scale`, and returns (meshes, camera, width, height) as those of scenes.py do: scaled down, an
image is smaller, or triangles are fewer, so that about so large a share of the fragments is left.
"""

import functools
import importlib.util
from itertools import combinations
from pathlib import Path

import numpy as np

import abuffer as ab
from scenes import RANDOM, SIX, half_hidden, pixel_camera, random_triangles, soup

TILE = 16  # pixels a side, in pipeline tiles


def nested_icospheres(scale=1.0):
    """Order: 12 meshes, each inside the next, so that no order of meshes is right; 24 layers, all edges shared."""
    level = int(np.clip(round(4 + np.log(scale) / np.log(4)), 1, 6))  # triangles as large in a smaller image
    vertices, faces = icosphere(level)
    rng = np.random.default_rng(0)
    meshes = [
        ab.Mesh(vertices * radius, rng.permutation(faces), (*rng.uniform(0, 1, 3), 0.2))
        for radius in np.linspace(0.3, 1.2, 12)
    ]
    return meshes, _in_front(4), *_size(scale)


def real_model(scale=1.0):
    """A scan: the Stanford bunny, 99,785 uneven triangles of about a pixel, with folds that hide behind each other.

    The file comes with the wheel of pymeshfix (examples/StanfordBunny.ply), and is read by trimesh.
    """
    camera = ab.Camera.look_at((0, -1.7, 0), (0, 0, 0), up=(0, 0, 1), fov_y=40)  # it stands along +z
    return ab.Mesh(*bunny(), (0.3, 0.55, 0.85, 0.4)), camera, *_size(scale)


def screen_filling_layers(scale=1.0):
    """Depth: 2,000 layers in every pixel, in random order; no list fits registers, and few fit memory."""
    count, (width, height) = 2000, _size(scale, 512, 512)
    rng = np.random.default_rng(0)
    across, up = width / 2, height / 2
    corners = np.array([[-across, -up], [3 * across, -up], [-across, 3 * up]])  # one triangle covers all
    z = -rng.permutation(count)[:, None] / count
    positions = np.concatenate([np.tile(corners, (count, 1, 1)), np.tile(z[:, None], (1, 3, 1))], axis=-1)
    # So thin that the last one still shows: nothing may stop early.
    colors = np.column_stack([rng.uniform(0, 1, (count, 3)), np.full(count, 4 / count)])
    return _mesh(positions, colors), pixel_camera(height), width, height


def hair(scale=1.0):
    """Thinness: 1 M triangles a third of a pixel wide and 8 long, of nearly empty boxes; many cover no centre."""
    width, height = _size(scale)
    strands, segments = max(round(20_000 * scale), 1), 25
    rng = np.random.default_rng(0)
    angles = rng.uniform(0, 2 * np.pi, (strands, 1)) + rng.normal(0, 0.12, (strands, segments)).cumsum(axis=1)
    steps = 8 * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    start = rng.uniform(-0.5, 0.5, (strands, 1, 2)) * (width, height)
    points = np.concatenate([start, start + steps.cumsum(axis=1)], axis=1)
    z = -rng.uniform(0, 1, (strands, 1)) - np.linspace(0, 0.05, segments + 1)
    thin = steps[..., ::-1] / 8 * (-1, 1) * (0.3 / 2)  # half a strand's width, across it
    thin = np.concatenate([thin, thin[:, -1:]], axis=1)
    sides = [np.concatenate([points + side * thin, z[..., None]], axis=-1) for side in (-1, 1)]
    (a, b), (c, d) = ((side[:, :-1], side[:, 1:]) for side in sides)
    positions = np.stack([np.stack([a, b, d], axis=2), np.stack([a, d, c], axis=2)], axis=2).reshape(-1, 3, 3)
    colors = np.column_stack([rng.uniform(0.2, 0.6, (strands, 3)), np.full(strands, 0.3)])
    return _mesh(positions, np.repeat(colors, 2 * segments, axis=0)), pixel_camera(height), width, height


def smoke(scale=1.0):
    """Unevenness: 10,000 billboards crowd in the middle, hundreds deep there and none around; each is at one depth."""
    count, (width, height) = 10_000, _size(scale)
    rng = np.random.default_rng(0)
    size = rng.uniform(10, 40, (count, 1, 1)) * scale**0.5
    middle = rng.normal(0, 0.12, (count, 1, 2)) * (width, height)
    corners = middle + size * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    z = np.tile(-rng.uniform(0, 1, (count, 1, 1)), (1, 4, 1))
    positions = np.concatenate([corners, z], axis=-1)[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3, 3)
    colors = np.column_stack([np.tile(rng.uniform(0.4, 0.9, (count, 1)), 3), np.full(count, 0.03)])
    return _mesh(positions, np.repeat(colors, 2, axis=0)), pixel_camera(height), width, height


def sheets(scale=1.0):
    """Coherence: 32 wavy sheets, farthest first, so that each list is sorted before anyone sorts it."""
    count, (width, height) = 32, _size(scale)
    columns, rows = max(width // 10, 1), max(height // 10, 1)
    y, x = np.mgrid[0 : rows + 1, 0 : columns + 1]
    across, up = (x / columns - 0.5) * width, (y / rows - 0.5) * height
    faces = _grid_faces(rows, columns)
    rng = np.random.default_rng(0)
    meshes = []
    for layer in range(count)[::-1]:
        wave = 0.4 * np.sin(x / 7 + layer / 5) * np.cos(y / 5)  # of the distance to the next sheet
        z = -(layer + wave) / count
        vertices = np.stack([across, up, z], axis=-1).reshape(-1, 3).astype(np.float32)
        meshes.append(ab.Mesh(vertices, faces, (*rng.uniform(0, 1, 3), 0.1)))
    return meshes, pixel_camera(height), width, height


def shells(scale=1.0):
    """Coherence, half of it reversed: 24 shells, outermost first: near halves come in order, far halves against it."""
    level = int(np.clip(round(5 + np.log(scale) / np.log(4)), 1, 6))
    vertices, faces = icosphere(level)
    rng = np.random.default_rng(0)
    meshes = [ab.Mesh(vertices * radius, faces, (*rng.uniform(0, 1, 3), 0.1)) for radius in np.linspace(1.2, 0.6, 24)]
    return meshes, _in_front(4), *_size(scale)


def mostly_opaque(scale=1.0):
    """Work for nothing: of 602k triangles 254k are translucent, and most of those are behind the opaque ones."""
    return half_hidden(scale)


def one_hot_pixel(scale=1.0):
    """One list: 20,000 triangles around one pixel's centre, so that one thread has all of the work."""
    count, (width, height) = max(round(20_000 * scale), 1), (1280, 720)
    rng = np.random.default_rng(0)
    angles = (
        rng.uniform(0, 2 * np.pi, (count, 1)) + np.array([0, 2, 4]) * np.pi / 3 + rng.uniform(-0.4, 0.4, (count, 3))
    )
    radii = rng.uniform(0.2, 0.45, (count, 3))
    # Of even sides: the origin is a corner of four pixels.
    corners = 0.5 + radii[..., None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    positions = np.concatenate([corners, -rng.uniform(0, 1, (count, 3, 1))], axis=-1)
    colors = np.column_stack([rng.uniform(0, 1, (count, 3)), np.full(count, 1 / 1000)])
    return _mesh(positions, colors), pixel_camera(height), width, height


def one_tile(scale=1.0):
    """Balance: 100,000 triangles of ~2 px in one tile of 16×16 pixels, hundreds deep; all others are empty."""
    count, (width, height), size = max(round(100_000 * scale), 1), (1280, 720), 2
    corner = np.array([width // 2 // TILE * TILE - width // 2, height // 2 - height // 2 // TILE * TILE - TILE])
    arrays = soup(count, size, TILE - 2 * size, TILE - 2 * size, np.random.default_rng(0))
    arrays["positions"][..., :2] += (corner + TILE / 2).astype(np.float32)
    return ab.Mesh(**arrays), pixel_camera(height), width, height


NAMED = {
    "nested icospheres": nested_icospheres,
    "a real model": real_model,
    "2,000 screen-filling layers": screen_filling_layers,
    "hair": hair,
    "smoke": smoke,
    "sheets": sheets,
    "shells": shells,
    "mostly opaque": mostly_opaque,
    "one hot pixel": one_hot_pixel,
    "all triangles in one tile": one_tile,
}
# Of any kind, the random ones first. "200 of ~400 px" is RANDOM's, of 1280×720.
ALL = (*dict.fromkeys((*RANDOM, *SIX)), *NAMED)


@functools.lru_cache(maxsize=2)
def build(name, scale=1.0):
    """A scene of ALL: (meshes, camera, width, height)."""
    if name in NAMED:
        return NAMED[name](scale)
    return random_triangles(name, scale=scale, table=SIX | RANDOM)


def hardness(name):
    """What a scene is hard for, in a line."""
    return (
        NAMED[name].__doc__.splitlines()[0]
        if name in NAMED
        else "Random triangles, uniform over the image and in depth."
    )


def bunny():
    """Vertices within the unit cube around the origin, +z up, and faces.

    Raises:
        ModuleNotFoundError: pymeshfix, which has the file, or trimesh, which reads it, is not installed.
    """
    for package in ("pymeshfix", "trimesh"):
        if importlib.util.find_spec(package) is None:
            raise ModuleNotFoundError(
                f"{package} is not installed. The bunny's file comes with pymeshfix, and trimesh reads it: "
                "pip install trimesh, and pip install --no-deps pymeshfix"
            )
    path = Path(importlib.util.find_spec("pymeshfix").origin).parent / "examples" / "StanfordBunny.ply"
    return model(path)


def model(path):
    """A file's vertices, brought into the unit cube around the origin, and faces."""
    (mesh,) = ab.Scene([path]).meshes
    low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
    return ((mesh.positions - (low + high) / 2) / (high - low).max()).astype(np.float32), mesh.faces


def icosphere(level):
    """A unit sphere of 20·4^level triangles, which share their vertices."""
    golden = (1 + 5**0.5) / 2
    signs = np.array([[-1, 1], [1, 1], [-1, -1], [1, -1]]) * (1, golden)
    vertices = np.concatenate([np.roll(np.insert(signs, 2, 0, axis=1), turn, axis=1) for turn in range(3)])
    faces = np.array(list(combinations(range(12), 3)))  # those whose three sides are edges, of length 2
    corners = vertices[faces]
    faces = faces[(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2) < 2.1).all(axis=1)]
    inwards = np.linalg.det(vertices[faces]) < 0
    faces[inwards] = faces[inwards][:, ::-1]
    for _ in range(level):
        ends = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        edges, which = np.unique(ends, axis=0, return_inverse=True)
        d, e, f = (len(vertices) + which.reshape(-1, 3)).T
        a, b, c = faces.T
        faces = np.stack([a, d, f, b, e, d, c, f, e, d, e, f], axis=1).reshape(-1, 3)
        vertices = np.concatenate([vertices, vertices[edges].mean(axis=1)])
    return (vertices / np.linalg.norm(vertices, axis=1, keepdims=True)).astype(np.float32), faces


def _grid_faces(rows, columns):
    corner = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).reshape(-1, 1)
    return (corner + np.array([0, 1, columns + 2, 0, columns + 2, columns + 1])).reshape(-1, 3)


def _mesh(positions, colors):
    return ab.Mesh(positions.astype(np.float32), colors=colors.astype(np.float32), color_mode="face")


def _in_front(distance):
    return ab.Camera.look_at((0, 0, distance), (0, 0, 0), fov_y=40)


def _size(scale, width=1280, height=720):
    return tuple(max(round(side * scale**0.5), 1) for side in (width, height))
