"""One call from a scene to a frame."""

import inspect
import numbers
import os
import re

import numpy as np

from . import _check, _core, tables
from .blend import own_blends, require
from .camera import Camera, _size
from .errors import ParameterError
from .fragments import Fragments
from .frame import Frame, Plan, Stats
from .layers import render_by_layers
from .mesh import Mesh
from .options import OPTIONS, all_of, warn_of_clamping
from .options import samples as checked_samples
from .scene import as_scene


def render(
    scene,
    camera=None,
    *,
    width=None,
    height=None,
    method="exact",
    pipeline="auto",
    device="auto",
    samples=1,
    background=(0, 0, 0, 0),
    fragments=False,
    precision="float32",
    memory=None,
    **options,
) -> Frame:
    """Renders a scene: the exact image whatever order the triangles come in, and the lists behind it.

    Args:
        scene: Scene, or anything that `Scene.add` takes.
        camera: Camera. None: `Camera.fit(scene)`.
        width, height: pixels. None: the camera's own size, else the background image's, else 640×480.
        method: one of `methods()`.
        pipeline: "auto" or one of `pipelines()`.
        device: "auto", "cpu", "gpu" or a part of a device's name. "auto" is a real GPU if there is one, else
            the CPU; the environment variable ABUFFER_DEVICE sets what it means. "gpu" is the best adapter: a
            software driver where there is no other.
        samples: a pixel: 1, 2, 4, 8 or 16; all of them on the CPU, those that it has on a GPU.
        background: straight: grey, (3|4,) or (H, W, 3|4). Three channels have alpha 1.
        fragments: True: the lists too; "count": their lengths; "all": opaque surfaces too, hiding nothing. False:
            the frame's `fragments` and `counts` are None.
        precision: "float32", or "float64" on the CPU.
        memory: bytes, or "2GiB", that lists, bins and scratch may take; not what is returned.

    Options of every pipeline:
        msaa_resolve: what becomes of a pixel's samples. "per_pixel", the default: their mean, all made in one walk
            over the pixel's list. "per_sample": the same numbers, with a walk a sample. "hdr": a mean that weighs
            each by 1 / (1 + its largest colour channel). "none": the image is the samples, (H, W, samples, 4).
        sort: how lists are sorted, "auto" (default), "insertion", "selection", "bitonic", "merge" or "heap". The image
            is the same.
        max_sorted_fragments: composite at most so many fragments a pixel; `stats.dropped_fragments` says how many
            others there were. Lists that are returned are whole. None, the default: all, whatever their number.
        limit_policy: which those are, "nearest" (default) or "last_submitted", of the greatest primitives.
        blend_order: "front_to_back" (default) or "back_to_front": the direction in which sorted fragments are
            blended. The image is the same up to rounding. A scene with a `Blend` always goes back to front.

    Options of pipelines linked_list and prefix_sum:
        node_format: what a fragment is stored as. "float32", the default, loses nothing; "rgba8_depth32",
            "rgba8_depth24_coverage8", "rgb565_depth16" and "rgb9e5_alpha8_depth24" (colours over 1) are smaller and
            round colour and depth to so many bits.
        resolve: "compute" (default) or "fragment": the kind of shader that turns lists into colours. The image is
            the same.
        resolve_classes: up to 8 rising list lengths from 1 to 64, default (1, 4, 8, 16, 32, 64). Each pixel is resolved
            with room for the least of these that holds its list, longer ones apart. The image is the same.

    Raises:
        SceneError, ParameterError, DeviceError, UnsupportedError, CapacityError: see `abuffer.errors`.

    >>> triangle = Mesh([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], colors=(1, 0, 0, .5))
    >>> frame = render([triangle, triangle], width=64, height=48, device="cpu", fragments=True)
    >>> frame.image[24, 32].tolist(), frame.fragments[24, 32].primitive.tolist()
    ([0.75, 0.0, 0.0, 0.75], [1, 0])
    """
    _check.choice("method", method, tables.METHODS)
    _check.choice("pipeline", pipeline, ("auto", *tables.PIPELINES))
    if isinstance(precision, (type, np.dtype)):  # np.float64, say
        precision = np.dtype(precision).name
    _check.choice("precision", precision, ("float32", "float64"))
    _check.arguments("render", options, OPTIONS, f"method {method!r}", ARGUMENTS)
    samples = checked_samples(samples)
    if isinstance(fragments, np.bool_):
        fragments = bool(fragments)
    if not (isinstance(fragments, bool) or (isinstance(fragments, str) and fragments in ("count", "all"))):
        raise ParameterError(f'fragments must be False, "count", True or "all", got {fragments!r}')
    scene = as_scene(scene)
    if camera is None:
        camera = Camera.fit(scene)
    elif not isinstance(camera, Camera):
        raise ParameterError(f"camera must be an abuffer.Camera, got {type(camera).__name__}")
    width, height = _image_size(width, height, camera, background)
    camera = camera._at(width, height)
    background = _check.background(background, (height, width))
    plan = []
    meshes = [mesh for mesh in scene.meshes if mesh.face_count]  # primitives number the same without the others
    own = own_blends(mesh.blend for mesh in meshes)
    listed = fragments in (True, "all") or samples > 1 or any(mesh.blend != "over" for mesh in meshes) or bool(options)
    wants = tables.Wants(samples=samples, numpy=any(blend.wgsl is None for blend in own), lists=listed)
    adapter, pipeline = tables.choose(pipeline, device, precision, os.environ.get("ABUFFER_DEVICE"), plan, wants)
    require(own, *(("numpy", "the CPU") if adapter is None else ("wgsl", "a GPU")))
    request = all_of(options, pipeline) | {
        "width": width,
        "height": height,
        "lists": {False: "none", True: "translucent"}.get(fragments, fragments),
        "memory": _bytes(memory),
        "samples": samples,
        "pipeline": pipeline,
        "blends": [(blend.name or "blend", blend.wgsl) for blend in own],
    }
    warn_of_clamping(request["node_format"], meshes, fragments == "all")
    parts = [mesh._parts(own) for mesh in meshes]
    view = camera._parts(width, height)
    dtype = np.float64 if precision == "float64" else np.float32
    behind = np.ascontiguousarray(background, dtype) if background.ndim == 3 else background.astype(np.float64).tolist()
    if adapter is not None:
        output = _core.render_gpu(adapter, parts, view, request, behind)
    elif own:
        output = render_by_layers(parts, view, request, behind, dtype, own)
        plan.append(("compositing", "numpy, in float64", "a Blend is a callable here"))
    else:
        output = _core.render_cpu(parts, view, request, behind, dtype == np.float64)
    return _frame(output, request, scene, camera, plan, background, own)


