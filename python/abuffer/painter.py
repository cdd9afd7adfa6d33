"""Baselines that sort what they paint, by one depth for each object or triangle, and not by pixel.

Painter's algorithm (Newell, Newell and Sancha 1972, without its splitting): objects or triangles are painted in the order of a
depth, the farthest first, equal ones as they were submitted. No such order is right where triangles cross or
overlap in a cycle, nor wherever one depth says too little of something large.
"""

import numpy as np

from .mesh import Mesh

KEYS = ("centroid", "nearest", "farthest")


def depths_of(points, camera) -> np.ndarray:
    """Eye depths of points (..., 3), float64."""
    axis = camera.view[2]
    return -(points.astype(np.float64) @ axis[:3] + axis[3])


def painted(meshes, camera, what, key):
    """Translucent triangles in the order in which they are painted: their places among all of them, (T,) int64.

    Args:
        meshes: the translucent ones.
        what: "objects" or "triangles".
        key: "centroid", of an object the centre of its box, or the "nearest" or "farthest" vertex.
    """
    counts = [mesh.face_count for mesh in meshes]
    if what == "objects":
        of_mesh = np.array([_depth_of_object(mesh, camera, key) if mesh.face_count else 0.0 for mesh in meshes])
        keys = np.repeat(of_mesh, counts)
    else:
        corners = [depths_of(mesh.triangles(), camera) for mesh in meshes]
        reduce = {"centroid": np.mean, "nearest": np.min, "farthest": np.max}[key]
        keys = np.concatenate([reduce(c, axis=1) for c in corners]) if corners else np.zeros(0)
    return np.argsort(-keys, kind="stable")


def _depth_of_object(mesh, camera, key):
    points = mesh.used_positions()
    if key == "centroid":
        return depths_of((points.min(axis=0).astype(np.float64) + points.max(axis=0)) / 2, camera)
    depths = depths_of(points, camera)
    return depths.min() if key == "nearest" else depths.max()


def in_order(meshes, camera, what, key) -> list:
    """The meshes that submit the same triangles in the order in which they are painted; opaque ones first, as they are."""
    opaque, translucent = [m for m in meshes if m.opaque], [m for m in meshes if not m.opaque]
    order = painted(translucent, camera, what, key)
    owner = np.repeat(np.arange(len(translucent)), [m.face_count for m in translucent])
    if len({(m.cull, m.blend) for m in translucent}) <= 1:
        owner = np.zeros_like(owner)  # a mesh for all of them
    positions = [m.triangles() for m in translucent]
    colors = [corner_colors(m) for m in translucent]
    if not len(order):
        return opaque
    positions, colors = np.concatenate(positions)[order], np.concatenate(colors)[order]
    ends = np.flatnonzero(np.diff(owner[order])) + 1
    runs = zip(np.split(positions, ends), np.split(colors, ends), owner[order][np.r_[0, ends]], strict=True)
    alike = [{"cull": m.cull, "blend": m.blend} for m in translucent]
    return [*opaque, *(Mesh(p, colors=c, **alike[mesh]) for p, c, mesh in runs)]


def ranks(scene, camera, what, key) -> np.ndarray:
    """The place of every primitive of a scene in the order in which it is painted, (primitives,) int64; opaque ones first."""
    is_opaque = np.concatenate([np.full(m.face_count, m.opaque) for m in scene.meshes] or [np.zeros(0, bool)])
    translucent = np.flatnonzero(~is_opaque)
    order = translucent[painted([m for m in scene.meshes if not m.opaque], camera, what, key)]
    ranks = np.zeros(len(is_opaque), np.int64)
    ranks[order] = 1 + np.arange(len(order))
    return ranks


def corner_colors(mesh) -> np.ndarray:
    """A colour for each corner of each triangle, (M, 3, 4)."""
    shape = (mesh.face_count, 3, 4)
    if mesh.color_mode == "vertex":
        return mesh.colors[mesh.faces] if mesh.faces is not None else mesh.colors.reshape(shape)
    if mesh.color_mode == "corner":
        return mesh.colors.reshape(shape)
    return np.broadcast_to(mesh.colors.reshape(-1, 1, 4), shape)
