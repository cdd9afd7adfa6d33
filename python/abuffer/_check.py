"""Checks of arguments, shared by everything that takes arrays."""

import difflib
import numbers
import os

import numpy as np

from .errors import ParameterError, SceneError

FLOAT32_MAX = float(np.finfo(np.float32).max)


def choice(name, value, valid):
    """That of `valid` (text, integers, or None) which `value` is, else a ParameterError that lists them and names the nearest."""
    valid = list(valid)
    is_plain = value is None or isinstance(value, (str, numbers.Integral))
    if is_plain and not isinstance(value, bool) and value in valid:  # True would be 1
        return valid[valid.index(value)]
    by_text = {str(v): v for v in valid}
    near = difflib.get_close_matches(str(value), by_text, 1)
    hint = f"; did you mean {by_text[near[0]]!r}?" if near else ""
    raise ParameterError(f"{name} must be one of {', '.join(map(repr, valid))}, got {value!r}{hint}")


def flag(name, value):
    """`value` as a bool."""
    if not isinstance(value, (bool, np.bool_)):
        raise ParameterError(f"{name} must be True or False, got {value!r}")
    return bool(value)


def arguments(function, given, known, of, own):
    """Raises a ParameterError if a name in `given` is no option of `of`: it may as well be a misspelt argument.

    Args:
        known: the options of `of`.
        own: the arguments of `function`; none: options came by another way than its call.
    """
    for name in given:
        if name not in known:
            near = difflib.get_close_matches(name, [*known, *own], 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            options = f"; options are {', '.join(known)}" if known else ""
            if not own:
                raise ParameterError(f"{of} has no option {name!r}{hint}{options}")
            raise ParameterError(
                f"{function}() has no argument {name!r} and {of} no option of that name{hint}; "
                f"arguments are {', '.join(own)}{options}"
            )


def path(value):
    """`value` as open() takes it, with ~ for the home directory."""
    return os.path.expanduser(value) if isinstance(value, (str, os.PathLike)) else value


def number(name, value, low=-np.inf, high=np.inf, *, open_ends=False):
    """`value` as a finite float inside [low, high], or (low, high) if `open_ends`."""
    try:
        # float() would take text and arrays of one, which are mistakes here.
        if isinstance(value, (str, bytes, bool, np.bool_)) or np.ndim(value) != 0:
            raise TypeError
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
        array = np.array(value)
    except (TypeError, ValueError):
        array = np.array(None)
    if array.dtype.kind not in "fiu":
        raise ParameterError(f"{name} must be a matrix of numbers, got {type(value).__name__} {value!r}")
    array = array.astype(np.float64)
    if array.shape not in shapes:
        wanted = " or ".join(str(s) for s in shapes)
        raise ParameterError(f"{name} must have shape {wanted}, got {array.shape}")
    if not np.isfinite(array).all():
        raise ParameterError(f"{name} must be finite, got {array.tolist()}")
    return array


def vector(name, value):
    """`value` as a float64 (3,), finite."""
    return matrix(name, value, ((3,),))


def affine(name, value):
    """`value` as a float64 (4, 4) that multiplies columns: its last row is (0, 0, 0, 1)."""
    m = matrix(name, value)
    if tuple(m[3]) != (0, 0, 0, 1):
        hint = ": it looks transposed, matrices multiply columns" if tuple(m[:3, 3]) == (0, 0, 0) else ""
        raise ParameterError(f"{name}'s last row must be (0, 0, 0, 1), got {m[3].tolist()}{hint}")
    return m


def _is_constant(values):
    """Whether `values` is a read-only array, and so is everything that it is a view of."""
    while isinstance(values, np.ndarray) and not values.flags.writeable:
        if values.base is None:
            return True
        values = values.base
    return False


def array_of_numbers(name, values, kinds, error=SceneError):
    """`values` as an array that is ours: what becomes of the caller's later does not show. `kinds`: of dtypes.

    Contiguous and aligned, as the core reads it.
    """
    try:
        array = np.asarray(values) if _is_constant(values) else np.array(values)  # constant: a mesh's own, say
    except (TypeError, ValueError) as e:
        raise error(f"{name} is not an array: {e}") from None
    if array.dtype.kind not in kinds:
        what = "numbers" if "f" in kinds else "integers"
        raise error(f"{name} must be {what}, got dtype {array.dtype}")
    return np.require(array, requirements=["C", "A"])


def floats(array):
    """float32 and float64 as they are, float16 as float32, all other numbers as float64."""
    native = array.dtype.newbyteorder("=")
    if native in (np.float32, np.float64):
        return array.astype(native, copy=False)
    with np.errstate(over="ignore"):  # a long double too large for a double becomes inf, which is checked for
        return array.astype(np.float32 if array.dtype == np.float16 else np.float64)


def first_bad(name, bad, values, why, error=SceneError):
    """Raises an error that names the first row where `bad`, of the shape of `values`, is true."""
    if bad.any():
        row = tuple(int(i) for i in np.argwhere(bad)[0])
        at = ", ".join(map(str, row))
        count = int(bad.sum())
        more = f" ({count} such values)" if count > 1 else ""
        raise error(f"{name}[{at}] is {values[row]!s}{more}: {why}")


def straight_rgba(name, values, error=SceneError):
    """Colours (..., 3|4) as straight float RGBA (..., 4): 3 channels get alpha 1.

    float32 stays float32, other floats become float64. uint8 is divided by 255. Other integers may
    only be 0 and 1, since nobody can tell whether 2 is 2/255 or twice white.
    """
    array = array_of_numbers(name, values, "fiub", error)
    if array.ndim == 0 or array.shape[-1] not in (3, 4):
        raise error(f"{name} must end in 3 or 4 channels, got shape {array.shape}")
    if array.dtype == np.uint8:
        array = array / 255.0
    elif array.dtype.kind in "iu":
        why = f"{array.dtype} may only be 0 and 1: give floats, or uint8 for 0 to 255"
        first_bad(name, (array < 0) | (array > 1), array, why, error)
    array = floats(array)
    if array.shape[-1] == 3:
        array = np.concatenate([array, np.ones_like(array[..., :1])], axis=-1)
    bad = ~((array >= 0) & (array < np.inf))  # NaN is neither
    bad[..., 3] |= array[..., 3] > 1
    first_bad(name, bad, array, "RGB must be finite and at least 0, alpha in [0, 1]", error)
    # In float32, which most renders compute in, more would be infinite.
    first_bad(name, array > FLOAT32_MAX, array, f"RGB must be at most {FLOAT32_MAX:.4g}, float32's largest", error)
    return np.ascontiguousarray(array)


def background(value, shape, samples=1):
    """A background as straight RGBA, (4,) or (H, W, 4): grey, (3|4,) or (H, W, 3|4) given.

    With several samples a pixel it may also be (H, W, samples, 3|4).
    """
    wanted = "grey, (3|4,) or (H, W, 3|4)"
    if samples > 1:
        wanted = f"grey, (3|4,), (H, W, 3|4) or (H, W, {samples}, 3|4)"
    if value is None:
        raise ParameterError(f"background must be {wanted}, got None: (0, 0, 0, 0) is transparent")
    array = array_of_numbers("background", value, "fiub", ParameterError)
    array = straight_rgba("background", np.repeat(array, 3) if array.ndim == 0 else array, ParameterError)
    shapes = [(4,), (*shape, 4)] + ([(*shape, samples, 4)] if samples > 1 else [])
    if array.shape not in shapes:
        raise ParameterError(f"background must be {wanted} with H, W = {shape}, got shape {np.shape(value)}")
    return array


def frozen(array):
    """A view of `array` that cannot be written through. Nor can `array`, which must be ours, or what it views."""
    base = array
    while isinstance(base, np.ndarray):
        base.flags.writeable = False
        base = base.base
    view = array.view()
    view.flags.writeable = False
    return view
