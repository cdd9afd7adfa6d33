"""Methods of a user's own: WGSL for GPUs, a function of arrays for the CPU and for captured lists."""

import re
from dataclasses import replace

import numpy as np

from . import _check, _core, _methods, options
from .errors import ParameterError
from .method import FLAGS, Method, Parameter

BUILT_IN = frozenset(_methods.METHODS)


def register_method(
    id,
    *,
    wgsl=None,
    numpy=None,
    parameters=(),
    title="",
    source="",
    order="submission",
    passes=1,
    loops=None,
    flags=(),
    exact_when="",
    bytes_per_pixel="not said",
    takes_range=False,
):
    """Adds a method, which `render` and `Fragments.composite` then take by its id; docs/adding-a-method.md walks through one.

    Args:
        id: a name in lower case. One that was registered before is replaced.
        wgsl: what GPUs run: a struct State and the functions begin, turn, insert, end and left_out, as in shaders/methods.
        numpy: what the CPU and captured lists run, `f(color, depth, primitive, behind, **parameters)` of P pixels that have n
            fragments each: color (P, n, 4) straight, depth (P, n), primitive (P, n), behind (P, 4) straight, all float64 but
            primitive; it returns (P, 4) premultiplied, over what is behind. n may be 0. If depths are normalised it is also
            given nearest and farthest.
        parameters: `MethodParameter`s. In wgsl each is a constant of its name in capitals.
        title, source, exact_when, bytes_per_pixel: for the table.
        order: "submission", by primitive; "any" says that it does not matter. numpy may be given "front_to_back".
        passes: over the fragments, at most: how often turn says true.
        loops: iterations of loops in one insert, at most, where there are some: software drivers end long ones.
        flags: names of invariants that hold, of "single", "equal_colors", "noop_alpha0", "opaque_front", "exact_coverage",
            "order_free" and "hull".
        takes_range: it is given method.nearest and method.farthest, the depths that depths are normalised by.

    Raises:
        ParameterError: an id that is built in or no name, neither wgsl nor numpy, or another argument out of range.
        ShaderError: wgsl that does not compile: names the line.

    >>> def nearest_only(color, depth, primitive, behind):
    ...     rgba = color[:, 0] if color.shape[1] else np.zeros_like(behind)
    ...     front, back = (np.concatenate([c[:, :3] * c[:, 3:], c[:, 3:]], axis=1) for c in (rgba, behind))
    ...     return front + (1 - front[:, 3:]) * back
    >>> register_method("nearest_only", numpy=nearest_only, order="front_to_back")
    >>> from abuffer import Fragments
    >>> frags = Fragments((1, 1), [0, 2], [1., 2.], [[1, 0, 0, .5], [0, 1, 0, .5]])
    >>> frags.composite("nearest_only")[0, 0].tolist()
    [0.5, 0.0, 0.0, 0.5]
    """
    if not (isinstance(id, str) and re.fullmatch("[a-z][a-z0-9_]*", id)):
        raise ParameterError(f"id must be a name in lower case, such as 'nearest_only', got {id!r}")
    if id in BUILT_IN:
        raise ParameterError(f"method {id!r} is built in: give yours another id")
    if wgsl is None and numpy is None:
        raise ParameterError("a method needs wgsl, which GPUs run, or numpy, which the CPU runs, or both")
    if numpy is not None and not callable(numpy):
        raise ParameterError(f"numpy must be a function of arrays, got {numpy!r}")
    _check.choice("order", order, ("submission", "any", "front_to_back") if wgsl is None else ("submission", "any"))
    for flag in flags:
        _check.choice("flags", flag, [name for name in FLAGS if name != "modes"])
    parameters = (parameters,) if isinstance(parameters, Parameter) else tuple(parameters)
    if not all(isinstance(parameter, Parameter) for parameter in parameters):
        raise ParameterError(f"parameters must be abuffer.MethodParameter, got {parameters!r}")
    _check_parameters(parameters)
    if wgsl is not None and not isinstance(wgsl, str):
        raise ParameterError(f"wgsl must be text, got {type(wgsl).__name__}")
    passes = Parameter("passes", 1, "", low=1, high=1 << 16).checked(passes)
    method = Method(
        id=id,
        title=title or id,
        source=source or "your own",
        order=order,
        passes=lambda **_: passes,
        bytes_per_pixel=lambda **_: bytes_per_pixel,
        exact_when=exact_when or "not said",
        flags=frozenset(flags),
        parameters=parameters,
        takes_range=bool(takes_range),
        wgsl=wgsl,
        numpy=numpy,
    )
    if wgsl is not None:
        defaults = _methods.Chosen(method, method.checked({}))
        has_loops = _core.check_method(id, wgsl, defaults.constants(), "k" in method.options)
        if loops is not None:
            loops = Parameter("loops", 0, "", high=1 << 16).checked(loops)
        method = replace(method, loops=loops if has_loops else 0)
    _methods.METHODS[id] = method


