"""Tiles on a GPU, against the hardware's plain blending of the same draw, which sorts nothing, and against linked_list.

    python benchmarks/tiles.py --device gpu --frames 20 --json results.json --markdown results.md

GPU time of a frame is from the first begin to the last end of its stages, clears included; frames of tiles and of
plain blending run in turns, back to back, so that the device keeps its clock. Medians.
"""

import argparse
import json
import statistics
from pathlib import Path

import abuffer as ab
from abuffer import _core, options, tables
from scenes import SIX, random_triangles


def measured(scene, camera, width, height, device, frames):
    """Frames of tiles, and of plain blending: each a dict of stages."""
    adapter, pipeline = tables.choose("tiles", device, "float32", None, [])
    request = options.all_of({}, pipeline) | {
        "width": width,
        "height": height,
        "lists": "none",
        "memory": 8 << 30,
        "samples": 1,
        "pipeline": "tiles",
        "blends": [],
        "least_transmittance": 0.0,
    }
    parts = [mesh._parts(()) for mesh in ab.Scene([scene]).meshes]
    view = camera._at(width, height)._parts(width, height)
    sides = _core.Upload(adapter).measure(parts, view, request, [0.0, 0.0, 0.0, 0.0], frames)
    return [[dict(frame) for frame in side] for side in sides]


def median(frames, stage):
    return statistics.median(frame.get(stage, 0.0) for frame in frames)


def row(name, args):
    scene, camera, width, height = random_triangles(name, scale=args.scale, table=SIX)
    tiles, blending = measured(scene, camera, width, height, args.device, args.frames)
    render = {"camera": camera, "width": width, "height": height, "device": args.device, "memory": 8 << 30}
    frame = ab.render(scene, pipeline="tiles", fragments="count", **render)
    result = {
        "scene": name,
        "size": f"{width}×{height}",
        "fragments": frame.stats.fragments,
        "longest": frame.stats.max_depth_complexity,
        "classes": frame.plan["tile classes"],
        "tiles ms": median(tiles, "gpu"),
        "blending ms": median(blending, "gpu"),
        "× blending": statistics.median(b["gpu"] / t["gpu"] for t, b in zip(tiles, blending, strict=True)),
        "Gfrag/s": frame.stats.fragments / median(tiles, "gpu") * 1e-6,
    }
    result |= {f"{stage} ms": median(tiles, stage) for stage in tiles[0] if stage != "gpu"}
    if args.lists:
        stages = ("build", "classify")
        listed = []
        for _ in range(3):
            measured(scene, camera, width, height, args.device, 10)  # the clock stays up
            listed.append(ab.render(scene, pipeline="linked_list", **render))
        times = [
            sum(ms for stage, ms in f.stats.ms.items() if stage in stages or stage.startswith("resolve"))
            for f in listed
        ]
        result["linked_list ms"] = statistics.median(times)
        result["× linked_list"] = result["linked_list ms"] / result["tiles ms"]
    return result


def markdown(rows):
    columns = list(rows[0])
    shown = [
        [
            f"{v:.3f}" if isinstance(v, float) and v > 1e-3 else f"{v:.2g}" if isinstance(v, float) else str(v)
            for v in r.values()
        ]
        for r in rows
    ]
    lines = [columns, ["---"] * len(columns), *shown]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="gpu", help="a device by name (default: gpu)")
    parser.add_argument("--frames", type=int, default=20, help="frames of each side (default: 20)")
    parser.add_argument("--scale", type=float, default=1.0, help="share of the fragments (default: 1)")
    parser.add_argument("--scene", action="append", choices=list(SIX), help="one of the scenes; all by default")
    parser.add_argument("--no-lists", dest="lists", action="store_false", help="leave linked_list out")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--markdown", type=Path)
    args = parser.parse_args()
    rows = []
    for name in args.scene or SIX:
        rows.append(row(name, args))
        print(markdown(rows[-1:]), flush=True)
    device = ab.render(
        random_triangles("20k of ~20 px", scale=0.01)[0], device=args.device, pipeline="tiles"
    ).stats.device
    means = {
        column: statistics.geometric_mean(r[column] for r in rows)
        for column in ("× blending", "× linked_list")
        if column in rows[0]
    }
    print(device, means)
    if args.json:
        args.json.write_text(json.dumps({"device": device, "geometric means": means, "rows": rows}, indent=1))
    if args.markdown:
        args.markdown.write_text(f"# Tiles on {device}\n\n{markdown(rows)}\nGeometric means: {means}\n")


if __name__ == "__main__":
    main()
