"""Where fragments lie: in the world, and in their triangles."""

import numpy as np

from .errors import ParameterError
from .scene import as_scene

CHUNK = 1 << 18  # fragments at a time: bounds the corners that are held at once


def points(frags, camera) -> np.ndarray:
    view, projection, ndc = _rays(frags, camera)
    # Solve the x and y rows of the projection for the eye position at the known depth.
    z = -frags.depth.astype(np.float64)
    w = projection[3, 2] * z + projection[3, 3]
    known = ndc * w[:, None] - np.outer(z, projection[:2, 2]) - projection[:2, 3]
    eye = np.column_stack([known @ np.linalg.inv(projection[:2, :2]).T, z])
    return (eye - view[:3, 3]) @ np.linalg.inv(view[:3, :3]).T


def barycentric(frags, scene, camera) -> np.ndarray:
    view, projection, ndc = _rays(frags, camera)
    result = np.empty((len(frags), 3))
    triangles = as_scene(scene).triangles()
    check_primitives(frags, len(triangles))
    to_clip = (projection @ view)[[0, 1, 3]]
    for start in range(0, len(frags), CHUNK):
        part = slice(start, start + CHUNK)
        clip = triangles[frags.primitive[part]] @ to_clip[:, :3].T + to_clip[:, 3]
        # Relative to the pixel's ray, b is the null vector of the corners' (x, y): two cross products.
        x, y = (clip[..., i] - ndc[part, None, i] * clip[..., 2] for i in (0, 1))
        b = np.stack([x[:, i] * y[:, j] - x[:, j] * y[:, i] for i, j in ((1, 2), (2, 0), (0, 1))], axis=1)
        b[b.sum(axis=1) == 0] = 1, 0, 0
        result[part] = b / b.sum(axis=1, keepdims=True)
    return result


def check_primitives(frags, count):
    """Raises a ParameterError where lists name others than the `count` primitives of a scene."""
    if len(frags) and not 0 <= frags.primitive.min() <= frags.primitive.max() < count:
        named = f"{frags.primitive.min()} to {frags.primitive.max()}"
        raise ParameterError(f"the lists name primitives {named}, the scene has {count}: another scene?")


def _rays(frags, camera):
    """The camera's matrices for the whole image, and each fragment's pixel centre in NDC, (F, 2)."""
    y0, x0, height, width = frags._window
    view, projection = camera.matrices(width, height)
    y, x = np.divmod(frags.pixel, frags.shape[1])
    centers = np.column_stack([x + x0 + 0.5, y + y0 + 0.5])
    return view, projection, (centers / (width, height) - 0.5) * (2, -2)
