"""What each choice of the pipelines linked_list and prefix_sum costs, and whether it changes the image.

    python benchmarks/lists.py [--device gpu] [--repeats 9] [--scale 1.0] [--only formats sorts]
                               [--markdown out.md] [--json out.json]

Prints tables in markdown. All variants of a scene take turns; times are medians, and only those of one scene compare.
Every image is checked, and at the end one that is not as it should be is an error. `--scale 0.05` suits a software
driver.
"""

import argparse
from itertools import pairwise

import numpy as np
from report import Report, cells
from timing import build, measure_apart, same_lists, within

import abuffer as ab

PIPELINES = ("linked_list", "prefix_sum")
SORTS = ("auto", "insertion", "selection", "bitonic", "merge", "heap")
CLASSES = (1, 4, 8, 16, 32, 64)
# How far a format moves a colour, and how many codes a depth has (None: nothing is lost).
FORMATS = {
    "float32": (0, None),
    "rgba8_depth32": (1 / 510, 2**23),  # float32 depths tie too, and then go by colour
    "rgba8_depth24_coverage8": (1 / 510, 2**24),
    "rgb565_depth16": (1 / 62, 2**16),
    "rgb9e5_alpha8_depth24": (1 / 510, 2**24),
}
ROUNDING = 1e-5  # of float32, over some dozens of layers


def storage(report):
    """Storage: linked lists against count, scan, scatter"""
    groups = {}
    for name, scene in report.random_scenes().items():
        groups[name] = [report.variant(p, scene, {"pipeline": p}) for p in PIPELINES]
        if name != "1500 of ~400 px":  # whose lists take longer to read back than all else here
            returned = [report.variant(f"{p}, returned", scene, {"pipeline": p, "fragments": True}) for p in PIPELINES]
            returned[1].like, returned[1].check = returned[0].name, same_lists
            groups[name] += returned
    columns = ["fragments", "a pixel", "longest", "bands", "fill ms", "fill ×", "resolve ms", "resolve ×"]
    report.groups("storage", groups, [*columns, "wall ms", "wall ×", "image"])


def formats(report):
    """Node formats"""
    report.say(
        "Checked: colours are off by half a step of the format, but where depths of one code let fragments change "
        "places, in no more pixels than chance gives."
    )
    groups = {
        name: [report.variant(f, scene, {"node_format": f}, check=rounded(f)) for f in FORMATS]
        for name, scene in report.random_scenes().items()
    }
    columns = ["bytes a node", "fragments", "bands", "fill ms", "fill ×", "resolve ms", "resolve ×", "image"]
    report.groups("formats", groups, columns)


def rounded(node_format):
    step, codes = FORMATS[node_format]

    def check(frame, reference):
        off = np.abs(frame.image - reference.image).max(axis=-1)
        reordered = float((off > step + ROUNDING).mean())
        # n (n - 1) / 2 pairs of a list, each with a chance of at most 2 / codes to share one.
        allowed = frame.stats.max_depth_complexity**2 / codes if codes else 0.0
        said = f"within {off.max():.1e}" if off.any() else "same bits"
        return said + (f", {reordered:.1e} of pixels reordered" if reordered else ""), reordered <= allowed

    return check


def msaa(report):
    """Samples a pixel"""
    groups = {}
    for name in ("20k of ~20 px", "200 of ~400 px"):
        scene = report.random_scenes()[name]
        groups[name] = [report.variant("1", scene, {})]
        for samples in (4, 8):
            options = {"samples": samples, "msaa_resolve": "per_pixel"}
            base = report.variant(f"{samples} per_pixel", scene, options, like=None)
            options = {"samples": samples, "msaa_resolve": "per_sample"}
            groups[name] += [
                base,
                report.variant(f"{samples} per_sample", scene, options, like=base.name, check=within(ROUNDING)),
            ]
    columns = ["bytes a node", "fragments", "a pixel", "bands", "fill ms", "fill ×", "resolve ms", "resolve ×", "image"]
    report.groups("msaa", groups, columns)


def sorts(report):
    """Sorts by list length: resolve ms, and its ratio to that of auto"""
    report.say("Lists of exactly so many fragments in random order, contiguous (prefix_sum).")
    lines = []
    for length in (2, 4, 8, 16, 32, 64, 256):
        scene = ("of_lengths", length, length, report.scale)
        options = [{"sort": sort, "pipeline": "prefix_sum"} for sort in SORTS]
        variants = [report.variant(o["sort"], scene, o) for o in options]
        rows = report.measure("sorts", f"{length} layers", variants)
        times = [f"{own} ({times})" for _, own, times in cells(rows, ["resolve ms", "resolve ×"])]
        said = {row["image"] for row in rows}
        lines.append([length, f"{rows[0]['fragments']:,}", *times, ", ".join(sorted(said))])
    report.table(["list length", "fragments", *SORTS, "images"], lines)


