"""The time that no renderer can beat: what must move once, at the bandwidth at which this device copies.

What must move: the geometry as given (positions, faces and colours), read once, and the image, width × height × 16
bytes, written once. Bins, lists and what is fetched again are not in it: they are what a renderer may save. Bandwidth
counts the bytes that a copy reads and those that it writes.
"""

import os
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np

import abuffer as ab

COPIED = 256 << 20  # bytes: more than caches hold
COPIES = 9


def least_bytes(meshes, width, height):
    """What must move at least, in bytes."""
    arrays = [a for m in ab.Scene([meshes]).meshes for a in (m.positions, m.faces, m.colors) if a is not None]
    return sum(a.nbytes for a in arrays) + width * height * 4 * 4


def copy_bandwidth(device):
    """Bytes a second of a device's copies, best of several, and None; or None, and why it is not known.

    Args:
        device: a name of `abuffer.devices()`.
    """
    kind = ab.devices()[device]["kind"]
    return (_of_memory(), None) if kind in ("processor", "software") else _of_gpu(device)


def _of_memory():
    """Of numpy, in a thread a core, which it does without the interpreter's lock."""
    threads = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    source, target = (np.full(COPIED // 8, value, np.int64) for value in (1, 0))  # touched, so that pages are there
    parts = [(np.array_split(target, threads)[i], np.array_split(source, threads)[i]) for i in range(threads)]
    seconds = []
    with ThreadPoolExecutor(threads) as pool:
        for _ in range(COPIES):
            start = time.perf_counter()
            list(pool.map(lambda pair: np.copyto(*pair), parts))
            seconds.append(time.perf_counter() - start)
    return 2 * source.nbytes / min(seconds)


def _of_gpu(device):
    """Of torch, by CUDA events. Nothing here copies on a GPU: without torch it is not known."""
    try:
        import torch
    except ImportError:
        return None, "torch, which would measure the bandwidth of copies, is not installed"
    names = [torch.cuda.get_device_name(i) for i in range(torch.cuda.device_count())]
    index = next((i for i, name in enumerate(names) if name in device or device in name), None)
    if index is None:
        return None, f"torch, which would measure the bandwidth of copies, finds no {device}: {names or 'no GPU'}"
    with torch.cuda.device(index):
        source = torch.ones(4 * COPIED // 4, dtype=torch.float32, device="cuda")  # GPUs cache some 50 MiB
        target = torch.empty_like(source)
        times = []
        for _ in range(COPIES):
            begin, end = (torch.cuda.Event(enable_timing=True) for _ in range(2))
            begin.record()
            target.copy_(source)
            end.record()
            torch.cuda.synchronize()
            times.append(begin.elapsed_time(end) / 1e3)
    return 2 * source.numel() * 4 / min(times), None
