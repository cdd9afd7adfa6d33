"""Rows: each method on one scene and one device, its frames in turns with the others'."""

import numbers
import statistics
import time

import numpy as np

from .. import tables
from .._methods import METHODS
from ..errors import AbufferError
from ..renderer import Renderer
from .bounds import Bounds
from .entries import chosen_of
from .metrics import ERRORS, errors

COLUMNS = (
    "label",
    "method",
    "pipeline",
    "parameters",
    "curve",
    "device",
    "scene",
    "gpu_ms",
    "gpu_ms_q1",
    "gpu_ms_q3",
    "wall_ms",
    "wall_ms_q1",
    "wall_ms_q3",
    "stage_ms",
    "frames",
    "bytes_per_pixel",
    "passes",
    *ERRORS,
    "fragments",
    "depth_complexity",
    "merged",
    "dropped",
    "deterministic",
    "error_bound",
    "failure",
)
# The method and the pipeline of rows that another renderer made.
OTHER = "other"
# Frames that are compared bit by bit.
SAME = 3
# Stages of a GPU's frame in which the host works or waits.
OF_HOST = ("upload", "wait and readback")
# Frames that count, where nobody says how many.
FRAMES_ON_GPU, FRAMES_ON_CPU = 30, 5
# Of a fragment where a format is asked for (src/node_format.rs); else what was published, 12 and a pointer.
NODE_BYTES = {
    "float32": 28,
    "rgba8_depth32": 12,
    "rgba8_depth24_coverage8": 12,
    "rgb565_depth16": 8,
    "rgb9e5_alpha8_depth24": 12,
}
# Seconds of a row's frames, after which it has no more than SAME of them: peelings of hundreds of layers take one each.
MOST_SECONDS = 10.0


def gpu_ms(stats) -> float:
    """GPU time of a frame; of one in several submissions, that of its stages."""
    if stats.device == "cpu":
        return float("nan")
    if stats.gpu_ms is not None:
        return stats.gpu_ms
    return sum(ms for stage, ms in stats.ms.items() if stage not in OF_HOST)


def device_name(device) -> str:
    """As `devices()` has it: "cpu", or a GPU's."""
    return tables.named(device)


def is_real_gpu(device) -> bool:
    return tables.devices()[tables.named(device)]["kind"] not in ("processor", "software")


def measured(subject, device, entries, size, reference, lists, frames, step):
    """The rows of all entries, and their images by label.

    Args:
        reference: (H, W, 4), what images should be.
        lists: the exact frame, with counts.
        frames: how many are timed, and how many warm up.
        step: is told what is done before each entry, and each turn.
    """
    repeats, warmup = frames
    renderer = Renderer(device)
    uploaded = renderer.upload(subject.scene)
    arguments = {"width": size[0], "height": size[1], "background": subject.background}
    rows, images, turns, bounds = {}, {}, {}, Bounds(subject, size)
    for entry in entries:
        step(f"{subject.name}: {entry.label}")
        own = arguments | {"method": entry.method, "pipeline": entry.pipeline} | entry.parameters
        try:
            frames = _warmed(lambda own=own: renderer.render(uploaded, subject.camera, **own), warmup)
        except _failures(entry) as e:
            rows[entry.label] = _failed(entry, subject, device, e)
            continue
        rows[entry.label] = _row(entry, subject, frames, reference, lists, bounds)
        images[entry.label] = frames[0].image
        turns[entry.label] = (entry, own, [])
    for turn in range(repeats):
        step(f"{subject.name}: turn {turn + 1} of {repeats}")
        for entry, own, times in list(turns.values()):
            if len(times) >= SAME and sum(wall for wall, *_ in times) > MOST_SECONDS * 1e3:
                continue
            start = time.perf_counter()
            try:
                frame = renderer.render(uploaded, subject.camera, **own)
            except _failures(entry) as e:
                rows[entry.label] = _failed(entry, subject, device, e)
                del turns[entry.label], images[entry.label]
                continue
            times.append(((time.perf_counter() - start) * 1e3, gpu_ms(frame.stats), frame.stats.ms))
    for label, (*_, times) in turns.items():
        rows[label] |= _times(times)
    return [{column: row[column] for column in COLUMNS} for row in rows.values()], images


def _nothing():
    """A row that says nothing."""
    return dict.fromkeys(COLUMNS, float("nan")) | {"stage_ms": {}, "deterministic": None, "failure": ""}


