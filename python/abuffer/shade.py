"""Lambert shading baked into colours."""

import numpy as np

from .errors import ParameterError
from .mesh import Mesh

AMBIENT = 0.35
LIGHT = (-0.4, 0.8, 0.6)  # from above left, on the viewer's side


def lambert(mesh: Mesh, light=True, *, normals=None) -> Mesh:
    """`mesh` with two-sided Lambert shading in its colours: rgb · (0.35 + 0.65 |n·l|), alpha untouched.

    Colours become one per vertex where they were one or per vertex, else one per corner.

    Args:
        mesh: any mesh.
        light: direction to the light, (x, y, z) of any length; True: from above left, (-0.4, 0.8, 0.6).
        normals: (N, 3) per vertex, of any length. None: the area-weighted mean of the faces at each vertex;
            faces that share no vertices are flat.

    Raises:
        ParameterError: `light` is not a direction.

    Example:
        >>> floor = Mesh([(0, 0, 0), (0, 0, 1), (1, 0, 0)], colors=(1, 1, 1, 0.5))
        >>> lambert(floor, (0, 1, 0)).colors[0].tolist()
        [1.0, 1.0, 1.0, 0.5]
    """
    direction = np.asarray(LIGHT if light is True else light)
    if direction.shape != (3,) or direction.dtype.kind not in "iuf":
        raise ParameterError(f"shade is {light!r}; it must be True or a direction (x, y, z) to the light")
    if not np.isfinite(direction).all() or not direction.any():
        raise ParameterError(f"shade is {light!r}; a direction to the light is finite and not all zeros")
    count = len(mesh.positions)
    faces = np.arange(count).reshape(-1, 3) if mesh.faces is None else np.asarray(mesh.faces, np.int64)
    if normals is None:
        normals = _vertex_normals(np.asarray(mesh.positions, np.float64), faces)
    cosine = np.abs(_unit(np.asarray(normals, np.float64)) @ _unit(direction.astype(np.float64)))
    factor = AMBIENT + (1 - AMBIENT) * np.minimum(cosine, 1)  # (N,)
    colors = np.asarray(mesh.colors)
    if mesh.color_mode in ("one", "vertex"):
        shaded = np.broadcast_to(colors, (count, 4)).copy()
        shaded[:, :3] *= factor[:, None]
    else:
        corners = colors[:, None] if mesh.color_mode == "face" else colors
        shaded = np.broadcast_to(corners, (len(faces), 3, 4)).copy()
        shaded[..., :3] *= factor[faces][..., None]
    return mesh.replaced(colors=shaded, color_mode="vertex" if shaded.ndim == 2 else "corner")


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors (…, 3) with length 1; zeros stay zeros. Scaled first: squares would leave the float range."""
    largest = np.abs(vectors).max(axis=-1, keepdims=True, initial=0)
    scaled = vectors / np.where(largest > 0, largest, 1)
    length = np.linalg.norm(scaled, axis=-1, keepdims=True)
    return scaled / np.where(length > 0, length, 1)


def _vertex_normals(positions: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(N, 3) sums of face normals weighted by area, up to a scale."""
    scale = np.abs(positions).max(initial=0) or 1.0
    corners = (positions / scale)[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sums = [np.bincount(faces.ravel(), np.repeat(axis, 3), len(positions)) for axis in normals.T]
    return np.stack(sums, axis=-1)
