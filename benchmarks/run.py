"""Times the pipelines on the benchmark scenes, interleaved in one process: medians, and ratios of them.

python benchmarks/run.py [--repeats 7] [--devices cpu gpu] [--scenes "20k of ~20 px"] [--json out.json]
"""

import argparse
import json
import statistics
import time

import numpy as np

import abuffer as ab
import scenes


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--devices", nargs="+", default=["cpu", "gpu"])
    parser.add_argument("--scenes", nargs="+", default=list(scenes.RANDOM)[:3], choices=list(scenes.RANDOM))
    parser.add_argument("--json")
    arguments = parser.parse_args()
    rows = [row for name in arguments.scenes for row in measure(name, arguments.devices, arguments.repeats)]
    columns = ["scene", "device", "fragments", "wall_ms", "slower_than_first", "stages_ms"]
    print("\t".join(columns))
    for row in rows:
        print("\t".join(str(row[column]) for column in columns))
    if arguments.json:
        with open(arguments.json, "w") as file:
            json.dump(rows, file, indent=1)


def measure(name, devices, repeats):
    """One row a device. The devices take turns, so that what else the machine does hits them alike."""
    mesh, camera, width, height = scenes.random_triangles(name)
    walls, stages, frames = ({device: [] for device in devices} for _ in range(3))
    for turn in range(repeats + 1):  # the first turn makes pipelines and pages, and is not counted
        for device in devices:
            start = time.perf_counter()
            frame = ab.render(mesh, camera, width=width, height=height, device=device)
            wall = (time.perf_counter() - start) * 1e3
            if turn:
                walls[device].append(wall)
                stages[device].append(frame.stats.ms)
            frames[device] = frame
    first = statistics.median(walls[devices[0]])
    for device in devices:
        off = np.abs(frames[device].image - frames[devices[0]].image)
        # Edges may snap to either side on another rasteriser: a share of pixels, not a bound.
        assert (off > 1e-3).mean() < 0.01, f"{device} and {devices[0]} disagree on {name}"
        wall = statistics.median(walls[device])
        median = {s: round(statistics.median(ms[s] for ms in stages[device]), 3) for s in stages[device][0]}
        yield {
            "scene": name,
            "device": frames[device].stats.device,
            "fragments": frames[device].stats.fragments,
            "wall_ms": round(wall, 2),
            "slower_than_first": round(wall / first, 2),
            "stages_ms": median,
        }


if __name__ == "__main__":
    main()
