"""Fragment lists as dense arrays of one length a pixel, and back."""

from typing import NamedTuple

import numpy as np

from . import _check
from .errors import ParameterError, SceneError


class Padded(NamedTuple):
    """The nearest k fragments of each pixel, front first."""

    depth: np.ndarray  # (H, W, k), inf where there is no fragment
    color: np.ndarray  # (H, W, k, 4) straight, 0 there
    primitive: np.ndarray  # (H, W, k) int32, −1 there
    coverage: None
    dropped: int  # fragments behind the first k of their pixels


def pad(frags, k) -> Padded:
    counts = np.diff(frags.offsets)
    if k is None:
        k = int(counts.max(initial=0))
    elif isinstance(k, (bool, np.bool_)) or not isinstance(k, (int, np.integer)) or k < 0:
        raise ParameterError(f"k must be an integer, 0 or more, got {k!r}")
    layer = frags.layer
    kept = layer < k
    at = frags.pixel[kept], layer[kept]
    shape = (len(counts), k)
    depth = np.full(shape, np.inf, frags.depth.dtype)
    color = np.zeros((*shape, 4), frags.color.dtype)
    primitive = np.full(shape, -1, np.int32)
    depth[at], color[at], primitive[at] = frags.depth[kept], frags.color[kept], frags.primitive[kept]
    whole = (*frags.shape, k)
    return Padded(depth.reshape(whole), color.reshape(*whole, 4), primitive.reshape(whole), None, int((~kept).sum()))


def unpad(depth, color, primitive) -> dict:
    """The arguments of `Fragments`."""
    depth = _check.floats(_check.array_of_numbers("depth", depth, "fiu"))
    if depth.ndim != 3 or np.shape(color) not in ((*depth.shape, 3), (*depth.shape, 4)):
        raise SceneError(f"depth must be (H, W, K) and color (H, W, K, 3|4), got {depth.shape} and {np.shape(color)}")
    filled = np.isfinite(depth)
    color = np.array(color)
    color[~filled] = 0  # whatever is there is no colour
    color = _check.straight_rgba("color", color)
    height, width, k = depth.shape
    if primitive is None:
        primitive = np.broadcast_to(np.arange(k, dtype=np.int32), depth.shape)
    primitive = _check.array_of_numbers("primitive", primitive, "iu")
    if primitive.shape != depth.shape:
        raise SceneError(f"primitive must be {depth.shape} as depth is, got {primitive.shape}")
    pixel, slot = np.divmod(np.flatnonzero(filled), max(k, 1))
    depth, primitive, color = depth[filled], primitive[filled], color[filled]
    order = np.lexsort((slot, -primitive.astype(np.int64), depth, pixel))
    return {
        "shape": (height, width),
        "offsets": np.concatenate([[0], np.cumsum(filled.sum(axis=2))]),
        "depth": depth[order],
        "color": color[order],
        "primitive": primitive[order],
    }
