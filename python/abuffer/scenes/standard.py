"""What a standard scene is, and the cameras that look at them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .. import _check
from ..camera import Camera
from ..errors import ParameterError
from ..scene import Scene


@dataclass(frozen=True, eq=False)
class StandardScene:
    """A scene with all that an image of it needs: `ab.render(s.scene, s.camera, background=s.background)`."""

    name: str
    scene: Scene
    camera: Camera  # for an image of any size; 4 to 3 is what it was made for
    background: tuple  # straight RGB
    hard_for: str  # a sentence
    # Of width and height: the exact image, (H, W, 4) float64, where it has a closed form, and NaN elsewhere.
    expected: Callable[[int, int], np.ndarray] | None = None

    def __repr__(self):
        return f"StandardScene({self.name!r}, {self.scene.triangle_count:,} triangles)"


PAPER = (0.94, 0.94, 0.94)  # what most are in front of
# A unit from the middle of the image to its top; depth is 10 − z, exactly.
FRONT = Camera.orthographic((0, 0, 10), (0, 0, 0), height=2)


def seen_from(distance, *, target=(0, 0, 0), azimuth=(0, 1), elevation=(0, 1), focal=2.5) -> Camera:
    """A perspective towards `target`, whose angles are given as (sine, cosine): rational ones are no library's to round.

    Args:
        focal: the image's half height at distance 1 is 1 / focal.
    """
    (sa, ca), (se, ce) = azimuth, elevation
    rows = (ca, 0.0, -sa), (-sa * se, ce, -ca * se), (sa * ce, se, ca * ce)
    view = np.eye(4)
    for i, (x, y, z) in enumerate(rows):
        view[i, :3] = x, y, z
        view[i, 3] = -(x * target[0] + y * target[1] + z * target[2])
    view[2, 3] -= distance
    return Camera._made(view, [[focal, 0, 0, 0], [0, focal, 0, 0]], True, None, None)


def count(name, value, low=1, high=1_000_000):
    """`value` as an integer of at least `low`."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)) or not low <= value <= high:
        raise ParameterError(f"{name} must be an integer from {low:,} to {high:,}, got {value!r}")
    return int(value)


def seed_of(value):
    return count("seed", value, 0, 2**32 - 1)


def fraction(name, value):
    """`value` in [0, 1] as float32 has it, which is what is rendered."""
    return float(np.float32(_check.number(name, value, 0, 1)))
