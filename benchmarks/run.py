"""Times scenes × pipelines × devices: medians of frames that take turns, ratios of them, and what bounds them.

    python benchmarks/run.py [--devices cpu gpu] [--pipelines tiles linked_list prefix_sum] [--scenes "20k of ~20 px"]
                             [--scale 1.0] [--repeats 7] [--json out.json] [--markdown out.md]

All pipelines that a device has of exact images (`abuffer.methods()`) are rows, those that fail too. Needs numpy; trimesh and
pymeshfix for the real model; torch for the bandwidth of a GPU's copies. `--scale 0.05` suits a software driver.
"""

import argparse
import json
import statistics

import named
import numpy as np
from floor import copy_bandwidth, least_bytes
from report import lines_of
from rows import COLUMNS, HELP, SCENE_COLUMNS, cells, scene_cells, stages
from tiles import measured
from timing import Variant, build, measure

import abuffer as ab

FRAMES = 20  # of plain blending
CHANGED, ALLOWED = 1e-3, 0.01  # hardware may snap the edges of triangles to either side: a share of pixels, not a bound

PIPELINES = ab.methods()["exact"]["pipelines"].split(", ")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--devices", nargs="+", default=["cpu", "gpu"], help='"cpu", "gpu", or parts of names')
    parser.add_argument("--pipelines", nargs="+", default=PIPELINES, choices=PIPELINES)
    parser.add_argument("--scenes", nargs="+", default=list(named.ALL), choices=named.ALL, metavar="SCENE")
    parser.add_argument("--scale", type=float, default=1.0, help="share of the fragments to render")
    parser.add_argument("--memory", default="8GiB", help="of lists and bins; beyond it come bands")
    parser.add_argument("--json", help="a file for every run of every row")
    parser.add_argument("--markdown", help="a file for the tables")
    arguments = parser.parse_args()
    bench = Bench(arguments)
    for name in arguments.scenes:
        bench.add(name)
        print(*bench.rows_of(name), "", sep="\n", flush=True)
        bench.save()  # what there is, should a later scene fail
    print(*bench.notes_read(), sep="\n")
    wrong = [f"{r['scene']}, {r['name']}: {r['image']}" for r in bench.rows if not r.get("holds", True)]
    assert not wrong, "\n".join(["not the image that it should be:", *wrong])


