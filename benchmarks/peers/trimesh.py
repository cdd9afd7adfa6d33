"""trimesh's rays through pixels' centres: all hits of each, composited here in float64, by distance.

Native rays hit both faces at a shared edge. Embree's start again a millionth of the scene's size behind each hit, so
that what is closer than that is lost.
"""

import itertools
from importlib.metadata import version

import numpy as np
import trimesh
from trimesh.ray import ray_pyembree, ray_triangle

# Beside the module: rays at once, since memory is that of their hits, and of native rays that of all triangles in the
# boxes around them.
KINDS = {
    "embree rays": (ray_pyembree, 16384, {"max_hits": 100_000}, "max_hits raised from 100; equal depths are one hit"),
    "native rays": (ray_triangle, 256, {}, "a ray through an edge hits both faces"),
}


def prepared(scene, variant):
    """variant: a key of KINDS."""
    module, at_once, options, notes = KINDS[variant]
    first = np.cumsum([0, *(len(mesh.positions) for mesh in scene.meshes)])
    positions = np.concatenate([mesh.positions for mesh in scene.meshes]).astype(np.float64)
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(scene.meshes, first, strict=False)]).astype(
        np.int64
    )
    colors = np.concatenate([mesh.colors.astype(np.float64) for mesh in scene.meshes])
    colors[np.repeat([mesh.opaque for mesh in scene.meshes], np.diff(first)), 3] = 1
    body = trimesh.Trimesh(positions, faces, process=False)
    rays = module.RayMeshIntersector(body)
    origins, directions = _rays(scene)

    def frame():
        chunks = [slice(start, start + at_once) for start in range(0, len(origins), at_once)]
        pixels = np.concatenate([composited(origins[chunk], directions[chunk]) for chunk in chunks])
        return pixels.reshape(scene.height, scene.width, 4)

    def composited(origins, directions):
        hit, ray, where = rays.intersects_id(origins, directions, multiple_hits=True, return_locations=True, **options)
        where = where.reshape(-1, 3)  # which it is not where nothing is hit
        distance = np.einsum("ij,ij->i", where - origins[ray], directions[ray])
        order = np.lexsort((distance, ray))
        hit, ray, where = hit[order], ray[order], where[order]
        weights = trimesh.triangles.points_to_barycentric(body.triangles[hit], where)
        rgba = np.einsum("ij,ijk->ik", weights, colors[faces[hit]])
        return _composited(ray, rgba, len(origins), scene.background)

    device = "embree, float32" if "embree" in variant else "numpy, float64"
    return {"frame": frame, "srgb": False, "version": version("trimesh"), "device": device, "notes": notes}


def _rays(scene):
    """From the near plane through each pixel's centre, rows first, (H·W, 3) each."""
    x = 2 * (np.arange(scene.width) + 0.5) / scene.width - 1
    y = 1 - 2 * (np.arange(scene.height) + 0.5) / scene.height
    x, y = (each.ravel() for each in np.meshgrid(x, y))
    ends = []
    for z in (-1.0, 1.0):
        clip = np.stack([x, y, np.full_like(x, z), np.ones_like(x)], axis=1)
        world = clip @ np.linalg.inv(scene.projection @ scene.view).T
        ends.append(world[:, :3] / world[:, 3:])
    directions = ends[1] - ends[0]
    return ends[0], directions / np.linalg.norm(directions, axis=1, keepdims=True)


def _composited(ray, rgba, count, background):
    """Front to back, (count, 4), of hits sorted by ray and distance."""
    pixels = np.zeros((count, 4))
    start = np.searchsorted(ray, np.arange(count))
    place = np.arange(len(ray)) - start[ray]
    by_place = np.argsort(place, kind="stable")
    ends = np.searchsorted(place[by_place], np.arange(place.max(initial=-1) + 2))
    for low, high in itertools.pairwise(ends):
        hits = by_place[low:high]
        alpha = rgba[hits, 3:]
        layer = np.concatenate([rgba[hits, :3] * alpha, alpha], axis=1)
        pixels[ray[hits]] += (1 - pixels[ray[hits], 3:]) * layer
    pixels[:, :3] += (1 - pixels[:, 3:]) * background
    return pixels