def classes(report):
    """Resolve classes against one array of 64"""
    scene = ("mixed_lengths", report.scale)
    mesh, camera, width, height = build(*scene)
    counts = ab.render(mesh, camera, width=width, height=height, device="cpu", fragments="count").counts
    filled = counts[counts > 0]
    ranges = {
        f"{low + 1}–{high}" if low + 1 < high else str(high): (low + 1, high) for low, high in pairwise((0, *CLASSES))
    }
    shares = {name: ((filled >= least) & (filled <= most)).mean() for name, (least, most) in ranges.items()}
    report.say(
        f"Lists of {filled.mean():.2f} fragments on average and {filled.max()} at most in {filled.size:,} of "
        f"{counts.size:,} pixels: {', '.join(f'{name}: {share:.2%}' for name, share in shares.items())}. "
        "Resolve is classification and classes."
    )
    # The chapter's own: one array, sorted by insertion. A network over all of it is what long lists gain from.
    one, many = {"resolve_classes": (64,), "sort": "insertion"}, {"resolve_classes": CLASSES}
    network = {"resolve_classes": (64,)}
    for pipeline in PIPELINES:
        choices = {
            "one array, of 64": one,
            "one array, sort auto": network,
            "classes up to 64": many,
            "classes up to 32, longer lists apart": {"resolve_classes": CLASSES[:-1]},
        }
        variants = [report.variant(name, scene, {"pipeline": pipeline} | o) for name, o in choices.items()]
        rows = report.measure("classes", f"mixed, {pipeline}", variants)
        columns = ["fragments", "longest", "classify ms", "classes ms", "classes ×", "resolve ms", "resolve ×", "image"]
        report.table([pipeline, *columns], cells(rows, columns))
        stages = ", ".join(
            f"{s.removeprefix('resolve ')}: {t:.3f}" for s, t in rows[2]["stages"].items() if s.startswith("resolve ")
        )
        report.say(f"Of the classes up to 64, ms: {stages}")
    report.say("The gain of each class: scenes whose lists all are of one, each length as often, contiguous.")
    lines = []
    for name, bounds in ranges.items():
        scene = ("of_lengths", *bounds, report.scale)
        options = {"pipeline": "prefix_sum"}
        variants = [report.variant(n, scene, options | o) for n, o in (("one array", one), ("classes", many))]
        rows = report.measure("classes", f"lists of {name}", variants)
        first, second = cells(rows, ["fragments", "classes ms", "classes ×", "resolve ms", "resolve ×", "image"])
        lines.append([name, first[1], first[2], *second[2:4], first[4], *second[4:]])
    head = ["list lengths", "fragments", "one array ms", "class ms", "class ×"]
    report.table([*head, "resolve ms, one array", "resolve ms, classes", "resolve ×", "image"], lines)


def counter(report):
    """Node counter: one atomic addition a subgroup, or one a fragment"""
    variants = []
    for name, scene in report.random_scenes().items():
        base = report.variant(f"{name}, as is", scene, {})
        variants += [base, report.variant(f"{name}, no subgroups", scene, {}, like=base.name, without="SUBGROUP")]
    apart(report, "counter", variants, ["counter", "fragments", "bands", "fill ms", "fill ×", "image"])


def resolve(report):
    """Resolve by dispatches or by full-screen passes"""
    groups = {}
    for name, share in (("a stripe over 5 %", 0.05), ("all of the image", 1.0)):
        scene = ("stripe", share, report.scale)
        groups[name] = [report.variant(kind, scene, {"resolve": kind}) for kind in ("compute", "fragment")]
    columns = ["fragments", "a pixel", "longest", "fill ms", "fill ×", "resolve ms", "resolve ×", "wall ms", "image"]
    report.groups("resolve", groups, columns)


def opaque(report):
    """Opaque geometry: the depth test forced before the shader, or a compare in it"""
    report.say("348k opaque and 254k translucent triangles of ~6 px at random depths.")
    scene = ("half_hidden", report.scale)
    base = report.variant("as is", scene, {})
    without = report.variant("no forced test", scene, {}, like=base.name, without="SHADER_EARLY_DEPTH_TEST")
    columns = ["opaque geometry", "fragments", "opaque ms", "fill ms", "fill ×", "resolve ms", "wall ms", "image"]
    apart(report, "opaque", [base, without], columns)


def apart(report, table, variants, columns):
    """Pairs of variants, in processes that withhold what the second of a pair lacks."""
    rows = report.measure(table, "processes in turns", variants, measure_apart)
    report.table(
        ["variant", *columns], (line for i in range(0, len(rows), 2) for line in cells(rows[i : i + 2], columns))
    )


TABLES = {table.__name__: table for table in (storage, formats, msaa, sorts, classes, counter, resolve, opaque)}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="gpu", help='"gpu", or a part of its name')
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--scale", type=float, default=1.0, help="share of the fragments to render")
    parser.add_argument("--memory", default="8GiB", help="of lists; beyond it, or what the device binds, come bands")
    parser.add_argument("--only", nargs="+", default=list(TABLES), choices=list(TABLES))
    parser.add_argument("--markdown", help="a file for the tables")
    parser.add_argument("--json", help="a file for every run of every row")
    arguments = parser.parse_args()
    name = ab.render(ab.Mesh(np.eye(3)), width=8, height=8, device=arguments.device, pipeline=PIPELINES[0]).stats.device
    device = {"name": name, **ab.devices()[name]}
    report = Report(arguments, device)
    report.say(
        f"# Lists on {name}",
        "",
        f"{device['driver']}, {device['backend']}, {device['kind']}; medians of {arguments.repeats}, scale "
        f"{arguments.scale:g}, memory {arguments.memory}. Fill (build; or count, scan and scatter) and resolve "
        "(classification, classes, average, long lists) are by the device's own timestamps, wall is the whole render. "
        "× is the median over turns of the ratio to a scene's first row.",
    )
    for table in arguments.only:
        report.say(f"## {TABLES[table].__doc__}")
        TABLES[table](report)
        report.save()  # what there is, should a later table fail
    assert not report.wrong, "\n".join(["not the image that it should be:", *report.wrong])


if __name__ == "__main__":
    main()
