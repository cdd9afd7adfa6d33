"""Matrices of cameras."""

import numpy as np

from . import _check
from .errors import ParameterError

RIGID = 1e-5  # how far a rotation times its transpose may be from the identity: poses printed to six decimals pass


def check_rigid(name, m, *, is_pose=False):
    """Raises a ParameterError unless the upper 3×3 of `m` is a rotation.

    In a scaled camera depth would not be in world units. A pose is scaled by its columns; its inverse, a view, by
    its rows, translation included.
    """
    scale = np.abs(m[:3, :3]).max() or 1.0
    linear = m[:3, :3] / scale  # powers of a scale would leave the float range
    if abs(np.linalg.det(linear)) < 1e-12:
        raise ParameterError(f"{name} is singular: {m.tolist()}")
    lengths = np.linalg.norm(linear, axis=0 if is_pose else 1)
    unit = linear / lengths if is_pose else linear / lengths[:, None]
    if np.abs(unit @ unit.T - np.eye(3)).max() > RIGID:
        raise ParameterError(f"{name} is sheared, it must be a rotation and a translation: {m.tolist()}")
    if np.linalg.det(unit) < 0:
        hint = "negate one axis, or mirror the scene with transform="
        raise ParameterError(f"{name} is mirrored, it must be a rotation and a translation: {hint}")
    lengths *= scale
    if np.abs(lengths - 1).max() > RIGID / 2:  # whose squares are off by twice as much
        alike = np.ptp(lengths) <= RIGID * lengths.max()
        found = f"{lengths[0]:.9g}" if alike else f"({', '.join(f'{v:.9g}' for v in lengths)})"
        part = "columns" if is_pose else "rows, translation included,"
        raise ParameterError(
            f"{name} has the scale {found}, it must be a rotation and a translation, since depth is in world units: "
            f"divide its first three {part} by {'the scale' if alike else 'their scales'}"
        )


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
