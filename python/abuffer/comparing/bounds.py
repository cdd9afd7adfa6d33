"""What an image is proven to be off by at most, where that is known (see within.py)."""

from functools import cached_property

from ..job import prepared
from ..within import Search


class Bounds:
    """Those of a scene, which one walk tells for all methods."""

    def __init__(self, subject, size):
        self.subject, self.size = subject, size

    @cached_property
    def _search(self):
        width, height = self.size
        arguments = {"width": width, "height": height, "background": self.subject.background, "device": "cpu"}
        return Search(prepared(self.subject.scene, self.subject.camera, **arguments), arguments, 0.0)

    def proven(self, entry) -> float:
        """The greatest bound of a pixel, in any channel; NaN where none is known.

        In tiles alone: hardware covers other pixels. With roundings of float32.
        """
        modes = any(mesh.blend != "over" for mesh in self.subject.scene.meshes if not mesh.opaque)
        if entry.pipeline != "tiles" or modes:
            return float("nan")
        nearest, parameters = _nearest(entry), entry.parameters
        exact = entry.method in ("exact", "dual_depth_peeling") or (entry.method == "depth_peeling" and not nearest)
        unsorted = entry.method == "weighted_sum" or (entry.method == "wboit" and parameters.get("weight") == "none")
        if not (nearest or exact or unsorted) or (entry.method == "exact" and parameters):
            return float("nan")
        if unsorted:
            return float(self._search.off_unsorted().max())
        return float((self._search.off_nearest(nearest) if nearest else self._search.off_exact()).max())


def _nearest(entry) -> int:
    """How many of the nearest fragments are composited, the others being dropped; 0: it is otherwise."""
    if entry.method == "k_buffer" and entry.parameters.get("tail", "drop") == "drop":
        return entry.parameters.get("k", 8)
    return entry.parameters.get("layers", 0) if entry.method == "depth_peeling" else 0
