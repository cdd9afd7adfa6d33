"""Benchmark scenes, given in pixels, so that what varies is their size on the screen, or the length of lists.

Those that are hard for something are in named.py.

Each is (meshes, camera, width, height). The camera is orthographic, a unit a pixel. A `scale` other than 1 renders
about so large a share of the fragments, at about the same depth complexity.
"""

import numpy as np

import abuffer as ab

# name: width, height, triangles, half size in pixels
RANDOM = {
    "20k of ~20 px": (1280, 720, 20_000, 20),
    "200k of ~6 px": (1280, 720, 200_000, 6),
    "200 of ~400 px": (1280, 720, 200, 400),
    "1M of ~4 px": (1920, 1080, 1_000_000, 4),
    "1500 of ~400 px": (1920, 1080, 1500, 400),
}
# The six that tiles are measured by.
SIX = {name: RANDOM[name] for name in ("20k of ~20 px", "200k of ~6 px", "1M of ~4 px")} | {
    "200 of ~400 px": (1920, 1080, 200, 400),
    "1500 of ~400 px": (1920, 1080, 1500, 400),
    "4M of ~3 px": (1920, 1080, 4_000_000, 3),
}
ALPHA = 80 / 255
# Layers of cells are thin, so that hundreds of them let something through.
LAYER_ALPHA = 0.1
# Pixels a side of a cell: all of them have lists of one length, in one order.
CELL = 8


def random_triangles(name, seed=0, scale=1.0, table=RANDOM):
    """A scene of RANDOM, or of another table. Scaled down, small triangles become fewer, large ones smaller.

    A centre uniform over the viewport, three vertices uniform within ±size pixels of it, depth uniform in
    [0, 1) per vertex, flat random colours, alpha 80/255.
    """
    width, height, count, size = table[name]
    width, height = (round(side * scale**0.5) for side in (width, height))
    count, size = (round(count * scale), size) if size < 100 else (count, size * scale**0.5)
    mesh = ab.Mesh(**soup(count, size, width, height, np.random.default_rng(seed)))
    return mesh, pixel_camera(height), width, height


def half_hidden(scale=1.0, seed=0):
    """254k translucent triangles of ~6 px among 348k opaque ones, as in the demo that GPU Pro 2 describes."""
    width, height = (round(side * scale**0.5) for side in (1280, 720))
    rng = np.random.default_rng(seed)
    opaque, translucent = (soup(round(count * scale), 6, width, height, rng) for count in (348_000, 254_000))
    return [ab.Mesh(**opaque, opaque=True), ab.Mesh(**translucent)], pixel_camera(height), width, height


def soup(count, size, width, height, rng):
    """Arrays of `count` triangles as `random_triangles` describes them."""
    corners = rng.uniform(0, 1, (count, 1, 2)) * (width, height) + rng.uniform(-size, size, (count, 3, 2))
    z = -rng.uniform(0, 1, (count, 3, 1))
    positions = np.concatenate([corners - (width / 2, height / 2), z], axis=-1).astype(np.float32)
    colors = np.concatenate([rng.uniform(0, 1, (count, 3)), np.full((count, 1), ALPHA)], axis=1)
    return {"positions": positions, "colors": colors.astype(np.float32)}


def pixel_camera(height):
    """A unit a pixel, depth along −z."""
    return ab.Camera.orthographic((0, 0, 0), (0, 0, -1), height=height)


def layers(lengths, seed=0):
    """Flat squares, so that each pixel of cell [i, j] has a list of exactly lengths[i, j].

    In each cell the layers come in a random order of depth, the first layer of all cells before the second.
    """
    rng = np.random.default_rng(seed)
    rows, columns = lengths.shape
    owner = np.repeat(np.arange(lengths.size), lengths.ravel())
    first = np.cumsum(lengths.ravel()) - lengths.ravel()
    owner = owner[np.argsort(np.arange(len(owner)) - first[owner], kind="stable")]
    corner = np.stack([owner % columns, owner // columns], axis=1) - (columns / 2, rows / 2)
    xy = CELL * (corner[:, None] + np.array([[0, 0], [1, 0], [1, 1], [0, 1]]))
    z = np.repeat(-rng.uniform(0, 1, (len(owner), 1, 1)), 4, axis=1)
    positions = np.concatenate([xy, z], axis=-1).reshape(-1, 3).astype(np.float32)
    faces = 4 * np.arange(len(owner))[:, None] + np.array([0, 1, 2, 0, 2, 3])
    colors = np.concatenate([rng.uniform(0, 1, (len(owner), 3)), np.full((len(owner), 1), LAYER_ALPHA)], axis=1)
    mesh = ab.Mesh(positions, faces.reshape(-1, 3), np.repeat(colors, 2, axis=0).astype(np.float32), color_mode="face")
    return mesh, pixel_camera(CELL * rows), CELL * columns, CELL * rows


def of_lengths(least, most, scale=1.0, seed=0):
    """Lists of `least` to `most`, each as often: about 6 M fragments in 256 to 1024 pixels a side."""
    side = min(max((12e6 / (least + most)) ** 0.5, 256), 1024)
    cells = _cells(side, scale)
    return layers(np.random.default_rng(seed).integers(least, most + 1, (cells, cells)), seed)


def mixed_lengths(scale=1.0, seed=0):
    """Lists of 4 on average and 64 at most: a geometric distribution, 1 in 400 of 64, and 6 % empty pixels."""
    cells = _cells(1024, scale)
    filled = round(0.94 * cells**2)
    longest = max(round(filled / 400), 1)
    mean = (4 * filled - 64 * longest) / (filled - longest)  # of the others
    quantiles = (np.arange(filled - longest) + 0.5) / (filled - longest)
    others = np.ceil(np.log1p(-quantiles) / np.log1p(-1 / mean)).clip(1, 63)
    lengths = np.zeros(cells**2, int)
    lengths[:filled] = np.concatenate([others, np.full(longest, 64)])
    return layers(np.random.default_rng(seed).permutation(lengths).reshape(cells, cells), seed)


def stripe(share, scale=1.0, seed=0):
    """Lists of 1 to 16 in a diagonal stripe, from corner to corner, that covers about a share of the image."""
    cells = _cells(1024, scale)
    lengths = np.random.default_rng(seed).integers(1, 17, (cells, cells))
    off = np.abs(np.subtract.outer(np.arange(cells), np.arange(cells)))
    return layers(np.where(off <= (1 - (1 - share) ** 0.5) * cells, lengths, 0), seed)


def _cells(side, scale):
    return max(round(side * scale**0.5 / CELL), 1)
