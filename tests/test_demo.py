"""The demo draws what the README shows, whatever order the faces come in."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

DEMO = Path(__file__).parents[1] / "examples" / "demo.py"
WIDTH, HEIGHT = 160, 90


@pytest.fixture(scope="module")
def render(tmp_path_factory):
    pytest.importorskip("trimesh")
    if importlib.util.find_spec("pymeshfix") is None:
        pytest.skip("the bunny comes with pymeshfix")

    def run(seed):
        path = tmp_path_factory.mktemp("demo") / "made" / "picture.png"  # a directory that is not there yet
        command = [sys.executable, "-W", "error", DEMO, "--output", path, "--seed", str(seed)]
        command += ["--width", str(WIDTH), "--height", str(HEIGHT)]
        done = subprocess.run(command, capture_output=True, text=True, encoding="utf-8")
        assert (done.returncode, done.stderr) == (0, "")
        assert str(path) in done.stdout
        assert "in a pixel" in done.stdout  # the depth complexity
        return path

    return run


@pytest.fixture(scope="module")
def picture(render):
    return render(0)


def test_translucent_parts_overlap(picture):
    image = pytest.importorskip("PIL.Image").open(picture)
    assert image.size == (WIDTH, HEIGHT)
    pixels = np.asarray(image.convert("RGB"), dtype=int)
    blue, red, both = pixels[50, 25], pixels[36, 82], pixels[42, 60]
    assert blue[2] > blue[1] > blue[0]
    assert red[0] > max(red[1:]) + 40
    assert both[0] < red[0]  # the blue one is seen through the red one
    assert both[2] < blue[2]
    assert min(both[0], both[2]) > both[1] + 20
    ring = pixels[64, 53]  # in front of all bunnies: no tint
    assert ring.max() - ring.min() < 15
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 1000


def test_the_order_of_faces_and_meshes_does_not_matter(picture, render):
    assert picture.read_bytes() == render(1).read_bytes()
