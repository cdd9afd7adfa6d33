"""The scene of a real model, whose file another package has."""

import importlib.util
from pathlib import Path

import numpy as np

from ..errors import UnsupportedError
from ..scene import Scene
from .shapes import LIGHT
from .standard import PAPER, StandardScene, seen_from


def model() -> StandardScene:
    """The Stanford bunny, a scan of 99,785 uneven triangles of about a pixel.

    Hard for: order within one mesh: folds, ears and the far side lie behind each other in the order of the file.

    It is in no suite: the file comes with pymeshfix, which need not be imported, and is read by trimesh.

    Raises:
        UnsupportedError: pymeshfix or trimesh is not installed.
    """
    package = importlib.util.find_spec("pymeshfix")
    if package is None:
        raise UnsupportedError("the bunny's file comes with pymeshfix: pip install --no-deps 'pymeshfix>=0.18'")
    (read,) = Scene([Path(package.origin).parent / "examples" / "StanfordBunny.ply"]).meshes
    low, high = read.positions.min(axis=0), read.positions.max(axis=0)
    x, y, z = ((read.positions - (low + high) / 2) / (high - low).max()).T  # it stands along +z
    scene = Scene()
    positions = np.stack([x, z, -y], axis=-1).astype(np.float32)
    scene.add(read.replaced(positions=positions, colors=(1.0, 0.62, 0.25, 0.4), name="bunny"), shade=LIGHT)
    return StandardScene(
        name="model",
        scene=scene,
        camera=seen_from(4, focal=6.9),
        background=PAPER,
        hard_for="order within one mesh: folds and the far side lie behind each other, in a file's order",
    )
