"""Files and trimesh objects as meshes.

trimesh is optional (``pip install abuffer[trimesh]``) and imported when a file is read.
"""

import io
import os
import sys
import warnings
from typing import Any, NamedTuple

import numpy as np

from . import _check, gltf
from ._srgb import encode_srgb
from .errors import SceneError, UnsupportedError
from .mesh import Mesh
from .shade import lambert

FORMATS = "PLY, OBJ, STL, OFF, GLB and glTF with triangles"


class _Look(NamedTuple):
    """What an item says about its own colours. `colors` None: nothing."""

    colors: np.ndarray | None
    color_mode: str | None = None
    alpha_mode: str | None = None  # a glTF's: OPAQUE, MASK or BLEND
    alpha_cutoff: float = 0.5
    textured: bool = False


class _Part(NamedTuple):
    """One node of a scene: a trimesh.Trimesh and where it stands."""

    name: str | None
    geometry: Any
    matrix: np.ndarray
    material: dict | None = None  # as a glTF file has it


def is_faded(alpha, color) -> bool:
    """Whether what is given makes an item translucent that is opaque by itself."""
    return (alpha is not None and alpha < 1) or (color is not None and bool((color[..., 3] < 1).any()))


def is_loadable(item) -> bool:
    """Whether `meshes` takes `item`: a path (str or os.PathLike), a trimesh.Trimesh or a trimesh.Scene.

    Does not import trimesh.
    """
    trimesh = sys.modules.get("trimesh")
    return isinstance(item, (str, os.PathLike)) or (
        trimesh is not None and isinstance(item, (trimesh.Trimesh, trimesh.Scene))
    )


def meshes(
    item,
    *,
    color=None,
    alpha=None,
    opaque=None,
    alpha_cutoff=None,
    cull=None,
    blend=None,
    space="srgb",
    transform=None,
    shade=False,
) -> list[Mesh]:
    """The meshes of a file, a trimesh.Scene or a trimesh.Trimesh, one per scene node, named after it, in world space.

    Faces keep their order, those of a file its own; trimesh cuts polygons into triangles.

    Args:
        item: path of a PLY, OBJ, STL, OFF, GLB or glTF file, or a trimesh object.
        color: replaces the item's colours; anything that `Mesh` takes as `colors`. None: its vertex colours,
            face colours or base colour (a texture image is ignored, with a warning), else `Mesh`'s default.
        alpha: what the caller will multiply the alphas by. It is not applied here: below 1 it makes a mesh
            translucent where `opaque` is None.
        opaque: None: what a PBR material's alphaMode says (absent: OPAQUE), else False. OPAQUE ignores the
            material's own alpha, MASK sets `alpha_cutoff`. True or False overrides alphaMode.
        alpha_cutoff: alpha below which an opaque mesh has a hole. None: that of a MASK material.
        cull: None, "back" or "front". None is two-sided, whatever a glTF's doubleSided says.
        blend: as in `Mesh`. None: "over".
        space: what the linear colours of PBR materials are brought to, "srgb" or "linear". Other colours are
            taken as they are.
        transform: (4, 4), `M @ column`, applied after the nodes' own.
        shade: True, or a direction (x, y, z) to the light: bakes Lambert shading into the colours.

    Raises:
        SceneError: no such file, not readable, or nothing in it that can be drawn.
        ParameterError: an argument is none of the above.
        UnsupportedError: trimesh is missing, or too old.

    Example:
        >>> import trimesh
        >>> [mesh.face_count for mesh in meshes(trimesh.creation.box())]
        [12]
    """
    _check.choice("space", space, ("srgb", "linear"))
    parts = _parts(item)
    if transform is not None:
        transform = _check.affine("transform", transform)
        parts = [part._replace(matrix=transform @ part.matrix) for part in parts]
    looks = [_look(part, space) for part in parts]
    if color is not None:
        color = _check.straight_rgba("color", color)
        looks = [look._replace(colors=color, color_mode=None, textured=False) for look in looks]
    result = []
    for part, look in zip(parts, looks, strict=True):
        arguments = _colors_and_alpha(look, alpha, opaque, alpha_cutoff, own=color is None)
        mesh = Mesh(*_world(part), **arguments, cull=cull, blend="over" if blend is None else blend, name=part.name)
        result.append(mesh if shade is False else lambert(mesh, shade, normals=_file_normals(part)))
    textured = sum(look.textured for look in looks)
    if textured:
        which = f"{textured} of {len(parts)} meshes have a texture image"
        warnings.warn(f"{which}, which is ignored: their base colour is used", UserWarning, stacklevel=2)
    return result


