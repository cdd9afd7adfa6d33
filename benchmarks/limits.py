"""What an installation and a render may cost: import time, wheel size, and peak memory of an image-only CPU render.

    python benchmarks/limits.py [--wheel target/wheels/abuffer-….whl]

The peak is the growth of a process that already holds the scene's arrays (Linux). Its limit is three images, the
geometry as given, 64 MiB, and what `stats.bytes` reports of setup and bins.
"""

import argparse
import statistics
import subprocess
import sys
from pathlib import Path

import abuffer as ab
import scenes

MIB = 1 << 20


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--wheel", type=Path)
    arguments = parser.parse_args()
    print(f"import abuffer, numpy included: {import_seconds():.3f} s (limit 0.3)")
    if arguments.wheel:
        print(f"wheel: {arguments.wheel.stat().st_size / 1e6:.1f} MB (limit 10)")
    print("scene\tpeak growth MiB\tlimit MiB")
    for name in scenes.RANDOM:
        # A process each: a high-water mark does not come down.
        out = subprocess.run([sys.executable, __file__, "peak", name], capture_output=True, text=True, check=True)
        print(f"{name}\t{out.stdout.strip()}")


def import_seconds():
    script = "import time; start = time.perf_counter(); import abuffer; print(time.perf_counter() - start)"
    runs = [subprocess.run([sys.executable, "-c", script], capture_output=True, text=True) for _ in range(7)]
    return statistics.median(float(run.stdout) for run in runs)


def peak(name):
    mesh, camera, width, height = scenes.random_triangles(name)
    Path("/proc/self/clear_refs").write_text("5")  # the high-water mark starts over
    before = resident("VmHWM")
    frame = ab.render(mesh, camera, width=width, height=height, device="cpu")
    grown = resident("VmHWM") - before
    given = mesh.positions.nbytes + mesh.colors.nbytes
    reported = frame.stats.bytes["setup"] + frame.stats.bytes["bins"]
    limit = 3 * width * height * 16 + given + 64 * MIB + reported
    print(f"{grown / MIB:.1f}\t{limit / MIB:.1f}")


def resident(field):
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(field))


if __name__ == "__main__":
    if sys.argv[1:2] == ["peak"]:
        peak(sys.argv[2])
    else:
        main()
