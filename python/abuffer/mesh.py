"""One mesh: triangles with straight RGBA, and how they are drawn."""

import numpy as np

from . import _check
from .blend import AT_MOST_ONE, Blend, checked, id_of, over_one
from .errors import ParameterError, SceneError

COLOR_MODES = ("one", "vertex", "face", "corner")
DEFAULT_COLOR = (0.30, 0.55, 0.85, 0.5)


class Mesh:
    """Triangles with colours. Checked once, here; read-only afterwards.

    Args:
        positions: (N, 3) float32 or float64, world units, kept as given; or (T, 3, 3), one row a triangle.
        faces: (M, 3) integer indices into positions. None: every three positions are a triangle.
        colors: straight RGB or RGBA, (3|4,) one, (N, 3|4) a vertex, (M, 3|4) a face, (M, 3, 3|4) a corner.
            Floats as they are: RGB from 0 to float32's largest, alpha in [0, 1]. uint8 is value/255; other
            integers may only be 0 and 1. Three channels have alpha 1.
        color_mode: "one", "vertex", "face" or "corner"; needed only where N == M leaves it open.
        alpha: in [0, 1], multiplies the colours' alpha.
        blend: one of `BLENDS`, or a `Blend` of your own: what it does to the colour d behind it, c and α its own.
            "over": d(1−α) + αc; "additive": d + αc; "multiply": d(1−α+αc); "screen": 1 − (1−d)(1−αc);
            "premultiplied": d(1−α) + c. Modes may be mixed in a scene. Alpha is raised by over and premultiplied
            alone. multiply and screen take RGB up to 1.
        opaque: hides what is behind; alpha is then ignored, and blend must be "over".
        alpha_cutoff: of an opaque mesh, in [0, 1]: fragments of less alpha are discarded.
        cull: "back" or "front" drops that side; counter-clockwise is the front. None: two-sided.
        name: for people.

    Raises:
        SceneError: wrong shape or dtype, a non-finite or negative value, a face index out of range.
        ParameterError: an option that is none of the above, or two that do not go together.

    >>> Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], colors=(1, 0, 0, .5))
    Mesh(1 face, 3 vertices, one color)
    """

    __slots__ = (
        "alpha_cutoff",
        "blend",
        "color_mode",
        "colors",
        "cull",
        "faces",
        "name",
        "opaque",
        "positions",
    )

    def __init__(
        self,
        positions,
        faces=None,
        colors=DEFAULT_COLOR,
        *,
        color_mode=None,
        alpha=None,
        blend="over",
        opaque=False,
        alpha_cutoff=None,
        cull=None,
        name=None,
    ):
        positions = _positions(positions, faces is not None)
        faces = _faces(faces, len(positions))
        if faces is None and len(positions) % 3:
            raise SceneError(f"positions has {len(positions)} rows; without faces every three are a triangle")
        count = len(positions) // 3 if faces is None else len(faces)
        colors = _check.straight_rgba("colors", colors)
        color_mode = _color_mode(colors.shape, len(positions), count, color_mode)
        if alpha is not None:
            colors = _scaled(colors, _check.number("alpha", alpha, 0, 1))
        opaque = _check.flag("opaque", opaque)
        if alpha_cutoff is not None:
            alpha_cutoff = _check.number("alpha_cutoff", alpha_cutoff, 0, 1)
            if not opaque:
                raise ParameterError("alpha_cutoff is for opaque meshes: give opaque=True with it")
        blend = checked(blend)
        if opaque and blend != "over":
            raise ParameterError(
                f'opaque surfaces are not blended: give opaque=False, or blend="over" instead of {blend!r}'
            )
        over_one(colors, blend in AT_MOST_ONE, "colors", SceneError)
        fields = {
            "positions": positions,
            "faces": faces,
            "colors": colors,
            "color_mode": color_mode,
            "blend": blend,
            "opaque": opaque,
            "alpha_cutoff": alpha_cutoff,
            "cull": _check.choice("cull", cull, (None, "back", "front")),
            "name": name,
        }
        for field, value in fields.items():
            object.__setattr__(self, field, _check.frozen(value) if isinstance(value, np.ndarray) else value)

    def __setattr__(self, field, value=None):
        raise AttributeError(f"a Mesh is read-only: make another with another {field}")

    __delattr__ = __setattr__

    def __reduce__(self):
        return _rebuild, (self._fields(),)

    def __repr__(self):
        faces = "1 face" if self.face_count == 1 else f"{self.face_count} faces"
        opaque = ", opaque" if self.opaque else ""
        blend = "" if self.blend == "over" else f", {self.blend}"
        name = f"{self.name!r}, " if self.name else ""
        return f"Mesh({name}{faces}, {len(self.positions)} vertices, {self.color_mode} color{opaque}{blend})"

    @property
    def face_count(self) -> int:
        return len(self.positions) // 3 if self.faces is None else len(self.faces)

    def triangles(self) -> np.ndarray:
        """Corner positions, (M, 3, 3)."""
        return self.positions.reshape(-1, 3, 3) if self.faces is None else self.positions[self.faces]

    def used_positions(self) -> np.ndarray:
        """The positions that triangles have, once each, (N', 3)."""
        if self.faces is None:
            return self.positions
        used = np.zeros(len(self.positions), bool)
        used[self.faces.ravel()] = True
        return self.positions if used.all() else self.positions[used]

    def replaced(self, **changes) -> "Mesh":
        """A copy with some of the constructor's arguments changed.

        >>> float(Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]]).replaced(alpha=.5).colors[3])
        0.25
        """
        fields = self._fields()
        if "colors" in changes:
            fields["color_mode"] = None
        return Mesh(**(fields | changes))

    def transformed(self, matrix) -> "Mesh":
        """A copy moved by an affine (4, 4), `M @ column`, in float64. A mirrored mesh keeps its front."""
        m = _check.affine("transform", matrix)
        cull = self.cull
        if cull and np.linalg.det(m[:3, :3]) < 0:
            cull = "front" if cull == "back" else "back"  # a mirror reverses the winding, not the side
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused by name
            moved = self.positions.astype(np.float64) @ m[:3, :3].T + m[:3, 3]
        return self.replaced(positions=moved, cull=cull)

    def _fields(self) -> dict:
        return {field: getattr(self, field) for field in Mesh.__slots__}

    def _parts(self, own: tuple[Blend, ...]) -> dict:
        """As the core takes it. `own`: the scene's Blends, by which their ids go."""
        colors = self.colors.reshape(-1, 4)
        return {
            "positions": self.positions,
            "faces": self.faces,
            "color_mode": self.color_mode,
            "colors": colors,
            "opaque": self.opaque,
            "alpha_cutoff": self.alpha_cutoff or 0.0,
            "cull": self.cull,
            "blend": id_of(self.blend, own),
        }


