"""Draws one scene with pyrender: `python pyrender_worker.py scene.npz image.npz`.

Runs in the environment of `pyrender_env.py`, which writes the scene file and says what is in it.
The image file holds `color`, shape (height, width, 4), uint8, top row first.
"""

import sys

import numpy as np
import pyrender
from OpenGL.GL import glRenderbufferStorage

FLAGS = pyrender.RenderFlags.FLAT | pyrender.RenderFlags.RGBA | pyrender.RenderFlags.SKIP_CULL_FACES


class InsertionOrder(dict):
    """Stands in for the set of a scene's mesh nodes, but is iterated in the order of adding.

    pyrender sorts the nodes by distance with a stable sort. It keeps them in a `set`, so equally
    far ones are drawn in the order of their addresses, which changes from run to run
    (PYTHONHASHSEED has no say in it).
    """

    def add(self, node):
        self[node] = None


def one_sample(target, samples, *format_and_size):
    """Stands in for `glRenderbufferStorageMultisample`: the same buffer with one sample.

    pyrender always draws with 4 samples per pixel and has no option against it. What it is
    compared with samples each pixel once, at its centre, so every silhouette would differ.
    """
    glRenderbufferStorage(target, *format_and_size)


def build_scene(data):
    """The pyrender scene described by the arrays of a scene file."""
    scene = pyrender.Scene(bg_color=data["background"])
    scene._mesh_nodes = InsertionOrder()
    for i in range(int(data["mesh_count"])):
        material = pyrender.MetallicRoughnessMaterial(
            baseColorFactor=data[f"rgba_{i}"], alphaMode="BLEND", doubleSided=True
        )
        primitive = pyrender.Primitive(
            positions=data[f"positions_{i}"],
            indices=data[f"faces_{i}"],
            material=material,
            mode=pyrender.GLTF.TRIANGLES,
        )
        scene.add(pyrender.Mesh([primitive]), pose=data[f"pose_{i}"])

    zfar = float(data["zfar"])
    camera = pyrender.PerspectiveCamera(
        yfov=float(data["yfov"]),
        znear=float(data["znear"]),
        zfar=None if np.isinf(zfar) else zfar,
    )
    scene.add(camera, pose=data["camera_pose"])
    return scene


def main(scene_file, image_file):
    """Read the scene, draw it, write the image."""
    pyrender.renderer.glRenderbufferStorageMultisample = one_sample
    with np.load(scene_file) as data:
        scene = build_scene(data)
        width, height = (int(n) for n in data["size"])
    renderer = pyrender.OffscreenRenderer(width, height)
    try:
        color, _depth = renderer.render(scene, flags=FLAGS)
    finally:
        renderer.delete()
    np.savez(image_file, color=color)


if __name__ == "__main__":
    main(*sys.argv[1:])
