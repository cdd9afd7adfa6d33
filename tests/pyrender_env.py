"""pyrender as a peer to compare with, kept in an environment of its own.

pyrender asks for `PyOpenGL==3.1.0` and other old packages that do not belong beside the ones
under test. So it lives in a virtual environment below `.cache/`, made on first use, and draws in
a subprocess (`pyrender_worker.py`). It needs EGL, on Debian and Ubuntu from
`libegl1 libegl-mesa0 libgl1-mesa-dri`.
"""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ENVIRONMENT = Path(__file__).resolve().parent.parent / ".cache" / "pyrender-env"
WORKER = Path(__file__).with_name("pyrender_worker.py")

# PyOpenGL 3.1.0 has no wheel; these build it.
BUILD_PINS = ("setuptools==75.8.0", "wheel==0.45.1")

# Everything that `import pyrender` loads, installed without dependency resolution. pyrender also
# declares scipy, but never imports it. The set installs on Python 3.10 to 3.13.
PINS = (
    "pyrender==0.1.45",
    "PyOpenGL==3.1.0",
    "freetype-py==2.5.1",
    "imageio==2.36.1",
    "networkx==3.4.2",
    "numpy==2.2.6",
    "pillow==11.3.0",
    "pyglet==2.0.20",
    "six==1.17.0",
    "trimesh==4.6.13",
)


def python_with_pyrender() -> Path:
    """Path of a Python that can import pyrender; makes its environment if there is none yet.

    The stamp is written last and holds all that the environment depends on. One that was left
    half-made, or made from other pins or by another Python, is thus thrown away and made again.
    A lock keeps parallel test processes from making it twice; pip and venv inherit it, so that
    it also holds while one of them outlives a killed test process.
    """
    python = ENVIRONMENT / "bin" / "python"
    stamp = ENVIRONMENT / "stamp.json"
    wanted = json.dumps([sys.version_info[:2], BUILD_PINS, PINS])

    ENVIRONMENT.parent.mkdir(parents=True, exist_ok=True)
    with open(ENVIRONMENT.with_suffix(".lock"), "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        os.set_inheritable(lock.fileno(), True)
        if python.exists() and stamp.exists() and stamp.read_text() == wanted:
            return python
        if ENVIRONMENT.exists():
            shutil.rmtree(ENVIRONMENT)
        pip = [python, "-I", "-m", "pip", "--disable-pip-version-check", "install", "--no-deps"]
        _run([sys.executable, "-I", "-m", "venv", ENVIRONMENT], timeout=300)
        _run([*pip, *BUILD_PINS], timeout=600)
        _run([*pip, "--no-build-isolation", *PINS], timeout=600)
        stamp.write_text(wanted)
    return python


def render(scene: dict, width: int, height: int, timeout: float = 120.0) -> np.ndarray:
    """Draw `scene` with pyrender: an image of shape `(height, width, 4)`, uint8, top row first.

    `scene` is a dict of

    - `meshes`: a list of dicts with `positions` (N, 3), `faces` (M, 3), one straight `rgba` (4,)
      in 0..1, and optionally `pose` (4, 4), object to world. pyrender draws the meshes with
      alpha < 1 after the others, each group by decreasing distance of the *pose's origin* from
      the camera, equally far ones in list order.
    - `camera`: a dict with `pose` (4, 4), camera to world with OpenGL's axes (looks along -z,
      +y up), `yfov` in radians, `znear`, and optionally `zfar` (absent or None: infinity).
    - `background`: straight rgba (4,) in 0..1.

    Unlit, both sides of each face, one sample per pixel, blended as stored (no gamma). Compare
    the colour only: pyrender blends alpha by its own value too (0.5 over 1 gives 0.75), so the
    image's alpha is not the one of `over`.

    Raises RuntimeError with the worker's stderr if drawing fails or takes over `timeout` seconds.
    """
    python = python_with_pyrender()
    camera = scene["camera"]
    zfar = camera.get("zfar")
    arrays = {
        "size": np.array([width, height]),
        "background": np.asarray(scene["background"], dtype=np.float64),
        "mesh_count": np.array(len(scene["meshes"])),
        "camera_pose": np.asarray(camera["pose"], dtype=np.float64),
        "yfov": np.array(float(camera["yfov"])),
        "znear": np.array(float(camera["znear"])),
        "zfar": np.array(np.inf if zfar is None else float(zfar)),
    }
    for i, mesh in enumerate(scene["meshes"]):
        arrays[f"positions_{i}"] = np.asarray(mesh["positions"], dtype=np.float32)
        arrays[f"faces_{i}"] = np.asarray(mesh["faces"], dtype=np.uint32)
        arrays[f"rgba_{i}"] = np.asarray(mesh["rgba"], dtype=np.float64)
        arrays[f"pose_{i}"] = np.asarray(mesh.get("pose", np.eye(4)), dtype=np.float64)

    with tempfile.TemporaryDirectory() as folder:
        scene_file, image_file = Path(folder, "scene.npz"), Path(folder, "image.npz")
        np.savez(scene_file, **arrays)
        _run([python, "-I", WORKER, scene_file, image_file], timeout, PYOPENGL_PLATFORM="egl")
        with np.load(image_file) as result:
            return result["color"]


def _run(command: list, timeout: float, **variables: str) -> None:
    """Run `command` with extra environment variables; RuntimeError with its stderr on failure.

    The Pythons run with `-I`, so that a PYTHONPATH meant for the tests does not reach them.
    """
    shown = " ".join(map(str, command))
    try:
        result = subprocess.run(
            command,
            env={**os.environ, **variables},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=timeout,
            close_fds=False,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        stderr = (error.stderr or b"").decode(errors="replace")
        raise RuntimeError(f"{shown}: not done after {timeout} s\n{stderr}") from error
    if result.returncode != 0:
        stderr = result.stderr.decode(errors="replace")
        raise RuntimeError(f"{shown}: exit status {result.returncode}\n{stderr}")
