"""The options of methods and pipelines: their names, what they may be, and what they are where nobody says."""

import warnings
from itertools import pairwise

import numpy as np

from . import _check, cutoff
from .errors import ParameterError

MSAA_RESOLVES = ("per_pixel", "per_sample", "hdr", "none")
BLEND_ORDERS = ("front_to_back", "back_to_front")

# Of every pipeline. The first value is the default.
CHOICES = {
    "msaa_resolve": MSAA_RESOLVES,
    "sort": ("auto", "insertion", "selection", "bitonic", "merge", "heap"),
    "limit_policy": ("nearest", "last_submitted"),
    "blend_order": BLEND_ORDERS,
}
# Of pipelines that keep nodes on a GPU.
NODE_PIPELINES = ("linked_list", "prefix_sum")
NODE_CHOICES = {
    "node_format": ("float32", "rgba8_depth32", "rgba8_depth24_coverage8", "rgb565_depth16", "rgb9e5_alpha8_depth24"),
    "resolve": ("compute", "fragment"),
}
NODE_OPTIONS = (*NODE_CHOICES, "resolve_classes")
CLASSES = (1, 4, 8, 16, 32, 64)
# Of every method, and of exact alone.
OPTIONS = ("msaa_resolve", "targets")
EXACT_OPTIONS = (*CHOICES, "max_sorted_fragments", "cutoff", *NODE_CHOICES, "resolve_classes")
# Of pipeline hardware, which other methods have.
NATIVE_CHOICES = {"targets": ("float32", "float16")}
SAMPLES = (1, 2, 4, 8, 16)


def all_of(given, pipeline) -> dict:
    """All options of a render as the core takes them: those `given`, whose names are known, else their defaults.

    Raises:
        ParameterError: a value that is none of an option's, or an option that `pipeline` does not have.
    """
    for name in given:
        if name in NODE_OPTIONS and pipeline not in NODE_PIPELINES:
            have = " and ".join(NODE_PIPELINES)
            raise ParameterError(
                f"{name} is an option of pipelines {have}, and this render's is {pipeline}: "
                f'leave it out, or give pipeline="{NODE_PIPELINES[0]}"'
            )
        if name in NATIVE_CHOICES and pipeline != "hardware":
            raise ParameterError(
                f"{name} is an option of pipeline hardware, and this render's is {pipeline}: leave it out, or give "
                f'pipeline="hardware"'
            )
    valid_of = CHOICES | NODE_CHOICES | NATIVE_CHOICES
    chosen = {name: _check.choice(name, given.get(name, valid[0]), valid) for name, valid in valid_of.items()}
    chosen["max_sorted_fragments"] = _limit(given.get("max_sorted_fragments"))
    chosen["cutoff"] = cutoff.checked(given.get("cutoff", 0))
    chosen["resolve_classes"] = _classes(given.get("resolve_classes", CLASSES))
    return chosen


# The largest colour that a format holds; float32's are the scene's own.
LARGEST_COLOR = {
    "rgba8_depth32": 1.0,
    "rgba8_depth24_coverage8": 1.0,
    "rgb565_depth16": 1.0,
    "rgb9e5_alpha8_depth24": 65408.0,  # (2⁹ − 1) · 2⁷
}


def warn_of_clamping(node_format, meshes, lists_opaque):
    """Warns where a node format cannot hold the colours of a mesh that is listed."""
    largest = LARGEST_COLOR.get(node_format)
    if largest is None:
        return
    for mesh in meshes:
        most = mesh.colors[..., :3].max(initial=0)
        if most > largest and (lists_opaque or not mesh.opaque):
            of = f"mesh {mesh.name!r}" if mesh.name else "a mesh"
            warnings.warn(
                f"node_format {node_format!r} clamps colours to {largest:g}, and those of {of} reach {most:g}: "
                'give "rgb9e5_alpha8_depth24" or "float32"',
                UserWarning,
                stacklevel=4,
            )
            return


def is_integer(value) -> bool:
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def samples(value) -> int:
    """`value` as a number of samples a pixel."""
    if not is_integer(value) or value not in SAMPLES:
        raise ParameterError(f"samples must be one of {', '.join(map(str, SAMPLES))}, got {value!r}")
    return int(value)


def _limit(value):
    if value is None:
        return None
    if not is_integer(value) or value < 1:
        raise ParameterError(f"max_sorted_fragments must be an integer, 1 or more, or None for all, got {value!r}")
    return int(min(value, 2**31 - 1))  # no list is longer


def _classes(value):
    rule = "resolve_classes must be 1 to 8 rising integers, each from 1 to 64"
    try:
        classes = list(value)
    except TypeError:
        raise ParameterError(f"{rule}, got {value!r}") from None
    sound = 1 <= len(classes) <= 8 and all(is_integer(n) and 1 <= n <= 64 for n in classes)
    if isinstance(value, str) or not sound or any(a >= b for a, b in pairwise(classes)):
        raise ParameterError(f"{rule}, got {value!r}")
    return [int(n) for n in classes]
