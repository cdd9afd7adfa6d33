"""Writes README.md beside it, and what stands in each method's page between two marks, from the table of methods:
`python docs/methods/make.py`. The rest of a page is written by hand."""

from pathlib import Path

from abuffer._methods import METHODS
from abuffer.method import FLAGS
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
`weight="alpha / (0.1 + z * z)"`. With `bits=16`, `mboit` rounds its moments each time that a fragment is added, so that the
order of submission shows a little. [Adding a method](../adding-a-method.md) says how a whole one is added.

Each method has a page of its own, with its equations, what it costs, and a picture of what it gets wrong.
"""
INVARIANTS = """
## Invariants

Tests show that each of these holds where it is marked, with the defaults, and fails where it is not.

"""


def index():
    assert {id for ids in FAMILIES.values() for id in ids} == BUILT_IN
    text = HEAD
    for family, ids in FAMILIES.items():
        text += (
            f"\n## {family}\n\n| method | what | passes | bytes a pixel | parameters | exact | pipelines | source |\n"
        )
        text += "| --- | --- | --- | --- | --- | --- | --- | --- |\n"
        for id in ids:
            row = METHODS[id].row()
            cells = [
                f"[`{id}`]({id}.md)",
                row["title"],
                *(row[c].partition(";")[0] for c in ("passes", "bytes per pixel")),
                *(row[c] for c in ("parameters", "exact", "pipelines", "source")),
            ]
            text += f"| {' | '.join(cells)} |\n"
    flags = list(FLAGS)
    text += INVARIANTS + "".join(f"- **{flag}**: {meaning}\n" for flag, meaning in FLAGS.items())
    text += f"\n| method | {' | '.join(flags)} |\n| --- |{' --- |' * len(flags)}\n"
    for id in (id for ids in FAMILIES.values() for id in ids):
        marks = ["yes" if flag in METHODS[id].flags else "" for flag in flags]
        text += f"| [`{id}`]({id}.md) | {' | '.join(marks)} |\n"
    return text


BEGIN, END = "<!-- from the table of methods, by make.py -->\n", "<!-- until here -->\n"


def block(method):
    """What a page says first: the method's row."""
    text = f"{BEGIN}# `{method.id}`: {method.title}\n\n"
    rows = {
        "source": method.source,
        "fragments are taken": ORDERS[method.order],
        "passes over the geometry": method.by_parameters(method.passes),
        "bytes a pixel": method.by_parameters(method.bytes_per_pixel),
        "exact": method.exact_when,
        "deterministic": method.deterministic,
        "pipelines": ", ".join(f"`{name}`" for name in method.pipelines),
        "holds": _invariants(flag for flag in FLAGS if flag in method.flags),
        "does not hold": _invariants(flag for flag in FLAGS if flag not in method.flags),
    }
    text += "| | |\n| --- | --- |\n" + "".join(f"| {name} | {value} |\n" for name, value in rows.items())
    given = [(f"`{p.name}`", f"`{p.default!r}`", _values(p), p.about) for p in method.parameters]
    if method.takes_range:
        given.append(("`depth_range`", "that of the translucent vertices", "two eye depths", "nearest and farthest"))
    if given:
        text += "\n| parameter | default | values | what |\n| --- | --- | --- | --- |\n"
        text += "".join(f"| {' | '.join(cells)} |\n" for cells in given)
    return text + END


ORDERS = {
    "front_to_back": "front to back",
    "submission": "in the order of submission",
    "any": "in any order",
}


def _values(parameter):
    if parameter.choices:
        return ", ".join(f"`{choice!r}`" for choice in parameter.choices)
    if isinstance(parameter.default, bool):
        return "`True`, `False`"
    return f"{parameter.low:.10g} to {parameter.high:.10g}"


def _invariants(flags):
    return "; ".join(FLAGS[flag] for flag in flags) or "none of [those that are looked at](README.md#invariants)"


def refreshed(text, method):
    """A page with the block as the table has it now."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return before + block(method) + after


def main():
    folder = Path(__file__).parent
    (folder / "README.md").write_text(index(), encoding="utf-8")
    for id in sorted(BUILT_IN):
        page = folder / f"{id}.md"
        page.write_text(refreshed(page.read_text(encoding="utf-8"), METHODS[id]), encoding="utf-8")


if __name__ == "__main__":
    main()
