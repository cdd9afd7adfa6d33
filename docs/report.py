"""Writes report.png, a picture of the page that `Comparison.report` makes: `python docs/report.py`.

It needs Chromium, and `pip install 'abuffer[compare,trimesh]'`.
"""

import shutil
import subprocess
import tempfile
from pathlib import Path

import trimesh

import abuffer as ab

PICTURE = Path(__file__).with_suffix(".png")
WIDTH, HEIGHT = 1280, 2020  # pixels, of the whole page
METHODS = [
    "exact", "depth_peeling", "hybrid", "adaptive", "wavelet", "fourier", "mboit", "phenomenological", "triangle_sorted", "wboit",
]  # fmt: skip


def compared():
    """Three translucent solids in each other, and an opaque rod through them; of the methods `wboit` is the most off."""
    scene = ab.Scene()
    scene.add(trimesh.creation.box((1.9, 1.9, 1.9)), color=(0.95, 0.6, 0.2), alpha=0.4, shade=True)
    scene.add(trimesh.creation.icosphere(subdivisions=4, radius=1.2), color=(0.2, 0.5, 0.9), alpha=0.4, shade=True)
    scene.add(trimesh.creation.torus(1.5, 0.35), color=(0.2, 0.75, 0.35), alpha=0.55, shade=True)
    scene.add(trimesh.creation.cylinder(radius=0.2, height=4.4), color=(0.9, 0.9, 0.9), opaque=True, shade=True)
    return ab.compare(
        {"solids": scene},
        ab.Camera.fit(scene, azimuth=35, elevation=24),
        width=320,
        height=240,
        background=(1, 1, 1),
        methods=METHODS,
        sweep={"mlab": {"k": [2, 4, 8]}, "k_buffer": {"k": [4, 8]}},
        devices=["cpu"],
        repeats=9,
    )


def main():
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder, "report.html")
        compared().report(page)
        flags = ["--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--virtual-time-budget=5000"]
        flags += [f"--user-data-dir={folder}/profile", f"--window-size={WIDTH},{HEIGHT}", f"--screenshot={PICTURE}"]
        subprocess.run([shutil.which("chromium"), *flags, page.as_uri()], check=True, capture_output=True)


if __name__ == "__main__":
    main()
