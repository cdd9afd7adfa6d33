"""Matrices of cameras."""

import numpy as np

from . import _check
from .errors import ParameterError


def check_invertible(name, m):
    if abs(np.linalg.det(m[:3, :3])) < 1e-12 * max(np.abs(m[:3, :3]).max(), 1e-300) ** 3:
        raise ParameterError(f"{name} is singular: {m.tolist()}")


def looking(eye, target, up):
    """World to eye, (4, 4)."""
    eye, target, up = _check.vector("eye", eye), _check.vector("target", target), _check.vector("up", up)
    back = eye - target
    if not back.any():
        raise ParameterError(f"eye and target are the same point, {eye.tolist()}")
    back = back / np.linalg.norm(back)
    if not up.any():
        raise ParameterError("up must not be zero")
    right = np.cross(up / np.linalg.norm(up), back)
    if np.linalg.norm(right) < 1e-9:
        raise ParameterError(f"up {up.tolist()} is along the view from {eye.tolist()} to {target.tolist()}")
    right /= np.linalg.norm(right)
    view = np.eye(4)
    view[:3, :3] = right, np.cross(back, right), back
    view[:3, 3] = -view[:3, :3] @ eye
    return view


def turn_y_to(up):
    """The smallest rotation (3, 3) that takes +Y to `up`."""
    x, y, z = up / np.linalg.norm(up)
    if y < -1 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    return np.array(
        [
            [1 - x * x / (1 + y), x, -x * z / (1 + y)],
            [-x, y, -z],
            [-x * z / (1 + y), z, 1 - z * z / (1 + y)],
        ]
    )


def clip_depths(row, clip_z, perspective):
    """Eye depths of the near and far planes of a projection's z row, None where there is none."""
    try:
        ends = tuple(float(v) for v in clip_z)
    except (TypeError, ValueError):
        ends = ()
    if ends not in ((0.0, 1.0), (-1.0, 1.0), (1.0, 0.0)):
        raise ParameterError(f"clip_z must be (0, 1) or (-1, 1), got {clip_z!r}")
    a, b = row[2], row[3]
    depths = []
    for end in ends:
        # Perspective: (a z + b) / −z = end at depth −z. Orthographic: a z + b = end.
        slope = a + end if perspective else a
        offset = b if perspective else b - end
        depth = offset / slope if slope != 0 else np.inf
        depths.append(depth if not perspective or depth > 0 else np.inf)
    near, far = sorted(depths)
    if not np.isfinite(near):
        near = None if perspective else -np.inf
    return (None if near is None or not np.isfinite(near) else near), (far if np.isfinite(far) else None)
