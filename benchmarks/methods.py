"""Methods in their published form on the hardware's rasteriser, beside their replay in tiles and beside exact.

    python benchmarks/methods.py --device gpu --frames 20 --json methods.json --markdown methods.md

GPU time of a frame is the sum of its passes, less the one that counts fragments where the method does not need it; frames of all
methods run in turns. Medians, and the median of turns of each ratio. Errors are of the image on the device, against exact in
float64: of the replay, since edges and depths are rounded otherwise by hardware.
"""

import argparse
import json
import statistics
from pathlib import Path

import numpy as np
from report import lines_of

import abuffer as ab
from abuffer._methods import METHODS
from abuffer.comparing.measuring import gpu_ms
from scenes import SIX, random_triangles

NAMES = ("200k of ~6 px", "20k of ~20 px", "200 of ~400 px", "1500 of ~400 px")
METHODS_TIMED = (
    *((id, {}) for id in METHODS if not METHODS[id].sorts),
    ("mboit", {"moments": 8}),
    ("stochastic", {"estimator": "c"}),
    ("depth_peeling", {"layers": 4}),
)
# Passes over lists of hundreds take seconds, and say no more than those of tens.
DEEP = {"dual_depth_peeling": 64, "depth_peeling": 64}
TARGETS = ("float32", "float16")


def variants(deepest):
    for id, options in METHODS_TIMED:
        if deepest > DEEP.get(id, deepest) and "layers" not in options:
            continue
        yield id, options, "tiles", {}
        if METHODS[id].is_native:
            for targets in TARGETS:
                yield id, options, "hardware", {"targets": targets}


def measured(name, args):
    scene, camera, width, height = random_triangles(name, scale=args.scale, table=SIX)
    size = {"width": width, "height": height, "memory": 8 << 30}
    renderer = ab.Renderer(args.device)
    uploaded = renderer.upload(scene)
    counts = renderer.render(uploaded, camera, **size, fragments="count")
    exact = ab.render(scene, camera, **size, precision="float64").image
    rows = {}
    for id, options, pipeline, targets in variants(counts.stats.max_depth_complexity):
        arguments = size | {"method": id, "pipeline": pipeline} | options | targets
        try:
            frame = renderer.render(uploaded, camera, **arguments)
        except ab.UnsupportedError as e:  # of software drivers, where loops end
            print(f"{name}, {id}: {e}", flush=True)
            continue
        error = np.abs(frame.image.astype(np.float64) - exact)
        rows[id, str(options), pipeline, targets.get("targets", "")] = {
            "scene": name,
            "method": id,
            "options": options,
            "pipeline": pipeline,
            "targets": targets.get("targets", ""),
            "rmse": float(np.sqrt(np.mean(error**2))),
            "max": float(error.max()),
            "bytes a pixel": frame.stats.bytes.get("targets", 0) / (width * height),
            "arguments": arguments,
            "ms": [],
        }
    for _ in range(args.frames):
        for row in rows.values():
            frame = renderer.render(uploaded, camera, **row["arguments"])
            row["ms"].append(gpu_ms(frame.stats))
    return counts.stats, list(rows.values())


def table(rows):
    """A line a method: its times, each by that of exact in the same turn, and errors."""
    found = {(row["method"], str(row["options"]), row["pipeline"], row["targets"]): row for row in rows}
    base = found["exact", "{}", "tiles", ""]["ms"]

    def cells(row):
        if row is None:
            return ["", ""]
        ratio = statistics.median(a / b for a, b in zip(row["ms"], base, strict=True))
        return [f"{statistics.median(row['ms']):.3f}", f"{ratio:.2f}"]

    lines = []
    for id, options in dict.fromkeys((id, options) for id, options, *_ in found):
        tiles = found.get((id, options, "tiles", ""))
        native = [found.get((id, options, "hardware", targets)) for targets in TARGETS]
        any_row = tiles or native[0]
        label = id + "".join(f" {key}={value}" for key, value in any_row["options"].items())
        times = [cell for row in (tiles, *native) for cell in cells(row)]
        off = [f"{row['rmse']:.1e}" if row else "" for row in (tiles, native[1])]
        lines.append([label, *times, f"{native[0]['bytes a pixel']:.0f}" if native[0] else "", *off])
    head = ["method", "tiles ms", "÷ exact", "hardware ms", "÷ exact", "16 bits ms", "÷ exact", "bytes a pixel"]
    return lines_of([*head, "RMSE", "RMSE of 16 bits"], lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="gpu")
    parser.add_argument("--frames", type=int, default=20)
    parser.add_argument("--scale", type=float, default=1.0, help="share of the fragments")
    parser.add_argument("--scenes", nargs="+", default=NAMES, choices=tuple(SIX))
    parser.add_argument("--json", type=Path)
    parser.add_argument("--markdown", type=Path)
    args = parser.parse_args()
    lines, all_rows = [], []
    for name in args.scenes:
        stats, rows = measured(name, args)
        said = f"{name}: {stats.fragments:,} fragments, at most {stats.max_depth_complexity} in a pixel; {stats.device}"
        own = [said, "", *table(rows), ""]
        print("\n".join(own), flush=True)
        lines += own
        all_rows += rows
    if args.markdown:
        args.markdown.write_text("\n".join(lines), encoding="utf-8")
    if args.json:
        args.json.write_text(json.dumps(all_rows, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