def _file_normals(part: _Part) -> np.ndarray | None:
    """The vertex normals that came with the geometry, in world space, up to a scale. None: it has none."""
    if "vertex_normals" not in part.geometry._cache:  # trimesh would make some up
        return None
    linear = part.matrix[:3, :3]
    cofactors = np.cross(linear[[1, 2, 0]], linear[[2, 0, 1]])
    return np.asarray(part.geometry.vertex_normals) @ cofactors.T


def _world(part: _Part) -> tuple[np.ndarray, np.ndarray]:
    """Positions and faces in world space; the faces of a mirrored node are turned, so that front is front."""
    positions, faces = np.asarray(part.geometry.vertices), np.asarray(part.geometry.faces)
    if np.array_equal(part.matrix, np.eye(4)):
        return positions, faces
    linear, offset = part.matrix[:3, :3], part.matrix[:3, 3]
    mirrored = np.linalg.det(linear) < 0
    return positions.astype(np.float64) @ linear.T + offset, faces[:, [0, 2, 1]] if mirrored else faces


def _colors_and_alpha(look: _Look, alpha, opaque, alpha_cutoff, *, own: bool) -> dict:
    """`Mesh`'s arguments colors, color_mode, opaque, alpha_cutoff. `own`: the colours are the item's own."""
    colors, mode = look.colors, look.alpha_mode
    faded = is_faded(alpha, None if own else colors)
    if own and alpha_cutoff is None:
        if mode == "OPAQUE" and opaque is not False:
            colors = _with_alpha(colors, 1.0)
        if mode == "MASK" and opaque is None and faded:
            colors = _with_alpha(colors, colors[..., 3] >= look.alpha_cutoff)
    if opaque is None:
        opaque = mode in ("OPAQUE", "MASK") and (not faded or alpha_cutoff is not None)
    if opaque and mode == "MASK" and alpha_cutoff is None:
        alpha_cutoff = look.alpha_cutoff
    arguments = {"opaque": opaque, "alpha_cutoff": alpha_cutoff}
    return arguments if colors is None else {"colors": colors, "color_mode": look.color_mode, **arguments}


def _with_alpha(colors: np.ndarray, alpha) -> np.ndarray:
    return np.concatenate([colors[..., :3], np.broadcast_to(alpha, colors.shape[:-1])[..., None]], axis=-1)


def _look(part: _Part, space: str) -> _Look:
    visual = part.geometry.visual
    if visual.kind in ("vertex", "face"):
        return _Look(np.asarray(getattr(visual, f"{visual.kind}_colors")), visual.kind)
    if visual.kind != "texture":
        return _Look(None)
    material = visual.material
    if part.material is not None or hasattr(material, "alphaMode"):
        return _pbr_look(part, _as_gltf(material) if part.material is None else part.material, space)
    if hasattr(material, "materials"):
        raise SceneError(f"mesh {part.name!r} has several materials; load it with merge_primitives=False")
    return _simple_look(part, material)


def _as_gltf(material) -> dict:
    """A trimesh PBRMaterial as it would stand in a glTF file."""
    factor, texture = material.baseColorFactor, material.baseColorTexture
    pbr = {} if factor is None else {"baseColorFactor": _unorm(factor)}
    pbr |= {} if texture is None else {"baseColorTexture": texture}
    return {
        "pbrMetallicRoughness": pbr,
        "alphaMode": material.alphaMode,
        "alphaCutoff": material.alphaCutoff,
    }


def _pbr_look(part: _Part, material: dict, space: str) -> _Look:
    pbr = material.get("pbrMetallicRoughness", {})
    glossy = material.get("extensions", {}).get("KHR_materials_pbrSpecularGlossiness", {})
    factor = glossy.get("diffuseFactor", pbr.get("baseColorFactor", (1, 1, 1, 1)))
    colors = _times_vertex_colors(part, np.asarray(factor, np.float64))
    if space == "srgb":
        colors = np.concatenate([encode_srgb(colors[..., :3]), colors[..., 3:]], axis=-1)
    cutoff = material.get("alphaCutoff")
    return _Look(
        colors,
        "vertex" if colors.ndim == 2 else None,
        material.get("alphaMode") or "OPAQUE",
        0.5 if cutoff is None else cutoff,
        "baseColorTexture" in pbr or "diffuseTexture" in glossy,
    )


