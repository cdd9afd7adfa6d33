"""Meshes in submission order."""

import numbers

import numpy as np

from . import _check, load
from .blend import checked
from .errors import ParameterError, SceneError
from .mesh import Mesh
from .shade import lambert


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
        """Adds a mesh, or all that `item` holds. Returns the meshes that were added; on an error none are.

        Args:
            item: Mesh, Scene, trimesh.Trimesh, trimesh.Scene, a path that trimesh loads (PLY, OBJ, STL, OFF,
                GLB, glTF), or a list of these.
            color: (3|4,) replaces the item's own colours.
            alpha: in [0, 1], multiplies their alpha.
            transform: (4, 4), `M @ column`, applied in float64.
            name: as in Mesh; of several meshes, "name/own name".
            blend, cull: as in Mesh. None: the item's own. Any blend but "over" is for what is translucent: give
                opaque=False for a glTF whose alphaMode is OPAQUE or MASK.
            opaque: None: the item's own, unless `alpha`, or the alpha of `color`, is below 1: that makes it
                translucent. A glTF's alphaMode decides: OPAQUE ignores its alpha, MASK sets alpha_cutoff,
                BLEND is translucent. Other files are translucent.
            alpha_cutoff: as in Mesh. None: the item's own.
            space: "srgb" or "linear": what a glTF's linear colour factors are brought to.
            shade: True, or an (x, y, z) towards the light, in the scene's axes: bakes Lambert shading into the
                colours.

        Raises:
            SceneError: nothing drawable, or a value that cannot be drawn.
            ParameterError: an argument that is none of the above.
            UnsupportedError: a path, and trimesh is not installed.

        >>> scene = Scene()
        >>> scene.add(Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], name="a"), alpha=.5)
        [Mesh('a', 1 face, 3 vertices, one color)]
        """
        _check.choice("space", space, ("srgb", "linear"))
        look = {
            "color": None if color is None else _check.straight_rgba("color", color),
            "alpha": None if alpha is None else _check.number("alpha", alpha, 0, 1),
            "opaque": None if opaque is None else _check.flag("opaque", opaque),
            "alpha_cutoff": alpha_cutoff,
            "cull": cull,
            "blend": None if blend is None else checked(blend),
            "transform": None if transform is None else _check.affine("transform", transform),
            "shade": shade,
        }
        meshes = _meshes(item, look, space)
        added = [_changed(mesh, alpha=alpha, name=_named(name, mesh, len(meshes))) for mesh in meshes]
        self._meshes += added
        return added

    @property
    def triangle_count(self) -> int:
        return sum(mesh.face_count for mesh in self._meshes)

    @property
    def bounds(self) -> np.ndarray:
        """Lowest and highest corner of all triangles, (2, 3) float64."""
        corners = [(p.min(axis=0), p.max(axis=0)) for p in self._positions()]
        if not corners:
            raise SceneError("the scene is empty: it has no bounds")
        low, high = np.array(corners, dtype=np.float64).transpose(1, 0, 2)
        return np.array([low.min(axis=0), high.max(axis=0)])

    def bounding_sphere(self):
        """Middle of the bounds, (3,), and the distance of the farthest position. Never of radius 0.

        >>> Scene().bounding_sphere()
        (array([0., 0., 0.]), 1.0)
        """
        positions = self._positions()
        if not positions:
            return np.zeros(3), 1.0
        center = self.bounds.mean(axis=0)
        scale = np.abs(self.bounds - center).max() or 1.0  # squares would leave the float range
        squares = [(((p - center) / scale) ** 2).sum(axis=1).max() for p in positions]
        return center, float(scale * np.sqrt(max(squares))) or 1.0

    def _positions(self):
        """What the triangles' corners are, mesh by mesh; those without triangles left out."""
        return [mesh.used_positions() for mesh in self._meshes if mesh.face_count]

    def locate(self, primitive):
        """The mesh, and the face in it, of primitive ids: two int64 arrays of their shape.

        >>> triangle = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
        >>> Scene([triangle, triangle]).locate([0, 1])
        (array([0, 1]), array([0, 0]))
        """
        primitive = np.asarray(primitive)
        if primitive.size and primitive.dtype.kind not in "iu":
            raise ParameterError(f"primitives must be integers, got dtype {primitive.dtype}")
        first = np.cumsum([0] + [mesh.face_count for mesh in self._meshes])
        if primitive.size and (primitive.min() < 0 or primitive.max() >= first[-1]):
            limits = f"primitives run from 0 to {first[-1] - 1}" if first[-1] else "the scene has no triangles"
            low, high = primitive.min(), primitive.max()
            raise ParameterError(f"{limits}, got {low if low == high else f'{low} to {high}'}")
        primitive = primitive.astype(np.int64)
        mesh = np.searchsorted(first, primitive, side="right") - 1
        return mesh, primitive - first[mesh]

    def triangles(self) -> np.ndarray:
        """Corner positions of all primitives, (T, 3, 3) float64."""
        parts = [mesh.triangles().astype(np.float64) for mesh in self._meshes]
        return np.concatenate([np.zeros((0, 3, 3)), *parts])

    def __repr__(self):
        meshes = "1 mesh" if len(self._meshes) == 1 else f"{len(self._meshes)} meshes"
        return f"Scene({meshes}, {self.triangle_count} triangles)"


def as_scene(item) -> Scene:
    """`item` itself if it is a Scene, else a Scene of it."""
    return item if isinstance(item, Scene) else Scene([item])


def _meshes(item, look, space):
    """The meshes of an item, as `look` says, but for `alpha`: that only decides what becomes translucent here."""
    if isinstance(item, Mesh):
        return [_redone(item, **look)]
    if isinstance(item, Scene):
        return [_redone(mesh, **look) for mesh in item.meshes]
    if isinstance(item, (list, tuple)):
        return [mesh for each in item for mesh in _meshes(each, look, space)]
    if load.is_loadable(item):
        return load.meshes(item, space=space, **look)
    hint = "; wrap it: ab.Mesh(positions, faces)" if isinstance(item, (np.ndarray, numbers.Real)) else ""
    if hasattr(item, "scene") and hasattr(item, "camera"):
        hint = "; this one holds a scene and a camera: give its `scene`, and its `camera` where one is taken"
    if hasattr(item, "renderer"):
        hint = "; this one is on a Renderer's device: call its `renderer.render`, or give its `scene`"
    raise SceneError(
        f"cannot add this {type(item).__name__}: give a Mesh, a Scene, a trimesh.Trimesh, a trimesh.Scene, "
        f"a path, or a list of these{hint}"
    )


def _redone(mesh, *, color, alpha, opaque, alpha_cutoff, cull, blend, transform, shade):
    if opaque is None and mesh.opaque and alpha_cutoff is None and load.is_faded(alpha, color):
        opaque = False
    if opaque is False and mesh.alpha_cutoff is not None:
        mesh = mesh.replaced(opaque=False, alpha_cutoff=None)
    mesh = _changed(mesh, colors=color, opaque=opaque, alpha_cutoff=alpha_cutoff, cull=cull, blend=blend)
    if transform is not None:
        mesh = mesh.transformed(transform)
    return mesh if shade is False else lambert(mesh, shade)


def _changed(mesh, **changes):
    """`mesh` itself if nothing but None is given."""
    changes = {field: value for field, value in changes.items() if value is not None}
    return mesh.replaced(**changes) if changes else mesh


def _named(name, mesh, count):
    if name is None:
        return None
    return name if count == 1 or mesh.name is None else f"{name}/{mesh.name}"
