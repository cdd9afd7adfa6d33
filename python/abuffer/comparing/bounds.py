"""What an image is proven to be off by at most, where that is known (see within.py)."""

from ..job import prepared
from ..within import Search


def proven(entry, subject, lists) -> float:
    """The greatest bound of a pixel, in any channel; NaN where none is known.

    In tiles alone: hardware covers other pixels. With roundings of float32.
    """
    modes = any(mesh.blend != "over" for mesh in subject.scene.meshes if not mesh.opaque)
    if entry.pipeline != "tiles" or modes:
        return float("nan")
    nearest = _nearest(entry)
    exact = entry.method in ("exact", "dual_depth_peeling") or (entry.method == "depth_peeling" and not nearest)
    unsorted = entry.method == "weighted_sum" or (entry.method == "wboit" and entry.parameters.get("weight") == "none")
    if not (nearest or exact or unsorted) or (entry.method == "exact" and entry.parameters):
        return float("nan")
    height, width = lists.counts.shape
    arguments = {"width": width, "height": height, "background": subject.background, "device": "cpu"}
    search = Search(prepared(subject.scene, subject.camera, **arguments), arguments, 0.0)
    if unsorted:
        return float(search.off_unsorted().max())
    return float((search.off_nearest(nearest) if nearest else search.off_exact()).max())


def _nearest(entry) -> int:
    """How many of the nearest fragments are composited, the others being dropped; 0: it is otherwise."""
    if entry.method == "k_buffer" and entry.parameters.get("tail", "drop") == "drop":
        return entry.parameters.get("k", 8)
    return entry.parameters.get("layers", 0) if entry.method == "depth_peeling" else 0
