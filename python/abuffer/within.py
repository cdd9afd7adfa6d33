"""`max_error`: the cheapest way to an image that is proven to be off by no more.

One walk over the scene tells, for each pixel, how far off some methods can be (src/methods/bounds.rs). The first of these
whose bound is at most `max_error` everywhere makes the image:

1. the unweighted commutative blend, method "wboit" with weight="none": off by R ((Σα)² − Σα²) / 2 at most, so that it is
   exact where there is no fragment, one, or one colour;
2. the k nearest fragments, method "k_buffer" with the least k up to MOST_NEAREST that will do: off by R T;
3. where fragments are stored and not returned, exact with nodes of 8 bits a channel: off by δ (1 + R n);
4. exact.

R is the range of the colours in a pixel, in the channel where it is widest; of nodes, that of the scene. What float32 rounds
comes on top (`rounding`), so that the bounds hold for the image as it is, beside the same fragments composited exactly.
"""

from dataclasses import replace

import numpy as np

from . import _check
from ._check import FLOAT32_MAX
from .errors import ParameterError
from .frame import Plan
from .job import prepared

MOST_NEAREST = 16
STORED = ("linked_list", "prefix_sum")
UNIT = {np.float32: 2.0**-24, np.float64: 2.0**-53}
# What float32 makes of a bound may be a little under it.
SLACK = 1 + 64 * UNIT[np.float32]
HALF_STEP = 1 / 510


def rounding(counts, largest, dtype):
    """What n layers of colours up to `largest` are off by through roundings, at most.

    No term of a sum is negative, so that relative errors add. Exactly composited, 2 n + 2 roundings reach a term at most
    (n factors of a transmittance and their differences from 1, the product, the sum). A mean colour takes n + 1 for its
    sum, n for its weights, 2 n for the coverage, and a quotient, which a GPU rounds by up to 5 of these units.
    """
    return (4 * counts + 16) * UNIT[dtype] * max(1.0, largest)


def rendered(scene, camera, arguments, max_error, upload=lambda job: None):
    """A frame that is off by at most `max_error` in every channel of every pixel.

    Args:
        scene, camera, arguments: as in `render`; neither a method nor an option that only some methods have.
        upload: what the core keeps of the scene for a job, if anything.

    Raises:
        ParameterError: an argument that leaves nothing to choose, or modes that no bound is known for.
    """
    max_error = checked(max_error, arguments)
    exact = prepared(scene, camera, **arguments)
    if any(mesh.blend != "over" for mesh in exact.scene.meshes if not mesh.opaque):
        raise ParameterError('max_error is for blend="over" alone: no bound is known for other modes')
    search = Search(exact, arguments, max_error, upload)
    return search.unsorted() or search.nearest() or search.rounded_nodes() or search.exact()


def checked(max_error, arguments) -> float:
    """`max_error`, if it is one and goes with the other arguments; else raises a ParameterError."""
    max_error = _check.number("max_error", max_error, 0)
    method = arguments.get("method", "exact")
    if method != "exact":
        raise ParameterError(f"max_error chooses the method, and method is {method!r}: leave one of them out")
    for name in ("cutoff", "blend_order", "max_sorted_fragments", "limit_policy", "node_format"):
        if name in arguments:
            raise ParameterError(f"max_error chooses how fragments are composited: leave {name} out")
    if arguments.get("fragments") == "all":
        raise ParameterError('max_error is for what shows, and fragments="all" lists what is hidden: give True')
    if arguments.get("msaa_resolve") == "hdr":
        raise ParameterError('max_error bounds each sample, and "hdr" weighs them by what they are: take "per_pixel"')
    return max_error


