"""pyrender: blends objects by decreasing distance of their nodes' origins, with depth writes left on.

Unlit, both sides of each face, one sample a pixel, blended as stored (no gamma). Its alpha is not that of `over`: it is
blended by its own value too (0.5 over 1 gives 0.75).
"""

import os
from importlib.metadata import version

os.environ["PYOPENGL_PLATFORM"] = "egl"

import numpy as np
import pyrender
from OpenGL.GL import GL_RENDERER, glGetString, glRenderbufferStorage

FLAGS = pyrender.RenderFlags.FLAT | pyrender.RenderFlags.RGBA | pyrender.RenderFlags.SKIP_CULL_FACES
NOTES = "patched to one sample a pixel (it has 4, without an option), and to draw equally far objects in a fixed order"


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


class Given(pyrender.Camera):
    """A camera of any projection."""

    def __init__(self, projection):
        super().__init__()
        self.projection = projection

    def get_projection_matrix(self, width=None, height=None):
        return self.projection


def prepared(scene, variant):
    pyrender.renderer.glRenderbufferStorageMultisample = one_sample
    theirs = pyrender.Scene(bg_color=[*scene.background, 1.0])
    theirs._mesh_nodes = InsertionOrder()
    for mesh in scene.meshes:
        material = pyrender.MetallicRoughnessMaterial(
            baseColorFactor=(1.0, 1.0, 1.0, 1.0), alphaMode="OPAQUE" if mesh.opaque else "BLEND", doubleSided=True
        )
        pose = np.eye(4)
        pose[:3, 3] = mesh.origin
        colors = mesh.colors.copy()
        if mesh.opaque:
            colors[:, 3] = 1  # it takes any other alpha for translucent
        primitive = pyrender.Primitive(
            positions=np.float32(mesh.positions - mesh.origin),
            indices=mesh.faces,
            color_0=colors,
            material=material,
            mode=pyrender.GLTF.TRIANGLES,
        )
        theirs.add(pyrender.Mesh([primitive]), pose=pose)
    theirs.add(Given(scene.projection), pose=scene.pose)
    renderer = pyrender.OffscreenRenderer(scene.width, scene.height)

    def frame():
        return renderer.render(theirs, flags=FLAGS)[0]

    renderer._platform.make_current()
    device = glGetString(GL_RENDERER).decode()
    return {"frame": frame, "srgb": False, "version": version("pyrender"), "device": device, "notes": NOTES}
