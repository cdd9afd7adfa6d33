"""Writes README.md beside it, from the table of methods: `python docs/methods/make.py`."""

from pathlib import Path

from abuffer._methods import FLAGS, METHODS
from abuffer.own_methods import BUILT_IN

FAMILIES = {
    "Exact": ("exact", "depth_peeling", "dual_depth_peeling"),
    "Bounded: a pixel keeps so many": (
        "k_buffer",
        "hybrid",
        "adaptive",
        "mlab",
        "bucket_peeling",
        "stencil_routed",
    ),
    "Approximate: sums, in any order": (
        "additive",
        "weighted_sum",
        "weighted_average",
        "wboit",
        "phenomenological",
        "mboit",
        "wavelet",
        "fourier",
        "stochastic",
    ),
    "Baselines, which depend on the order of submission": ("unsorted", "object_sorted", "triangle_sorted"),
}
HEAD = """# Methods

How the fragments of a pixel become a colour. `ab.render(scene, method="wboit", weight="8")` renders with one, and
`frame.fragments.composite("wboit", weight="8")` composites captured lists with it; `print(ab.methods())` prints this table.
All run in tiles, on the CPU in both precisions and on GPUs, and see fragments in the order of submission; what their published
forms do in hardware or with ordered access to pixels is replayed there, so that images are theirs and times are not. Those that
have `hardware` among their pipelines also run on a GPU's rasteriser as published, with `pipeline="hardware"`: blended into
targets of 32-bit floats, peeled by depth tests, or drawn into samples. Their times are theirs there; images are those of tiles but
for what the hardware rounds: edges, depths between corners that are snapped to 1/256 pixel, and sums in the order of blending.

Passes and bytes are those of the defaults: over the geometry, and kept for a pixel by the published form. A method that
normalises depths takes `depth_range=(nearest, farthest)`, by default that of the translucent vertices; over captured lists that
of their fragments. The weight of `wboit` may also be an expression of your own, in WGSL, of the eye depth `z` and `alpha`:
`weight="alpha / (0.1 + z * z)"`. [Adding a method](../adding-a-method.md) says how a whole one is added.
"""
INVARIANTS = """
## Invariants

Tests show that each of these holds where it is marked, with the defaults, and fails where it is not.

"""


def page():
    assert {id for ids in FAMILIES.values() for id in ids} == BUILT_IN
    text = HEAD
    for family, ids in FAMILIES.items():
        text += f"\n## {family}\n\n| method | what | passes | bytes a pixel | parameters | exact | source |\n"
        text += "| --- | --- | --- | --- | --- | --- | --- |\n"
        for id in ids:
            row = METHODS[id].row()
            cells = [
                f"`{id}`",
                *(row[c] for c in ("title", "passes", "bytes per pixel", "parameters", "exact", "source")),
            ]
            text += f"| {' | '.join(cells)} |\n"
    flags = list(FLAGS)
    text += INVARIANTS + "".join(f"- **{flag}**: {meaning}\n" for flag, meaning in FLAGS.items())
    text += f"\n| method | {' | '.join(flags)} |\n| --- |{' --- |' * len(flags)}\n"
    for id in (id for ids in FAMILIES.values() for id in ids):
        marks = ["yes" if flag in METHODS[id].flags else "" for flag in flags]
        text += f"| `{id}` | {' | '.join(marks)} |\n"
    return text


if __name__ == "__main__":
    Path(__file__).with_name("README.md").write_text(page(), encoding="utf-8")
