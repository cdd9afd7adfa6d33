"""pygfx with weighted blended transparency, whose weight is alpha alone."""

import numpy as np
import pygfx
import wgpu
from rendercanvas.offscreen import RenderCanvas

NOTES = "image of 8 bits, sRGB-encoded: decoded, a step at white is 2.2/255; what shows through is kept in 8 bits too"


class Given(pygfx.Camera):
    """A camera of any projection, clip z from 0 to w."""

    def __init__(self, scene):
        super().__init__()
        matrix = scene.projection.copy()
        matrix[2] = (matrix[2] + matrix[3]) / 2
        self.matrix = matrix
        self.local.matrix = scene.pose

    def _update_projection_matrix(self):
        return self.matrix


def encoded(linear):
    """Colours of materials are sRGB-encoded, those of vertices are not."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)


def prepared(scene, variant):
    """variant: an `alpha_mode` of pygfx's materials, of what is translucent."""
    canvas = RenderCanvas(size=(scene.width, scene.height), pixel_ratio=1)
    renderer = pygfx.renderers.WgpuRenderer(canvas, pixel_scale=1, ppaa="none", pixel_filter="nearest")
    theirs = pygfx.Scene()
    theirs.add(pygfx.Background.from_color((*map(float, encoded(scene.background)), 1.0)))
    for mesh in scene.meshes:
        geometry = pygfx.Geometry(positions=mesh.positions, indices=np.int32(mesh.faces), colors=mesh.colors)
        mode = "solid" if mesh.opaque else variant
        material = pygfx.MeshBasicMaterial(color_mode="vertex", alpha_mode=mode, side="both")
        theirs.add(pygfx.Mesh(geometry, material))
    camera = Given(scene)
    canvas.request_draw(lambda: renderer.render(theirs, camera))

    def frame():
        return np.asarray(canvas.draw())

    info = renderer.device.adapter.info
    said = f"{pygfx.__version__}, wgpu-py {wgpu.__version__}"
    return {"frame": frame, "srgb": True, "version": said, "device": info["device"], "notes": NOTES}
