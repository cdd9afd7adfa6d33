"""Measures renders in turns, so that what else the machine does hits them alike, and checks what they return.

A render is a scene, named by a function of scenes.py or named.py and its arguments, and options of `abuffer.render`.
Run as a program it measures what it reads from stdin, with the environment of that process, and is asked to by
`measure_apart`.
"""

import functools
import hashlib
import json
import os
import statistics
import subprocess
import sys
import time
from dataclasses import dataclass, field

import named
import numpy as np

import abuffer as ab
import scenes

AWAKE_SECONDS = 0.1
# The first frames of a process take up to twice as long: their memory is new to it.
WARM_SECONDS = 0.3

# Stages that are the host's. Several submissions have no span of GPU time: the sum of the others stands for it.
HOST = ("upload", "wait and readback", "lists")
# Sums of the stages that a render reports: GPU time.
CLASSES = ("resolve ", "average", "long lists")
SUMS = {
    "fill": lambda stage: stage in ("build", "append", "count", "scan", "scatter", "gather"),
    "resolve": lambda stage: stage.startswith(("classify", *CLASSES)),
    "classify": lambda stage: stage == "classify",
    "classes": lambda stage: stage.startswith(CLASSES),
    "opaque": lambda stage: stage == "opaque",
}


def same_bits(frame, reference):
    """What the check of an image says, and whether it holds."""
    if np.array_equal(frame.image.view(np.uint32), reference.image.view(np.uint32)):
        return "same bits", True
    return f"off by {np.abs(frame.image - reference.image).max():.1e}", False


def same_lists(frame, reference):
    said, holds = same_bits(frame, reference)
    arrays = ("offsets", "key", "primitive", "color")
    same = all(np.array_equal(getattr(frame.fragments, a), getattr(reference.fragments, a)) for a in arrays)
    return (said, holds) if same else ("other lists", False)


def within(tolerance):
    def check(frame, reference):
        off = np.abs(frame.image - reference.image).max()
        return ("same bits" if same_bits(frame, reference)[1] else f"within {off:.1e}"), bool(off <= tolerance)

    return check


@dataclass
class Variant:
    """A row to measure."""

    name: str
    scene: tuple  # a function of scenes.py or named.py, then its arguments
    options: dict = field(default_factory=dict)
    like: str | None = ""  # the row whose image it is checked against: "" the first one, None none
    check: object = same_bits
    without: str = ""  # features that are withheld from a process of its own
    awake: bool = False  # no frames beforehand: see `render`


@functools.lru_cache(maxsize=4)
def build(function, *arguments):
    return (vars(scenes) | vars(named))[function](*arguments)


def render(scene, options, awake=False):
    """A frame, and the wall time it took.

    A GPU lowers its clock while it waits, for the CPU's part of the frame before say: it is woken first by frames that
    are not counted, unless it is `awake` whatever it does, as a software driver is.
    """
    meshes, camera, width, height = build(*scene)
    if options.get("device") != "cpu" and not awake:
        image_only = options | {"fragments": False}
        start = time.perf_counter()
        while time.perf_counter() - start < AWAKE_SECONDS:
            ab.render(meshes, camera, width=width, height=height, **image_only)
    start = time.perf_counter()
    frame = ab.render(meshes, camera, width=width, height=height, **options)
    return frame, (time.perf_counter() - start) * 1e3


def run_of(frame, wall):
    """The times of one render."""
    stages = frame.stats.ms
    sums = {name: sum(ms for stage, ms in stages.items() if of(stage)) for name, of in SUMS.items()}
    gpu = frame.stats.gpu_ms
    if gpu is None and frame.stats.device != "cpu":
        gpu = sum(ms for stage, ms in stages.items() if stage not in HOST) or None  # a device may have no timestamps
    return {"wall": wall, "gpu": gpu} | sums | {"stages": stages}


