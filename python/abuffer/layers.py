"""Scenes with a user's own Blends or method on the CPU: the core's lists, composited in numpy."""

import time

import numpy as np

from . import _core
from ._methods import EXACT
from .blend import nearest_or_last, resolve
from .fragments import FIELDS, Fragments


def render_by_layers(meshes, camera, request, background, dtype, own, how) -> dict:
    """What `_core.render_cpu` gives, for a scene with the Blends `own`, or a method that is a function of arrays.

    Args:
        meshes, camera, request, background: as the core takes them.
        how: the method and its parameters.
        dtype: np.float32 or np.float64, the precision. The image is composited in float64 and then rounded to it.
    """
    asked, limit = request["lists"], request["max_sorted_fragments"]
    lists = "all" if asked == "all" else "translucent"
    exact = {"method": EXACT.parts(), "max_sorted_fragments": None}
    whole = request | {"lists": lists, "msaa_resolve": "per_pixel"} | exact
    output = _core.render_cpu(meshes, camera, whole, background, dtype == np.float64)
    stats, clock = output["stats"], time.perf_counter()

    shape = request["height"], request["width"]
    behind = output.get("background", np.asarray(background))
    frags = Fragments._of(shape, output, behind, request["samples"], own)
    kept = None
    if limit is not None:
        kept = nearest_or_last(frags.offsets, frags.primitive, limit, request["limit_policy"])
        stats["dropped_fragments"] = int((~kept).sum())
    if how.method.numpy is None:
        image = frags._by_layers(request["msaa_resolve"], kept=kept)
    else:
        given = request["method"]["parameters"]
        depths = given.get("nearest"), given.get("farthest")
        image = resolve(frags._by_function(how, frags.background, depths), request["msaa_resolve"])
    with np.errstate(over="ignore"):  # inf, as in the core
        output["image"] = image.astype(dtype)
    stats["ms"]["blend"] = (time.perf_counter() - clock) * 1e3

    if asked in ("none", "count"):
        for field in ("offsets", "background", *FIELDS):
            output.pop(field, None)
    if asked == "none":
        output.pop("counts", None)
    return output