def _simple_look(part: _Part, material) -> _Look:
    """An OBJ's material. trimesh makes up a grey where Kd is absent, and an image where the material is."""
    values, invented = material.kwargs, (102, 102, 102, 255)
    image = material.image
    textured = image is not None and type(image).__name__ != "ExceptionWrapper"
    if textured and image.size == (2, 2):
        textured = image.convert("RGBA").getcolors(1) != [(4, (100, 100, 100, 255))]
    color = None
    if {"kd", "d", "tr"} & values.keys() or tuple(material.diffuse) != invented:
        color = _unorm(material.diffuse)
        kd = np.asarray(values.get("kd", ()))
        if kd.shape == (3,) and np.abs(np.clip(kd, 0, 1) - color[:3]).max() < 1 / 255:
            color[:3] = kd  # the file's own numbers, before trimesh rounded them
        if "d" in values:
            color[3] *= float(values["d"][-1])
        elif "tr" in values:
            color[3] *= 1 - float(values["tr"][-1])
    colors = _times_vertex_colors(part, color)
    return _Look(colors, "vertex" if np.ndim(colors) == 2 else None, textured=textured)


def _times_vertex_colors(part: _Part, color: np.ndarray | None) -> np.ndarray | None:
    """`color` (4,) times the vertex colours that trimesh keeps beside a material, if any: (N, 4)."""
    geometry = part.geometry
    values = geometry.visual.vertex_attributes.get("color", geometry.vertex_attributes.get("color"))
    if values is None or len(values) != len(geometry.vertices):
        return color
    values = _unorm(values)
    if values.shape[1] == 3:
        values = _with_alpha(values, 1.0)
    return values if color is None else values * color


def _unorm(values) -> np.ndarray:
    """float64 numbers; integers over their type's largest."""
    values = np.asarray(values)
    return values.astype(np.float64) / (np.iinfo(values.dtype).max if values.dtype.kind == "u" else 1)


def _parts(item) -> list[_Part]:
    """The nodes of `item` that can be drawn; the others are warned about."""
    what = "the trimesh.Scene"
    if isinstance(item, (str, os.PathLike)):
        what = repr(os.fspath(item))
        parts = _read(os.path.expanduser(os.fspath(item)))
    elif hasattr(item, "graph"):
        parts = _scene_parts(item)
    else:
        parts = [_Part(item.metadata.get("name"), item, np.eye(4))]
    drawable = [part for part in parts if hasattr(part.geometry, "faces")]
    if not drawable:
        raise SceneError(f"{what} has no triangles to draw (supported: {FORMATS})")
    if len(drawable) < len(parts):
        skipped = len(parts) - len(drawable)
        warnings.warn(f"{what}: {skipped} nodes are points or lines, not drawn", UserWarning, stacklevel=3)
    return drawable


def _scene_parts(scene) -> list[_Part]:
    nodes = [(node, *scene.graph[node]) for node in scene.graph.nodes_geometry]
    return [_Part(str(node), scene.geometry[key], np.asarray(matrix)) for node, matrix, key in nodes]


def _read(path: str) -> list[_Part]:
    if os.path.isdir(path):
        raise SceneError(f"{path!r} is a directory: give the path of a file (supported: {FORMATS})")
    if not os.path.isfile(path):
        raise SceneError(f"there is no file {path!r} (supported: {FORMATS})")
    needs = f"reading {path!r} needs trimesh 4.8 or newer: pip install 'abuffer[trimesh]'"
    try:
        import trimesh
    except ImportError as error:
        raise UnsupportedError(needs) from error
    if tuple(map(int, trimesh.__version__.split(".")[:2])) < (4, 8):  # these merge vertices all the same
        raise UnsupportedError(f"{needs} (this is {trimesh.__version__})")
    kind = os.path.splitext(path)[1].lower()
    try:
        if kind in (".glb", ".gltf"):
            return _read_gltf(path, trimesh)
        # process would merge vertices of different colours, group_material would reorder faces
        options = {"group_material": False} if kind == ".obj" else {}
        parts = _scene_parts(trimesh.load_scene(path, process=False, **options))
    except Exception as error:
        raise SceneError(f"cannot read {path!r} (supported: {FORMATS}): {error}") from error
    if kind == ".obj":  # trimesh takes the sections of an OBJ from its end
        parts = [part._replace(name=named.name) for part, named in zip(parts[::-1], parts, strict=True)]
    return parts


def _read_gltf(path: str, trimesh) -> list[_Part]:
    """A glTF's nodes in the file's order, with its materials as they stand in the file."""
    file = gltf.prepared(path)
    scene = trimesh.load_scene(
        io.BytesIO(file.data),
        file_type=file.kind,
        resolver=trimesh.resolvers.FilePathResolver(path),
        process=False,
    )
    parts = []
    for part in sorted(_scene_parts(scene), key=_node_index):
        visual = part.geometry.visual if hasattr(part.geometry, "faces") else None
        material = None if visual is None else file.materials[int(visual.material.name)]
        parts.append(part._replace(name=file.names[_node_index(part)], material=material))
    return parts


def _node_index(part: _Part) -> int:
    return int(part.name.split("_")[0])  # trimesh numbers the primitives of a node "3", "3_1", …