def facts_of(frame):
    """What does not change from turn to turn."""
    chosen, reasons = ({row[0]: row[i] for row in frame.plan} for i in (1, 2))
    return {
        "device": frame.stats.device,
        "pixels": frame.image.shape[0] * frame.image.shape[1],
        "fragments": frame.stats.fragments,
        "longest": frame.stats.max_depth_complexity,
        "bands": frame.stats.bands,
        "bytes": frame.stats.bytes,
        # Only GPUs store nodes.
        "node": chosen.get("node format"),
        "lists": reasons.get("lists"),
        "opaque geometry": chosen.get("opaque geometry"),
        "digest": hashlib.sha256(frame.image.tobytes()).hexdigest(),
    }


def measure(variants, repeats):
    """A row a variant, in turns; the first turn makes pipelines and pages, lasts WARM_SECONDS, and is not counted."""
    rows = {v.name: {"name": v.name, "runs": []} for v in variants}
    likes = {v.like or variants[0].name for v in variants}
    references = {}
    for turn in range(repeats + 1):
        for v in variants:
            row = rows[v.name]
            if "error" in row:
                continue
            try:
                start = time.perf_counter()
                frame, wall = render(v.scene, v.options, v.awake)
                while not turn and time.perf_counter() - start < WARM_SECONDS:
                    render(v.scene, v.options, v.awake)
            except (ab.AbufferError, ImportError, MemoryError) as error:
                row["error"] = f"{type(error).__name__}: {error}"
                continue
            if turn:
                row["runs"].append(run_of(frame, wall))
            else:
                row |= facts_of(frame)
                if v.name in likes:
                    references[v.name] = frame
            reference = None if v.like is None else references.get(v.like or variants[0].name)
            if reference is not None and row.get("holds", True):  # a check that failed once has failed
                row["image"], row["holds"] = v.check(frame, reference)
    return summed(rows.values())


def measure_apart(variants, repeats, rounds=3):
    """The same in processes, which take turns: all renders that withhold the same features share one."""
    rows = {v.name: {"name": v.name, "runs": []} for v in variants}
    digests = {v.name: set() for v in variants}
    for _ in range(min(rounds, repeats)):
        for without in dict.fromkeys(v.without for v in variants):
            here = [v for v in variants if v.without == without]
            job = {"renders": [[v.scene, v.options] for v in here], "repeats": -(-repeats // rounds)}
            environment = os.environ | {"ABUFFER_WITHOUT": without}
            command = [sys.executable, __file__]
            out = subprocess.run(command, input=json.dumps(job), env=environment, stdout=subprocess.PIPE, text=True)
            if out.returncode:
                raise RuntimeError(f"measuring without {without or 'withholding anything'} failed: see above")
            for v, found in zip(here, json.loads(out.stdout), strict=True):
                rows[v.name]["runs"] += found.pop("runs")
                rows[v.name] |= found
                digests[v.name].add(found["digest"])
    for v in variants:
        same = digests[v.name] == digests[v.like or v.name] and len(digests[v.name]) == 1
        rows[v.name] |= {"holds": same, "image": "same bits" if same else "another image"}
    return summed(rows.values())


def summed(rows):
    """Rows with medians of their runs."""
    for row in rows:
        runs = row["runs"]
        for name in ("wall", "gpu", *SUMS) if runs else ():
            row[name] = statistics.median(run[name] for run in runs) if runs[0][name] is not None else None
        stages = dict.fromkeys(stage for run in runs for stage in run["stages"])
        row["stages"] = {s: statistics.median(run["stages"].get(s, 0.0) for run in runs) for s in stages}
    return list(rows)


def answer():
    job = json.load(sys.stdin)
    results = []
    for scene, options in job["renders"]:
        runs = []
        for turn in range(job["repeats"] + 1):
            frame, wall = render(tuple(scene), options)
            if turn:
                runs.append(run_of(frame, wall))
        results.append(facts_of(frame) | {"runs": runs})
    json.dump(results, sys.stdout)


if __name__ == "__main__":
    answer()
