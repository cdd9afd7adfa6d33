"""Scenes of parallel sheets over the whole view, and the pipelines that render them: what closed forms are for."""

import numpy as np

import abuffer as ab
from abuffer._methods import METHODS
from comparison import CPU32, CPU64, GPU, GPU_PREFIX, GPU_TILES, Precision

HARDWARE = Precision("hardware", "gpu", "float32", GPU.depth_relative, GPU.interpolation_ulps)
# Depths are −z, without a rounding.
CAMERA = ab.Camera.orthographic((0, 0, 0), (0, 0, -1), height=2)
SIZE = {"width": 2, "height": 1}


def sheets(depths, colors, **mesh):
    """One mesh, a triangle and a straight RGBA for each depth, in the order of submission."""
    depths = np.asarray(depths, float)
    corners = np.tile([[-9.0, -9, 0], [27, -9, 0], [-9, 27, 0]], (len(depths), 1, 1))
    corners[..., 2] = -depths[:, None]
    return ab.Mesh(corners, colors=np.asarray(colors, np.float32).reshape(-1, 4), color_mode="face", **mesh)


def one_by_one(depths, colors):
    """The same, each sheet a mesh of its own."""
    return [sheets([depth], [color]) for depth, color in zip(depths, colors, strict=True)]


def render(pipeline, scene, method="exact", **options):
    return pipeline.render(scene, CAMERA, **SIZE | options, method=method)


def pipelines_of(id):
    """All that have a method, the CPU's in both precisions."""
    own = {
        "tiles": (CPU32, CPU64, GPU_TILES),
        "linked_list": (GPU,),
        "prefix_sum": (GPU_PREFIX,),
        "hardware": (HARDWARE,),
    }
    return [pipeline for name in METHODS[id].pipelines for pipeline in own[name]]


def everywhere(ids=METHODS):
    """Each method on each of its pipelines."""
    return [(id, pipeline) for id in ids for pipeline in pipelines_of(id)]


def unit(pipeline):
    """Of rounding."""
    return 2.0**-53 if pipeline.precision == "float64" else 2.0**-24