class Bench:
    """Rows that are measured, and notes to them."""

    def __init__(self, arguments):
        self.arguments, self.rows, self.scenes, self.notes = arguments, [], [], []
        found = {device: probed(device) for device in arguments.devices}
        self.devices = {device: row["name"] for device, row in found.items()}
        self.kinds = {device: row["kind"] for device, row in found.items()}
        self.drivers = {device: row["driver"] for device, row in found.items()}
        self.bandwidth = {
            device: (None, "there is no such device") if row["kind"] == "missing" else copy_bandwidth(row["name"])
            for device, row in found.items()
        }
        runs = {p: row["runs on"].split(", ") for p, row in ab.pipelines().items()}
        where = {device: "cpu" if kind == "processor" else "gpu" for device, kind in self.kinds.items()}
        self.pairs = [(d, p) for d in arguments.devices for p in arguments.pipelines if where[d] in runs[p]]

    def add(self, name):
        """Measures a scene."""
        options = {"memory": self.arguments.memory}
        scene = ("build", name, self.arguments.scale)
        variants = [
            Variant(
                f"{p} on {d}", scene, options | {"device": d, "pipeline": p}, check=agrees, awake=not self.is_gpu(d)
            )
            for d, p in self.pairs
        ]
        rows = measure(variants, self.arguments.repeats)
        facts = {"scene": name, "hard for": named.hardness(name)}
        try:
            built = build(*scene)
            facts |= facts_of(*built) | {"least bytes": least_bytes(built[0], *built[2:])}
        except (ab.AbufferError, ImportError, MemoryError) as error:
            facts["error"] = f"{type(error).__name__}: {error}"
        self.scenes.append(facts)
        for (device, pipeline), row in zip(self.pairs, rows, strict=True):
            row |= {"scene": name, "asked": device, "device": self.devices[device], "pipeline": pipeline}
            row["is GPU"] = self.is_gpu(device)
        for row in rows:
            if "error" not in row:
                self.derive(row, rows, facts)
        for device in self.devices:
            self.blend(device, scene, [row for row in rows if row["asked"] == device and "error" not in row])
        self.rows += rows

    def is_gpu(self, device):
        """Whether it is hardware, with timestamps of its own."""
        return self.kinds[device] not in ("processor", "software", "missing")

    def derive(self, row, rows, facts):
        """What follows from times."""
        device = row["asked"]
        gpu = row["gpu"] if self.is_gpu(device) else None
        ms = gpu or row["wall"]
        row["Gfrag/s"] = row["fragments"] / ms * 1e-6
        listed = {r["asked"]: r for r in rows if r["pipeline"] == "linked_list" and "error" not in r}
        base = listed.get(device)
        if self.kinds[device] == "processor":
            base = next((r for d, r in listed.items() if self.kinds[d] == "software"), None)
        for key in ("wall", "gpu") if gpu else ("wall",):
            if base:
                pairs = zip(base["runs"], row["runs"], strict=True)
                row[f"linked_list ÷ {key}"] = statistics.median(b[key] / r[key] for b, r in pairs)
        bandwidth, row["no floor"] = self.bandwidth[device]
        if bandwidth and "least bytes" in facts:
            row["floor"] = facts["least bytes"] / bandwidth * 1e3
            row["÷ floor"] = ms / row["floor"]

    def blend(self, device, scene, rows):
        """Ratios of plain blending on a GPU, or why there is none."""
        if not rows or self.kinds[device] == "processor":
            return
        try:
            if not self.is_gpu(device):
                raise ab.UnsupportedError("timestamps of a software driver leave dispatches out")
            if not all(row["gpu"] for row in rows):
                raise ab.UnsupportedError("this device has no timestamps")
            sides = measured(*build(*scene), device, FRAMES)
        except ab.AbufferError as error:
            for row in rows:
                row["no blending"] = str(error)
            return
        tiles, blending = ([frame["gpu"] for frame in side] for side in sides)
        for row in rows:
            row["blending"] = statistics.median(blending)
            row["blending ÷"] = row["blending"] / row["gpu"]
            if row["pipeline"] == "tiles":
                row["gpu, back to back"] = statistics.median(tiles)
                row["blending ÷"] = statistics.median(b / t for b, t in zip(blending, tiles, strict=True))

    def rows_of(self, scene):
        """The rows of a scene as lines of a table."""
        return lines_of(COLUMNS, [cells(row, self.note) for row in self.rows if row["scene"] == scene])

    def note(self, text):
        """The mark of a footnote."""
        if text not in self.notes:
            self.notes.append(text)
        return f"[{self.notes.index(text) + 1}]"

    def notes_read(self):
        return [f"[{i}] {text}  " for i, text in enumerate(self.notes, 1)]

    def save(self):
        arguments = self.arguments
        devices = [
            {"asked": d, "name": name, "kind": self.kinds[d], "driver": self.drivers[d], "copies": self.bandwidth[d][0]}
            for d, name in self.devices.items()
        ]
        if arguments.json:
            found = {"devices": devices, "scale": arguments.scale, "scenes": self.scenes, "rows": self.rows}
            with open(arguments.json, "w") as file:
                json.dump(found, file, indent=1)
        if arguments.markdown:
            with open(arguments.markdown, "w") as file:
                file.write("\n".join(self.markdown(devices)) + "\n")

    def markdown(self, devices):
        said = []
        for d in devices:
            facts = [d["kind"], d["driver"], f"copies {d['copies'] / 1e9:.1f} GB/s" if d["copies"] else ""]
            said.append(f"{d['name']} ({', '.join(fact for fact in facts if fact)})")
        yield f"# Pipelines on {'; '.join(said)}"
        yield f"\nMedians of {self.arguments.repeats}, scale {self.arguments.scale:g}, memory {self.arguments.memory}."
        yield HELP
        rows = [cells(row, self.note) for row in self.rows]
        yield from lines_of(COLUMNS, rows)
        yield from ("", *self.notes_read(), "\n## Stages, ms\n")
        yield from lines_of(["scene", "device", "pipeline", "stages"], map(stages, self.rows))
        yield "\n## Scenes\n"
        yield from lines_of(SCENE_COLUMNS, map(scene_cells, self.scenes))


def probed(device):
    """A device's name, kind and driver; of one that is missing, what it was called."""
    try:
        name = ab.render(ab.Mesh(np.eye(3)), width=8, height=8, device=device).stats.device
    except ab.DeviceError:  # rows will say
        return {"name": device, "kind": "missing", "driver": ""}
    return {"name": name} | ab.devices()[name]


def agrees(frame, reference):
    """What the image column says, and whether it holds."""
    off = np.abs(frame.image - reference.image).max(axis=-1)
    share = float((off > CHANGED).mean())
    if share:
        return f"{share:.1e} of pixels off by > {CHANGED:g}", share < ALLOWED
    return f"within {off.max():.0e}" if off.any() else "same numbers", True


def facts_of(meshes, camera, width, height):
    """A scene's size and lengths of lists, in bins of powers of two. The CPU counts them, which needs no GPU."""
    counts = ab.render(meshes, camera, width=width, height=height, device="cpu", fragments="count").counts
    longest = int(counts.max(initial=0))
    lows = [0, *(1 << k for k in range(longest.bit_length()))]
    ends = [*lows[1:], 2 * lows[-1] if longest else 1]
    bins = {
        str(low) if end == low + 1 else f"{low}–{end - 1}": int(((counts >= low) & (counts < end)).sum())
        for low, end in zip(lows, ends, strict=True)
    }
    triangles = ab.Scene([meshes]).triangle_count
    return {
        "size": f"{width}×{height}",
        "triangles": triangles,
        "fragments": int(counts.sum()),
        "deepest": longest,
        "pixels by list length": bins,
    }


if __name__ == "__main__":
    main()
