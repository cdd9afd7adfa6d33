"""Checks of what lists hold for each fragment."""

import numpy as np

from . import _check
from .blend import AT_MOST_ONE, BLENDS, Blend, over_one
from .errors import ParameterError, SceneError


def integers(name, values, dtype):
    """`values` as a contiguous array of `dtype`; empty ones of any kind will do."""
    array = np.zeros(0, dtype) if np.size(values) == 0 else _check.array_of_numbers(name, values, "iu")
    limits = np.iinfo(dtype)
    _check.first_bad(name, (array < limits.min) | (array > limits.max), array, f"out of {limits.dtype}'s range")
    return np.ascontiguousarray(array, dtype)


def masks(coverage, n, samples):
    """Coverage masks (n,) of so many samples a pixel; None for a single one."""
    full = (1 << samples) - 1
    if coverage is None:
        return None if samples == 1 else np.full(n, full, np.uint32)
    coverage = integers("coverage", coverage, np.uint32)
    if coverage.shape != (n,):
        raise SceneError(f"coverage must be ({n},), got {coverage.shape}")
    rule = f"with samples={samples} a mask is at most {full:#x}"
    _check.first_bad("coverage", coverage > full, coverage, rule)
    if samples > 1:
        return coverage
    _check.first_bad("coverage", coverage != 1, coverage, "with samples=1 every mask is 1: give samples=")
    return None


def modes(ids, color, own):
    """Blend ids (n,) that there are, of colours that they take."""
    if ids is None:
        return None
    ids = integers("blend", ids, np.uint8)
    if ids.shape != color.shape[:1]:
        raise SceneError(f"blend must be ({len(color)},), got {ids.shape}")
    last = len(BLENDS) + len(own) - 1
    _check.first_bad("blend", ids > last, ids, f"with {len(own)} blends of your own ids run from 0 to {last}")
    over_one(color, np.isin(ids, [BLENDS.index(mode) for mode in AT_MOST_ONE]), "color", SceneError)
    return ids


def as_blends(blends) -> tuple:
    """`blends` as a tuple of Blends."""
    blends = tuple(blends)
    if not all(isinstance(each, Blend) for each in blends):
        raise ParameterError(f"blends must be abuffer.Blends, got {blends!r}")
    return blends


def orderable(depth):
    """Unsigned integers in the order of the depths; −0 counts as +0."""
    kind = np.uint32 if depth.dtype == np.float32 else np.uint64
    bits = (depth + 0).view(kind)
    sign = kind(1) << kind(8 * depth.itemsize - 1)
    return np.where(bits & sign, ~bits, bits | sign)
