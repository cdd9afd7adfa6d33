"""PyVista, which draws with VTK: depth peeling, and its default, which is VTK's weighted blended transparency."""

import os
import re
from importlib.metadata import version

os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")

import numpy as np
import pyvista
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkUnsignedCharArray
from vtkmodules.vtkCommonMath import vtkMatrix4x4

NOTES = "vertex colours and layers of 8 bits; antialiasing must be off, or its peeling loses all that is translucent"


# It ends where nothing is left to peel. 0, which VTK says is no limit, peels once.
MOST_PEELS = 100_000


def prepared(scene, variant):
    """variant: "depth peeling" until nothing is left, or "default"."""
    plotter = pyvista.Plotter(off_screen=True, window_size=(scene.width, scene.height), lighting="none")
    plotter.disable_anti_aliasing()
    plotter.set_background(tuple(map(float, scene.background)))
    if variant == "depth peeling":
        plotter.enable_depth_peeling(number_of_peels=MOST_PEELS, occlusion_ratio=0)
    for mesh in scene.meshes:
        data = pyvista.PolyData.from_regular_faces(mesh.positions, mesh.faces)
        colors = np.uint8(np.round(255 * mesh.colors))
        actor = plotter.add_mesh(
            data, scalars=colors, rgba=True, lighting=False, show_scalar_bar=False, copy_mesh=False
        )
        actor.SetForceOpaque(mesh.opaque)
        actor.SetForceTranslucent(not mesh.opaque)
    _look(plotter, scene)
    window, pixels = plotter.render_window, vtkUnsignedCharArray()

    def frame():
        window.Render()
        window.GetRGBACharPixelData(0, 0, scene.width - 1, scene.height - 1, 0, pixels)
        return vtk_to_numpy(pixels).reshape(scene.height, scene.width, 4)[::-1]

    plotter.show(auto_close=False)
    _look(plotter, scene)  # showing has fitted the camera's range
    device = re.search("OpenGL renderer string: *(.*)", window.ReportCapabilities())[1]
    said = f"{version('pyvista')}, VTK {version('vtk')}"
    return {"frame": frame, "srgb": False, "version": said, "device": device, "notes": NOTES}


def _look(plotter, scene):
    pose, camera = scene.pose, plotter.camera
    camera.SetPosition(*pose[:3, 3])
    camera.SetFocalPoint(*(pose[:3, 3] - pose[:3, 2]))
    camera.SetViewUp(*pose[:3, 1])
    camera.SetParallelProjection(not scene.is_perspective)
    camera.SetClippingRange(scene.near, scene.far)
    matrix = vtkMatrix4x4()
    matrix.DeepCopy(scene.projection.ravel())
    camera.SetExplicitProjectionTransformMatrix(matrix)
    camera.SetUseExplicitProjectionTransformMatrix(True)