class Search:
    """The candidates: each gives a frame, or None if its bound is too large somewhere. `off_…`: those bounds, (H, W)."""

    def __init__(self, exact, arguments, max_error, upload=lambda job: None):
        self.job, self.arguments, self.max_error, self.upload = exact, arguments, max_error, upload
        colors = [*(mesh.colors for mesh in exact.scene.meshes), exact.background]
        self.largest = max(float(c[..., :3].max(initial=0)) for c in colors)
        self.methods_are_free = arguments.get("pipeline", "auto") in ("auto", "tiles")
        if self.methods_are_free:
            tolerance = max(0.0, max_error - float(self.rounding(64))) / SLACK
            self.pairs, self.needed, self.counts = self.look(k=MOST_NEAREST, tolerance=tolerance)

    def rounding(self, counts):
        return rounding(counts, self.largest, self.job.dtype)

    def look(self, **parameters):
        """What bounds.rs gives of each sample: (3, H, W, samples) float64."""
        request = self.job.request | {
            "method": {
                "method": "bounds",
                "parameters": {"of_nearest": False, "tolerance": 0.0} | parameters,
                "own": None,
            },
            "lists": "none",
            "pipeline": "tiles",
            "msaa_resolve": "none",
        }
        job = replace(self.job, request=request, may_change=False)
        image = job.output(self.upload(job))["image"].astype(np.float64)
        shape = request["height"], request["width"], request["samples"], 4
        return np.moveaxis(image.reshape(shape), -1, 0)[:3]

    def bound(self, off):
        """Of pixels, whose samples are returned or averaged; with what roundings add."""
        each = off.max(axis=-1) if self.job.request["msaa_resolve"] == "none" else off.mean(axis=-1)
        return each + self.rounding(self.counts.max(axis=-1))

    def made(self, method, pipeline, options):
        given = self.arguments | {"method": method, "pipeline": pipeline} | options
        job = prepared(self.job.scene, self.job.camera, **given)
        return job.frame(job.output(self.upload(job)))

    def noted(self, frame, off, why, method, **options):
        """The frame, with what was chosen."""
        name = ", ".join([method, *(f"{key}={value!r}" for key, value in options.items())])
        bound = ("error bound", f"{off.max():.3g}", f"at most {self.max_error:.3g} asked")
        plan = Plan([*frame.plan, ("method", name, why), bound])
        return replace(frame, plan=plan, stats=replace(frame.stats, error_bound=float(off.max())), error_bound=off)

    def off_unsorted(self):
        # Sums of n alphas, and of their products, round n times each.
        return self.bound(self.pairs * SLACK * (1 + 2 * self.counts * UNIT[np.float32]))

    def off_nearest(self, k):
        through, *_ = self.look(k=k, of_nearest=True)
        return self.bound(through * SLACK)

    def off_exact(self):
        return self.bound(0 * self.pairs)

    def unsorted(self):
        if not self.methods_are_free:
            return None
        if 2 * self.largest * self.counts.max() > FLOAT32_MAX:
            return None  # their sum may be infinite
        off = self.off_unsorted()
        if off.max() > self.max_error:
            return None
        deepest = self.counts.max()
        why = (
            "no fragment" if deepest == 0 else "one layer at most" if deepest == 1 else "unsorted: R ((Σα)² − Σα²) / 2"
        )
        options = {"weight": "none"}
        return self.noted(self.made("wboit", "tiles", options), off, why, "wboit", **options)

    def nearest(self):
        k = max(1, int(self.needed.max())) if self.methods_are_free else MOST_NEAREST + 1
        if k > MOST_NEAREST:
            return None
        off = self.off_nearest(k)
        if off.max() > self.max_error:
            return None
        options = {"k": k, "tail": "drop"}
        return self.noted(
            self.made("k_buffer", "tiles", options), off, f"R T behind the {k} nearest", "k_buffer", **options
        )

    def rounded_nodes(self):
        """|ΔC| ≤ δ (A + R Σ Tᵢ): C is affine in each alpha, with ∂C/∂αᵢ = Tᵢ (cᵢ − C behind i), so that rounding them one
        after the other adds as much. A and all Tᵢ are at most 1. Hardware covers other pixels than tiles do: the counts are
        those of the frame itself."""
        request = self.job.request
        pipeline, lists = request["pipeline"], request["lists"]
        if pipeline not in STORED or lists not in ("none", "count") or self.largest > 1:
            return None
        options = {"node_format": "rgba8_depth32"}
        frame = self.made("exact", pipeline, options | {"fragments": "count"})
        off = HALF_STEP * (1 + frame.counts) + self.rounding(frame.counts)
        if off.max() > self.max_error:
            return None
        frame = replace(frame, counts=frame.counts if lists == "count" else None)
        return self.noted(frame, off, "nodes of 8 bits: δ (1 + R n)", "exact", **options)

    def exact(self):
        asked = self.arguments.get("fragments") or "count"
        frame = self.made("exact", self.job.request["pipeline"], {"fragments": asked})
        off = self.rounding(frame.counts)
        if not self.arguments.get("fragments"):
            frame = replace(frame, counts=None)
        return self.noted(frame, off, "no bound of another is as small", "exact")
