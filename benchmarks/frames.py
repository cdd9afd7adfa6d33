"""What a frame takes as a user has it: the first of a process, with lists, of an uploaded scene, of many cameras.

    python benchmarks/frames.py [--device gpu] [--repeats 12] [--scene "20k of ~20 px"] [--markdown out.md]

GPU time is `stats.gpu_ms`: of the image alone, with counts, and with lists (`fragments=True`), whose ratio to the first is
of frames that the host waits for, so that a device whose clock falls meanwhile slows all of them. Wall times are of
`ab.render`, which uploads each time, `Renderer.render` and `Renderer.render_many`. Medians, but of `render_many` the mean.
"""

import argparse
import statistics
import subprocess
import sys
import time
from pathlib import Path

from report import lines_of

import abuffer as ab
from scenes import SIX, random_triangles

FIRST = """
import time
import abuffer as ab
import numpy as np
start = time.perf_counter()
ab.devices()
found = time.perf_counter()
count, size = %r
rng = np.random.default_rng(0)
triangles = rng.uniform(-1, 1, (count, 1, 3)) + rng.uniform(-size, size, (count, 3, 3))
mesh, camera = ab.Mesh(triangles, colors=(0.5, 0.3, 0.2, 0.1)), ab.Camera.look_at((0, 0, 5), (0, 0, 0))
made = time.perf_counter()
frame = ab.render(mesh, camera, width=1280, height=720, device=%r)
print(found - start, time.perf_counter() - made)
"""


# How many triangles, and their size where the image is some 4 wide. A deep pixel needs other pipelines.
FIRST_SCENES = {"20,000 small triangles, 6 deep at most": (20_000, 0.02), "1,000 large ones, 92 deep": (1000, 1.0)}


def first_render(scene, device):
    """Seconds to find devices and then to render, in a process of its own, after importing."""
    script = FIRST % (scene, device)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return [float(seconds) for seconds in done.stdout.split()]


def row(name, renderer, repeats):
    mesh, camera, width, height = random_triangles(name, table=SIX)
    arguments = {"width": width, "height": height, "pipeline": "tiles", "memory": "16GiB"}
    uploaded = renderer.upload(mesh)

    def taken(render, **more):
        """Medians of GPU and wall milliseconds. The first frames make pipelines and room, and do not count."""
        gpu, wall = [], []
        for turn in range(-3, repeats):
            start = time.perf_counter()
            frame = render(**arguments, **more)
            if turn >= 0:
                wall.append((time.perf_counter() - start) * 1e3)
                gpu.append(frame.stats.gpu_ms)
        return statistics.median(gpu) if None not in gpu else None, statistics.median(wall)

    def uploaded_render(**more):
        return renderer.render(uploaded, camera, **more)

    cells = {"scene": name}
    gpu = {}
    for kind, more in {"image": {}, "counts": {"fragments": "count"}, "lists": {"fragments": True}}.items():
        gpu[kind], cells[f"{kind}, wall ms"] = taken(uploaded_render, **more)
    cells["lists ÷ image, GPU"] = gpu["lists"] / gpu["image"] if None not in gpu.values() else None
    start = time.perf_counter()
    count = sum(1 for _ in renderer.render_many(uploaded, [camera] * 3 * repeats, **arguments))
    cells["render_many, wall ms"] = (time.perf_counter() - start) * 1e3 / count
    cells["ab.render, wall ms"] = taken(lambda **more: ab.render(mesh, camera, device=renderer.device, **more))[1]
    return cells


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="gpu")
    parser.add_argument("--repeats", type=int, default=12)
    parser.add_argument("--scene", action="append", choices=list(SIX), help="one of the scenes; all by default")
    parser.add_argument("--markdown", type=Path)
    args = parser.parse_args()
    text = []
    for name, scene in FIRST_SCENES.items():
        for turn in ("first", "second"):
            found, rendered = first_render(scene, args.device)
            text.append(
                f"{name}, {turn} process: devices in {found:.3f} s, then the first render in {rendered:.3f} s.  "
            )
    renderer = ab.Renderer(args.device)
    rows = [row(name, renderer, args.repeats) for name in args.scene or SIX]
    said = [["" if v is None else v if isinstance(v, str) else f"{v:.3g}" for v in r.values()] for r in rows]
    text += ["", *lines_of(list(rows[0]), said)]
    print("\n".join(text))
    if args.markdown:
        args.markdown.write_text("\n".join(text) + "\n")


if __name__ == "__main__":
    main()
