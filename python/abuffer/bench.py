"""Times `tiles` and `linked_list` against each other on one device, in turns: what the planner chooses by."""

import statistics
import time

import numpy as np

from . import tables
from .camera import Camera
from .errors import AbufferError, ParameterError
from .measured import CASES
from .mesh import Mesh
from .renderer import Renderer

WIDTH, HEIGHT = 1280, 720
# Triangles, and half their size in pixels.
SCENES = {"few": (200, 400), "many": (200_000, 6)}
ARGUMENTS = {"image": {}, "lists": {"fragments": True}, "samples": {"samples": 4}, "stored": {}}


def triangles(name, blend="over", seed=0) -> Mesh:
    """Random triangles of SCENES: centres uniform over the image, corners and depths uniform, flat colours."""
    count, size = SCENES[name]
    rng = np.random.default_rng(seed)
    corners = rng.uniform(0, 1, (count, 1, 2)) * (WIDTH, HEIGHT) + rng.uniform(-size, size, (count, 3, 2))
    depths = -rng.uniform(0, 1, (count, 3, 1))
    positions = np.concatenate([corners - (WIDTH / 2, HEIGHT / 2), depths], axis=-1).astype(np.float32)
    colors = np.concatenate([rng.uniform(0, 1, (count, 3)), np.full((count, 1), 0.3)], axis=1)
    return Mesh(positions, colors=colors.astype(np.float32), color_mode="face", blend=blend)


def compare(device="gpu", repeats=9):
    """Yields a dict a case and scene: medians of wall milliseconds of both pipelines, and the median of their ratios.

    Args:
        device: as in `render`, of a GPU.
        repeats: renders of each that count; two more come first, which make pipelines and buffers.

    Raises:
        DeviceError, ParameterError: no such device, or the CPU, which has no `linked_list`.
    """
    if tables.choose("auto", device, "float32", None, [])[0] is None:
        raise ParameterError(f"bench compares pipelines of a GPU, and device {device!r} is the CPU here")
    renderer = Renderer(device)
    camera = Camera.orthographic((0, 0, 0), (0, 0, -1), height=HEIGHT)
    for case in CASES:
        for scene in SCENES:
            uploaded = renderer.upload(triangles(scene, "additive" if case == "stored" else "over"))
            arguments = {"width": WIDTH, "height": HEIGHT} | ARGUMENTS[case]
            row = {"case": case, "scene": scene}
            times = {"tiles": [], "linked_list": []}
            try:
                for turn in range(-2, repeats):
                    for pipeline, own in times.items():
                        start = time.perf_counter()
                        frame = renderer.render(uploaded, camera, pipeline=pipeline, **arguments)
                        if turn >= 0:
                            own.append((time.perf_counter() - start) * 1e3)
            except AbufferError as e:
                yield row | {"error": str(e)}
                continue
            ratio = statistics.median(a / b for a, b in zip(*times.values(), strict=True))
            medians = {f"{pipeline}_ms": statistics.median(own) for pipeline, own in times.items()}
            yield row | medians | {"ratio": ratio, "device": frame.stats.device}


def constants(rows) -> dict:
    """The entry of `measured.TILES_TO_LINKED_LIST` that rows of `compare` make. A case that failed is 1: as before."""
    rows = list(rows)
    entry = {"device": next((row["device"] for row in rows if "device" in row), "")}
    for row in rows:
        entry.setdefault(row["case"], {})[row["scene"]] = float(f"{row.get('ratio', 1.0):.2g}")
    return entry
