"""Draws a scene with one peer, in that peer's environment: `worker.py PEER.py VARIANT REPEATS scene.npz drawn.npz`.

A peer is a file with a function `prepared(scene, variant)`, which uploads what there is to upload and returns a dict of

- `frame`: a function without arguments that draws, and returns the image in numpy, (H, W, 3|4), row 0 on top; floats,
  or uint8, which are of 255;
- `srgb`: whether its colours are sRGB-encoded;
- `version`, `device`: text;
- `notes`: text: what could not be turned off, and what had to be patched. "" is nothing.

`../peers_protocol.py` writes the scene and reads what was drawn, and says what is in either.
"""

import dataclasses
import importlib.util
import os
import resource
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

# Frames that are not counted. The first compiles shaders, and its memory is new to the process.
WARM_UP = 2
# Seconds after which no further frame is begun: what is that slow is told from fewer.
ENOUGH = 60
# Share of the machine's memory that a peer may have: what wants more fails, and nothing else does.
MEMORY = 0.3


@dataclass(frozen=True)
class Mesh:
    positions: np.ndarray  # (N, 3) float32, world
    faces: np.ndarray  # (M, 3) uint32
    colors: np.ndarray  # (N, 4) float32, straight, linear
    opaque: bool
    origin: np.ndarray  # (3,), by which a renderer that sorts objects may sort this one


@dataclass(frozen=True)
class Scene:
    width: int
    height: int
    background: np.ndarray  # (3,), linear
    view: np.ndarray  # (4, 4), world to eye, M @ column; the eye looks along −Z with Y up
    projection: np.ndarray  # (4, 4), eye to clip, z from −w at near to w at far
    near: float
    far: float
    is_perspective: bool
    meshes: list

    @property
    def pose(self):
        """Eye to world, (4, 4)."""
        return np.linalg.inv(self.view)

    def white(self):
        """What shows which pixels are covered: all surfaces white and opaque, before black."""
        meshes = [dataclasses.replace(mesh, colors=np.ones_like(mesh.colors), opaque=True) for mesh in self.meshes]
        return dataclasses.replace(self, background=np.zeros(3), meshes=meshes)


def loaded(path):
    """The Scene of a file."""
    with np.load(path) as data:
        width, height = map(int, data["size"])
        meshes = [
            Mesh(
                data[f"positions_{i}"],
                data[f"faces_{i}"],
                data[f"colors_{i}"],
                bool(data[f"opaque_{i}"]),
                data[f"origin_{i}"],
            )
            for i in range(int(data["mesh_count"]))
        ]
        near, far = map(float, data["range"])
        names = ("background", "view", "projection")
        arrays = {name: data[name] for name in names}
        is_perspective = bool(arrays["projection"][3, 3] == 0)
        return Scene(width, height, **arrays, near=near, far=far, is_perspective=is_perspective, meshes=meshes)


def module_of(path):
    """A peer's module, under a name that is not that of the package it draws with."""
    spec = importlib.util.spec_from_file_location(f"peer_{Path(path).stem}", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def main(peer, variant, repeats, scene_file, drawn_file):
    memory = int(MEMORY * os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    scene, peer = loaded(scene_file), module_of(peer)
    found = peer.prepared(scene, variant)
    ms, begun = [], time.perf_counter()
    for turn in range(-WARM_UP, int(repeats)):
        start = time.perf_counter()
        is_late = start - begun > ENOUGH
        if is_late and ms:
            break
        image = found["frame"]()
        if turn >= 0 or is_late:
            ms.append((time.perf_counter() - start) * 1e3)
    image = np.array(image)  # before another scene may overwrite it
    white = peer.prepared(scene.white(), variant)["frame"]()
    said = {name: found[name] for name in ("srgb", "version", "device", "notes")}
    np.savez(drawn_file, image=image, white=white, ms=ms, **said)


if __name__ == "__main__":
    main(*sys.argv[1:])