def _rebuild(fields):
    return Mesh(**fields)


def _positions(values, indexed):
    array = _check.array_of_numbers("positions", values, "fiu")
    if array.ndim == 3 and array.shape[1:] == (3, 3):
        if indexed:
            raise SceneError(f"positions of shape {array.shape} are triangles already: give them without faces")
        array = array.reshape(-1, 3)
    if array.shape == (0,):
        array = array.reshape(0, 3)
    if array.ndim != 2 or array.shape[1] != 3:
        hint = ": transpose it" if array.ndim == 2 and array.shape[0] == 3 else ""
        raise SceneError(f"positions must have shape (N, 3) or (T, 3, 3), got {array.shape}{hint}")
    array = _check.floats(array)
    _check.first_bad("positions", ~np.isfinite(array), array, "positions must be finite")
    return np.ascontiguousarray(array)


def _faces(values, vertices):
    if values is None:
        return None
    if isinstance(values, (list, tuple)) and not values:
        values = np.zeros((0, 3), np.uint32)
    array = _check.array_of_numbers("faces", values, "iu")
    if array.ndim != 2 or array.shape[1] != 3:
        hint = ""
        if array.ndim == 2 and array.shape[1] == 4:
            hint = ": split quads into triangles, np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])"
        elif array.ndim == 2 and array.shape[0] == 3:
            hint = ": transpose it?"
        raise SceneError(f"faces must have shape (M, 3), got {array.shape}{hint}")
    why = f"there are {vertices} positions, 0 to {vertices - 1}" if vertices else "there are no positions"
    _check.first_bad("faces", (array < 0) | (array >= vertices), array, why)
    return np.ascontiguousarray(array, dtype=np.uint32)


def _color_mode(shape, vertices, faces, given):
    """What a colour array of this shape is given for."""
    fitting = {
        "one": shape == (4,),
        "vertex": shape == (vertices, 4),
        "face": shape == (faces, 4),
        "corner": shape == (faces, 3, 4),
    }
    if given is not None:
        _check.choice("color_mode", given, COLOR_MODES)
        if not fitting[given]:
            raise SceneError(
                f"colors of shape {shape} (with alpha) are not one a {given}: "
                f"there are {vertices} positions and {faces} faces"
            )
        return given
    modes = [mode for mode, fits in fitting.items() if fits]
    if not modes:
        raise SceneError(f"colors of shape {shape} (with alpha) fit neither {vertices} positions nor {faces} faces")
    if len(modes) > 1 and vertices:
        raise SceneError(
            f"colors of {vertices} rows fit both the positions and the faces: "
            'say color_mode="vertex" or color_mode="face"'
        )
    return modes[0]


def _scaled(colors, alpha):
    colors = colors.copy()
    colors[..., 3] *= alpha
    return colors
