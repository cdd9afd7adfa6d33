"""Checks of arguments, shared by everything that takes arrays."""

import difflib

import numpy as np

from .errors import ParameterError, SceneError


def choice(name, value, valid):
    """`value` if it is one of `valid`, else a ParameterError that lists them and names the nearest."""
    valid = list(valid)
    if value in valid:
        return value
    near = difflib.get_close_matches(str(value), [str(v) for v in valid], 1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    raise ParameterError(f"{name} must be one of {', '.join(map(repr, valid))}, got {value!r}{hint}")


def options(given, known, of):
    """Raises a ParameterError if `given` has a name that is not in `known`."""
    for name in given:
        if name not in known:
            near = difflib.get_close_matches(name, known, 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            valid = f"its options are {', '.join(known)}" if known else "it has none"
            raise ParameterError(f"{of} has no option {name!r}: {valid}{hint}")


def number(name, value, low=-np.inf, high=np.inf, *, open_ends=False):
    """`value` as a finite float inside [low, high], or (low, high) if `open_ends`."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise ParameterError(f"{name} must be a number, got {value!r}") from None
    inside = low < number < high if open_ends else low <= number <= high
    if not (np.isfinite(number) and inside):
        limits = f"between {low} and {high}" if np.isfinite(high) else f"over {low}" if open_ends else f"at least {low}"
        raise ParameterError(f"{name} must be {limits if np.isfinite(low) else 'finite'}, got {value!r}")
    return number


def matrix(name, value, shapes=((4, 4),)):
    """`value` as a float64 matrix of one of `shapes`, all finite."""
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ParameterError(f"{name} must be a matrix of numbers, got {type(value).__name__}") from None
    if array.shape not in shapes:
        wanted = " or ".join(str(s) for s in shapes)
        raise ParameterError(f"{name} must have shape {wanted}, got {array.shape}")
    if not np.isfinite(array).all():
        raise ParameterError(f"{name} must be finite, got {array.tolist()}")
    return array


def vector(name, value):
    """`value` as a float64 (3,), finite."""
    return matrix(name, value, ((3,),))


def first_bad(name, bad, values, why):
    """Raises a SceneError that names the first row where `bad` (N, ...) is true."""
    if bad.any():
        row = tuple(int(i) for i in np.argwhere(bad)[0])
        at = ", ".join(map(str, row))
        count = int(bad.sum())
        more = f" ({count} such values)" if count > 1 else ""
        raise SceneError(f"{name}[{at}] is {values[row]!s}{more}: {why}")


def straight_rgba(name, values, error=SceneError):
    """Colours (..., 3|4) as straight float RGBA (..., 4): 3 channels get alpha 1.

    float32 stays float32, other floats become float64. uint8 is divided by 255. Other integers may
    only be 0 and 1, since nobody can tell whether 2 is 2/255 or twice white.
    """
    try:
        array = np.asarray(values)
    except ValueError as e:
        raise error(f"{name} is not an array: {e}") from None
    if array.dtype.kind not in "fiub":
        raise error(f"{name} must be numbers, got dtype {array.dtype}")
    if array.ndim == 0 or array.shape[-1] not in (3, 4):
        raise error(f"{name} must end in 3 or 4 channels, got shape {array.shape}")
    if array.dtype == np.uint8:
        array = array / 255.0
    elif array.dtype.kind in "iub":
        if array.size and (array.min() < 0 or array.max() > 1):
            raise error(f"{name} is {array.dtype} with values outside 0 and 1: give floats, or uint8 for 0 to 255")
        array = array.astype(np.float64)
    elif array.dtype != np.float32:
        array = array.astype(np.float32 if array.dtype == np.float16 else np.float64)
    if array.shape[-1] == 3:
        array = np.concatenate([array, np.ones_like(array[..., :1])], axis=-1)
    bad = ~np.isfinite(array)
    if not bad.any():
        bad = array < 0
        bad[..., 3] |= array[..., 3] > 1
    if bad.any():
        row = tuple(int(i) for i in np.argwhere(bad)[0])
        at = ", ".join(map(str, row))
        raise error(f"{name}[{at}] is {array[row]!s}: RGB must be finite and at least 0, alpha in [0, 1]")
    return np.ascontiguousarray(array)