ARGUMENTS = tuple(name for name in inspect.signature(render).parameters if name != "options")


def render_triangles(positions, colors, camera, **kw) -> Frame:
    """Renders (T, 3, 3) positions with colours as `Mesh` takes them: `render(Mesh(positions, ...), ...)`.

    >>> camera = Camera.look_at((0, 0, 3), (0, 0, 0))
    >>> frame = render_triangles([[[-1, -1, 0], [1, -1, 0], [0, 1, 0]]], (1, 1, 1), camera, device="cpu")
    >>> frame.image[240, 320].tolist()
    [1.0, 1.0, 1.0, 1.0]
    """
    return render(Mesh(positions, colors=colors), camera, **kw)


def _frame(output, request, scene, camera, plan, background, own):
    stats, shape, samples = output["stats"], (request["height"], request["width"]), request["samples"]
    plan += [tuple(row) for row in stats.pop("plan", ())]
    plan.append(
        ("bands", str(stats["bands"]), "all fits in memory" if stats["bands"] == 1 else "to stay within memory")
    )
    if request["lists"] != "none" and stats["fragments"] == 0 and scene.triangle_count:
        opaque = [mesh.opaque for mesh in scene.meshes if mesh.face_count]
        why = (
            'every mesh is opaque, and opaque surfaces are the background: fragments="all" lists them'
            if all(opaque)
            else "no translucent triangle covers a pixel in front of what is opaque"
        )
        plan.append(("fragments", "none", why))
    lists = None
    if "offsets" in output:
        lists = Fragments._of(shape, output, output.get("background", background), samples, own)
    each = (samples,) if request["msaa_resolve"] == "none" else ()
    image = output["image"].reshape(*shape, *each, 4)
    return Frame(image, output.get("counts"), lists, Stats(**stats), Plan(plan), camera)


def _image_size(width, height, camera, background):
    if (width is None) != (height is None):
        raise ParameterError("give both width and height, or neither")
    if width is None:
        image = np.shape(background)
        width, height = camera._size or (image[1::-1] if len(image) == 3 else (640, 480))
    return _size("width", width), _size("height", height)


def _bytes(memory):
    """Bytes from a number or text such as "2GiB", at most 2**63."""
    if memory is None:
        return None
    if isinstance(memory, numbers.Real) and not isinstance(memory, bool):
        size = memory
    else:
        pattern = r"\s*(\d+(?:\.\d+)?)\s*([kmgt]?)(i?)b?\s*"
        match = re.fullmatch(pattern, memory, re.IGNORECASE) if isinstance(memory, str) else None
        if not match:
            raise ParameterError(f'memory must be bytes or text such as "2GiB", got {memory!r}')
        number, prefix, binary = match.groups()
        size = float(number) * (1024 if binary else 1000) ** " kmgt".index(prefix.lower() or " ")
    if not size >= 1:  # NaN is not either
        raise ParameterError(f"memory must be at least 1 byte, got {memory!r}")
    return int(min(size, 2**63))  # infinity has no integer
