"""Meshes in submission order."""

import numpy as np

from . import _check, load
from .errors import ParameterError, SceneError
from .mesh import Mesh


class Scene:
    """Meshes in the order in which their triangles are numbered.

    Args:
        items: anything `add` takes.

    >>> scene = Scene([Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]])])
    >>> scene.bounds.tolist()
    [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0]]
    """

    def __init__(self, items=()):
        self._meshes = []
        if items is not None and not (isinstance(items, (list, tuple)) and not items):
            self.add(items)

    @property
    def meshes(self) -> tuple:
        return tuple(self._meshes)

    def add(
        self,
        item,
        *,
        color=None,
        alpha=None,
        transform=None,
        name=None,
        blend=None,
        opaque=None,
        alpha_cutoff=None,
        cull=None,
        space="srgb",
        shade=False,
    ) -> list:
        """Adds a mesh, or all that `item` holds. Returns the meshes that were added.

        Args:
            item: Mesh, Scene, trimesh.Trimesh, trimesh.Scene, a path that trimesh loads (PLY, OBJ, STL, OFF,
                GLB, glTF), or a list of these.
            color: (3|4,) replaces the item's own colours.
            alpha: in [0, 1], multiplies their alpha. Below 1 it makes an opaque item translucent.
            transform: (4, 4), `M @ column`, applied in float64.
            name, blend, cull: as in Mesh. None: the item's own.
            opaque: None: the item's own. A glTF's alphaMode decides: OPAQUE ignores its alpha, MASK sets
                alpha_cutoff, BLEND is translucent.
            alpha_cutoff: as in Mesh. None: the item's own.
            space: "srgb" or "linear": what a glTF's linear colour factors are brought to.
            shade: True, or an (x, y, z) towards the light, bakes Lambert shading into the colours.

        Raises:
            SceneError: nothing drawable, or a value that cannot be drawn.
            UnsupportedError: a path, and trimesh is not installed.

        >>> scene = Scene()
        >>> scene.add(Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], name="a"), alpha=.5)
        [Mesh('a', 1 face, 3 vertices, one color)]
        """
        look = {"color": color, "alpha": alpha, "opaque": opaque, "alpha_cutoff": alpha_cutoff, "shade": shade}
        added = [
            _drawn(mesh, alpha=alpha, transform=transform, name=name, blend=blend, cull=cull)
            for mesh in _meshes(item, look, space)
        ]
        self._meshes += added
        return added

    @property
    def triangle_count(self) -> int:
        return sum(mesh.face_count for mesh in self._meshes)

    @property
    def bounds(self) -> np.ndarray:
        """Lowest and highest corner of all positions, (2, 3) float64."""
        corners = [(m.positions.min(axis=0), m.positions.max(axis=0)) for m in self._meshes if len(m.positions)]
        if not corners:
            raise SceneError("the scene is empty: it has no bounds")
        low, high = np.array(corners, dtype=np.float64).transpose(1, 0, 2)
        return np.array([low.min(axis=0), high.max(axis=0)])

    def locate(self, primitive):
        """The mesh, and the face in it, of primitive ids: two int64 arrays of their shape.

        >>> triangle = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
        >>> Scene([triangle, triangle]).locate([0, 1])
        (array([0, 1]), array([0, 0]))
        """
        primitive = np.asarray(primitive, dtype=np.int64)
        first = np.cumsum([0] + [mesh.face_count for mesh in self._meshes])
        if primitive.size and (primitive.min() < 0 or primitive.max() >= first[-1]):
            raise ParameterError(
                f"primitives run from 0 to {first[-1] - 1}, got {primitive.min()} to {primitive.max()}"
            )
        mesh = np.searchsorted(first, primitive, side="right") - 1
        return mesh, primitive - first[mesh]

    def triangles(self) -> np.ndarray:
        """Corner positions of all primitives, (T, 3, 3) float64."""
        parts = [mesh.triangles().astype(np.float64) for mesh in self._meshes]
        return np.concatenate([np.zeros((0, 3, 3)), *parts])

    def __repr__(self):
        return f"Scene({len(self._meshes)} meshes, {self.triangle_count} triangles)"


def as_scene(item) -> Scene:
    """`item` itself if it is a Scene, else a Scene of it."""
    return item if isinstance(item, Scene) else Scene([item])


def _meshes(item, look, space):
    """The meshes of an item, coloured. `alpha` of `look` only decides what becomes translucent here."""
    _check.choice("space", space, ("srgb", "linear"))
    if isinstance(item, Mesh):
        return [_recoloured(item, **look)]
    if isinstance(item, Scene):
        return [_recoloured(mesh, **look) for mesh in item.meshes]
    if isinstance(item, (list, tuple)):
        return [mesh for each in item for mesh in _meshes(each, look, space)]
    if load.is_loadable(item):
        return load.meshes(item, space=space, **look)
    raise SceneError(
        f"cannot add a {type(item).__name__}: give a Mesh, a Scene, a trimesh.Trimesh, a trimesh.Scene, "
        "a path, or a list of these"
    )


def _recoloured(mesh, *, color, alpha, opaque, alpha_cutoff, shade):
    changes = {}
    if color is not None:
        changes["colors"] = color
    if opaque is None and alpha is not None and alpha < 1 and mesh.opaque and alpha_cutoff is None:
        opaque = False
    if opaque is not None:
        changes["opaque"] = opaque
        if not opaque:
            changes["alpha_cutoff"] = None
    if alpha_cutoff is not None:
        changes["alpha_cutoff"] = alpha_cutoff
    if changes:
        mesh = mesh.replaced(**changes)
    return load.lambert(mesh, shade) if shade is not False else mesh


def _drawn(mesh, *, alpha, transform, **fields):
    changes = {field: value for field, value in fields.items() if value is not None}
    if alpha is not None:
        changes["alpha"] = alpha
    if changes:
        mesh = mesh.replaced(**changes)
    return mesh if transform is None else mesh.transformed(transform)
