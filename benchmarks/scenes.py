"""Benchmark scenes: random triangles, given in pixels, so that their size on the screen is what varies."""

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


def random_triangles(name, seed=0):
    """A scene of RANDOM: (mesh, camera, width, height).

    A centre uniform over the viewport, three vertices uniform within ±size pixels of it, depth uniform in
    [0, 1) per vertex, flat random colours, alpha 80/255. The camera is orthographic, a unit a pixel.
    """
    width, height, count, size = RANDOM[name]
    rng = np.random.default_rng(seed)
    corners = rng.uniform(0, 1, (count, 1, 2)) * (width, height) + rng.uniform(-size, size, (count, 3, 2))
    z = -rng.uniform(0, 1, (count, 3, 1))
    positions = np.concatenate([corners - (width / 2, height / 2), z], axis=-1).astype(np.float32)
    colors = np.concatenate([rng.uniform(0, 1, (count, 3)), np.full((count, 1), 80 / 255)], axis=1)
    camera = ab.Camera.orthographic((0, 0, 0), (0, 0, -1), height=height)
    return ab.Mesh(positions, colors=colors.astype(np.float32)), camera, width, height