# What render, composite and a method's function call something else.
TAKEN = frozenset(
    [
        "scene",
        "camera",
        "width",
        "height",
        "method",
        "pipeline",
        "device",
        "samples",
        "background",
        "fragments",
        "precision",
        "memory",
        "max_error",
        "depth_range",
        "nearest",
        "farthest",
        "color",
        "depth",
        "primitive",
        "behind",
    ]
) | {*options.OPTIONS, *options.EXACT_OPTIONS}


def _check_parameters(parameters):
    names = [parameter.name for parameter in parameters]
    for parameter in parameters:
        name = parameter.name
        if (
            not (isinstance(name, str) and re.fullmatch("[a-z][a-z0-9_]*", name))
            or name in TAKEN
            or names.count(name) > 1
        ):
            raise ParameterError(f"a parameter needs a name of its own, in lower case, which {name!r} is not")
        parameter.checked(parameter.default)
        is_count = not parameter.choices and not isinstance(parameter.default, bool) and parameter.is_integer
        if is_count and parameter.low < 0:
            raise ParameterError(
                f"integers are u32 in WGSL, and {name} goes down to {parameter.low}: give low=0 or more"
            )
        if name == "k" and not (is_count and 1 <= parameter.low <= parameter.high <= 64):
            raise ParameterError("k is how many fragments are kept: an integer with low=1 or more and high=64 or less")


def composite(chosen, offsets, color, depth, primitive, coverage, behind, depths, width):
    """Lists, front to back, by a method's function of arrays: (P, S, 4) float64, a sample each.

    Args:
        chosen: the method and its parameters.
        behind: (P, S, 4) straight.
        depths: nearest and farthest of the lists.
        width: of the image, pixels.

    Raises:
        ParameterError: what the function returns is no image.
    """
    method = chosen.method
    given = chosen.parts(*depths)["parameters"]
    pixel = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    image = np.empty(behind.shape)
    for s in range(behind.shape[1]):
        covers = slice(None) if coverage is None else np.flatnonzero(coverage >> s & 1)
        own_pixel, own = (
            pixel[covers],
            [values[covers] for values in (color.astype(float), depth.astype(float), primitive)],
        )
        if method.order != "front_to_back":
            by_primitive = np.lexsort((own[2], own_pixel))
            own = [values[by_primitive] for values in own]
        counts = np.bincount(own_pixel, minlength=len(offsets) - 1)
        starts = np.cumsum(counts) - counts
        for n in np.unique(counts):
            alike = np.flatnonzero(counts == n)
            at = starts[alike, None] + np.arange(n)
            result = method.numpy(*(values[at] for values in own), behind[alike, s], **given)
            image[alike, s] = _checked(result, method.id, n, alike, width)
    return image


def _checked(result, id, n, pixels, width):
    """What numpy of a method returned for `pixels`, which have n fragments each, if it is (P, 4) finite numbers."""
    of = f"numpy of method {id!r}, for pixels of {n} fragments,"
    result = _check.array_of_numbers(f"what comes of {of}", result, "fiu", ParameterError)
    if result.shape != (len(pixels), 4):
        raise ParameterError(f"{of} must return {(len(pixels), 4)}, premultiplied, got {result.shape}")
    bad = ~np.isfinite(result).all(axis=1)
    if bad.any():
        y, x = divmod(int(pixels[bad][0]), width)
        raise ParameterError(f"{of} must return finite numbers, got {result[bad][0].tolist()} in pixel [{y}, {x}]")
    return result


def require(chosen, attribute, device):
    """Raises a ParameterError where a registered method lacks what a device runs."""
    method = chosen.method
    if method.id not in BUILT_IN and getattr(method, attribute) is None:
        raise ParameterError(f"{device} needs {attribute} of method {method.id!r}, which was registered without")
