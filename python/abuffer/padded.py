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
    coverage: np.ndarray | None  # (H, W, k) uint32 masks, 0 there; None with one sample a pixel
    dropped: int  # fragments behind the first k of their pixels
    blend: np.ndarray | None = None  # (H, W, k) uint8, 0 there; None where all are over


def pad(frags, k) -> Padded:
    counts = np.diff(frags.offsets)
    if k is None:
        k = int(counts.max(initial=0))
    elif isinstance(k, (bool, np.bool_)) or not isinstance(k, (int, np.integer)) or k < 0:
        raise ParameterError(f"k must be an integer, 0 or more, got {k!r}")
    layer = frags.layer
    kept = layer < k
    at = frags.pixel[kept], layer[kept]

    def padded(values, empty):
        if values is None:
            return None
        array = np.full((len(counts), k, *values.shape[1:]), empty, values.dtype)
        array[at] = values[kept]
        return array.reshape(*frags.shape, *array.shape[1:])

    return Padded(
        padded(frags.depth, np.inf),
        padded(frags.color, 0),
        padded(frags.primitive, -1),
        padded(frags.coverage, 0),
        int((~kept).sum()),
        padded(frags.blend, 0),
    )


def unpad(depth, color, primitive, coverage=None, blend=None) -> dict:
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
    columns = {"depth": depth, "color": color}
    for name, values in (("primitive", primitive), ("coverage", coverage), ("blend", blend)):
        if values is not None:
            values = _check.array_of_numbers(name, values, "iu")
            if values.shape != depth.shape:
                raise SceneError(f"{name} must be {depth.shape} as depth is, got {values.shape}")
            columns[name] = values
    pixel, slot = np.divmod(np.flatnonzero(filled), max(k, 1))
    columns = {name: values[filled] for name, values in columns.items()}
    order = np.lexsort((slot, -columns["primitive"].astype(np.int64), columns["depth"], pixel))
    lists = {name: values[order] for name, values in columns.items()}
    return lists | {"shape": (height, width), "offsets": np.concatenate([[0], np.cumsum(filled.sum(axis=2))])}