def row_of_image(label, scene, device, image, reference, exact, ms):
    """The row of what another renderer made of a scene, in so many milliseconds a frame."""
    names = {"label": label, "method": OTHER, "pipeline": OTHER, "parameters": {}, "curve": None}
    wall = _quartiles("wall_ms", ms) if len(ms) else {}
    facts = {"fragments": exact.stats.fragments, "depth_complexity": exact.stats.max_depth_complexity}
    where = {"device": device, "scene": scene, "frames": len(ms)}
    return _nothing() | names | where | wall | facts | errors(image, reference, exact.counts > 0)


def _failures(entry):
    """What a row may fail by; of a method whose function is a user's, whatever that raises."""
    return AbufferError if METHODS[entry.method].numpy is None else Exception


def _warmed(render_once, warmup):
    """The first frames, SAME at least."""
    start, frames = time.perf_counter(), []
    while len(frames) < SAME or (len(frames) < warmup and time.perf_counter() - start < MOST_SECONDS):
        frames.append(render_once())
    return frames


def _row(entry, subject, frames, reference, lists, bounds):
    frame = frames[0]
    stats = frame.stats
    images = [other.image.tobytes() for other in frames[:SAME]]
    own = chosen_of(entry.method, entry.parameters)
    return _named(entry, subject, stats.device) | {
        "bytes_per_pixel": bytes_per_pixel(own, entry, lists),
        "passes": passes(own, entry, lists),
        "fragments": lists.stats.fragments,
        "depth_complexity": lists.stats.max_depth_complexity,
        "merged": stats.merged_fragments,
        "dropped": stats.dropped_fragments,
        "deterministic": len(set(images)) == 1,
        "error_bound": bounds.proven(entry),
        "failure": "",
        **errors(frame.image, reference, lists.counts > 0),
    }


def _named(entry, subject, device):
    return {
        "label": entry.label,
        "method": entry.method,
        "pipeline": entry.pipeline,
        "parameters": dict(entry.parameters),
        "curve": entry.curve,
        "device": device,
        "scene": subject.name,
    }


def _failed(entry, subject, device, error):
    """A row of what a device cannot do: no row is left out."""
    failed = {"failure": str(error) or repr(error)}
    return _nothing() | failed | _named(entry, subject, device_name(device))


def _times(times):
    """Medians and quartiles of turns."""
    wall, gpu, stages = zip(*times, strict=True)
    columns = {}
    for name, values in (("wall_ms", wall), ("gpu_ms", gpu)):
        columns |= _quartiles(name, values)
    names = dict.fromkeys(name for each in stages for name in each)
    medians = {name: statistics.median(each.get(name, 0.0) for each in stages) for name in names}
    return columns | {"stage_ms": medians, "frames": len(times)}


def _quartiles(name, values):
    """Columns of a time."""
    found = map(float, np.quantile(values, (0.25, 0.5, 0.75)))
    return dict(zip((f"{name}_q1", name, f"{name}_q3"), found, strict=True))


def bytes_per_pixel(own, entry, lists) -> float:
    """What the published form keeps of a pixel. NaN of a registered method that does not say.

    Exact lists: heads and nodes of linked lists (METHODS 1.1), or what count, scan and scatter keep (1.2), of as many fragments as
    a pixel has on average; in tiles none are kept.
    """
    if own.method.id == "exact":
        mean = lists.stats.fragments / lists.counts.size
        node = NODE_BYTES.get(entry.parameters.get("node_format"))
        return {
            "tiles": 0.0,
            "linked_list": 4 + (node or 16) * mean,
            "prefix_sum": 8 + (node or 12) * mean,
        }[entry.pipeline]
    said = own.method.bytes_per_pixel(**own.parameters)
    if not isinstance(said, numbers.Real):
        return float("nan")
    # Sums and moments take half in half floats; draws of stochastic transparency are published in 8 bits and a depth.
    is_half = entry.parameters.get("targets") == "float16" and own.method.id != "stochastic"
    return float(said) / (2 if is_half else 1)


def passes(own, entry, lists) -> int:
    """Over the geometry, of a scene as deep as this one."""
    deepest = lists.stats.max_depth_complexity or 0
    usual = own.method.passes(**own.parameters)
    if own.method.id == "depth_peeling":
        return min(own.parameters["layers"] or deepest + 1, deepest + 1)
    if own.method.id == "dual_depth_peeling":
        return -(-deepest // 2) + 1
    return 2 if entry.pipeline == "prefix_sum" else int(usual)
