"""A render, checked, as the core takes it; and a frame of what the core gives."""

import inspect
import numbers
import os
import re
from dataclasses import dataclass, replace

import numpy as np

from . import _check, _core, _methods, own_methods, painter, tables
from .blend import own_blends, require
from .camera import Camera, _size
from .cutoff import least_transmittance
from .errors import CapacityError, ParameterError, UnsupportedError
from .fragments import Fragments
from .frame import Frame, Plan, Stats
from .layers import render_by_layers
from .options import EXACT_OPTIONS, NODE_OPTIONS, OPTIONS, all_of, warn_of_clamping
from .options import samples as checked_samples
from .scene import Scene, as_scene


@dataclass(frozen=True)
class Job:
    """One render, whose arguments are checked.

    Attributes:
        adapter: its place in `_core.adapters()`, None for the CPU.
        may_change: the pipeline was chosen, not asked for.
        own: the Blends of the scene.
        how: the method and its parameters.
        request, parts, view, behind: what the core takes.
    """

    scene: Scene
    camera: Camera
    adapter: int | None
    may_change: bool
    plan: list
    own: tuple
    how: _methods.Chosen
    background: np.ndarray
    request: dict
    parts: list
    view: dict
    behind: object
    dtype: type

    def output(self, upload=None):
        """What the core gives: of a GPU's `_core.Upload`, if there is one that has this scene."""
        if not self._lists_are_apart():
            return self._image(upload)
        image = replace(self, request=self.request | {"lists": "count"})._image(upload)
        # Of native forms, in tiles: their own rasteriser keeps no lists.
        pipeline = "tiles" if self.request["pipeline"] == "hardware" else self.request["pipeline"]
        exact = {"method": _methods.EXACT.parts(), "msaa_resolve": "per_pixel", "pipeline": pipeline}
        request = self.request | exact
        lists = replace(self, request=request, how=_methods.EXACT)._output(upload)
        stats = image["stats"] | {name: lists["stats"][name] for name in ("fragments", "max_depth_complexity")}
        stats["ms"] |= {f"lists: {stage}": ms for stage, ms in lists["stats"]["ms"].items()}
        return lists | {"image": image["image"], "stats": stats}

    def _lists_are_apart(self):
        """Whether the lists are rendered by `exact`, beside an image that comes without them."""
        method = self.how.method
        if method.id == "exact" or self.request["lists"] in ("none", "count"):
            return False
        # What is listed hides in the image; or is submitted in another order; or a GPU holds the method's state alone.
        return self.request["lists"] == "all" or method.sorts is not None or self.adapter is not None

    def _image(self, upload):
        return self._painted() if self.how.method.sorts else self._output(upload)

    def _output(self, upload):
        if self.adapter is not None:
            return self._on_gpu(upload or _core.Upload(self.adapter))
        if self.own or self.how.method.numpy is not None:
            what = "a Blend" if self.own else "your method"
            self.plan.append(("compositing", "numpy, in float64", f"{what} is a callable here"))
            return render_by_layers(self.parts, self.view, self.request, self.behind, self.dtype, self.own, self.how)
        return _core.render_cpu(self.parts, self.view, self.request, self.behind, self.dtype == np.float64)

    def _painted(self):
        """The same triangles, submitted in another order."""
        meshes = [mesh for mesh in self.scene.meshes if mesh.face_count]
        what, key = self.how.method.sorts, self.how.parameters["key"]
        self.plan.append(("painted", f"{what} by {key}", "the farthest first, all pixels in one order"))
        parts = [mesh._parts(()) for mesh in painter.in_order(meshes, self.camera, what, key)]
        return replace(self, parts=parts)._output(None)

    def _on_gpu(self, upload):
        try:
            return upload.render(self.parts, self.view, self.request, self.behind)
        except (CapacityError, UnsupportedError) as e:
            is_exact = self.how.method.id == "exact"
            if not (self.may_change and is_exact and self.request["pipeline"] == "tiles"):
                raise
            why = f"tiles cannot: {e}"
        # Which takes geometry and images in parts of any size.
        place = [what for what, *_ in self.plan].index("pipeline")
        self.plan[place] = ("pipeline", "linked_list", why)
        return upload.render(self.parts, self.view, self.request | {"pipeline": "linked_list"}, self.behind)

    def begin(self, upload):
        """Gives a GPU the frame without waiting; None where `output` has to make it, or to say why nobody can."""
        try:
            return upload.begin(self.parts, self.view, self.request, self.behind)
        except (CapacityError, UnsupportedError):
            return None

    def finish(self, upload, begun):
        """What the core gives of a frame that `begin` gave it."""
        try:
            output = upload.finish(begun)
        except (CapacityError, UnsupportedError):
            output = None
        return output or self.output(upload)

    def frame(self, output) -> Frame:
        """The frame that `output` holds."""
        request, scene, plan = self.request, self.scene, list(self.plan)
        stats, shape, samples = output["stats"], (request["height"], request["width"]), request["samples"]
        plan += [tuple(row) for row in stats.pop("plan", ())]
        plan.append(
            ("bands", str(stats["bands"]), "all fits in memory" if stats["bands"] == 1 else "to stay within memory")
        )
        if request["cutoff"] > 0:
            why = f"a list may be left where at most {request['least_transmittance']:.3g} is let through"
            plan.append(("cutoff", f"{request['cutoff']:g}", why))
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
            lists = Fragments._of(shape, output, output.get("background", self.background), samples, self.own)
        each = (samples,) if request["msaa_resolve"] == "none" else ()
        image = output["image"].reshape(*shape, *each, 4)
        return Frame(
            image, output.get("counts"), lists, Stats(**stats, error_bound=request["cutoff"]), Plan(plan), self.camera
        )


def prepared(
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
) -> Job:
    """The job that `render` has with these arguments, which it documents."""
    _check.choice("pipeline", pipeline, ("auto", *tables.PIPELINES))
    if isinstance(precision, (type, np.dtype)):  # np.float64, say
        precision = np.dtype(precision).name
    _check.choice("precision", precision, ("float32", "float64"))
    others = EXACT_OPTIONS if method == "exact" else OPTIONS
    how = _methods.chosen(method, options, others, "render", ARGUMENTS)
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
    modes = [mesh.blend for mesh in meshes if mesh.blend != "over" and not mesh.opaque]
    how.refuse_modes(modes)
    own = own_blends(mesh.blend for mesh in meshes)
    wants = tables.Wants(
        samples=samples,
        numpy=any(blend.wgsl is None for blend in own) or (how.method.numpy is not None and how.method.wgsl is None),
        case=_case(meshes, samples, fragments, options),
        streams=method != "exact",
        triangles=scene.triangle_count,
        nodes=any(name in options for name in NODE_OPTIONS),
    )
    may_change = pipeline == "auto"
    adapter, pipeline = tables.choose(pipeline, device, precision, os.environ.get("ABUFFER_DEVICE"), plan, wants)
    needed = ("numpy", "the CPU") if adapter is None else ("wgsl", "a GPU")
    require(own, *needed)
    own_methods.require(how, *needed)
    how.require(pipeline, samples, modes)
    if pipeline == "hardware":
        plan.append(("cost", "native", "times are those of the method's published form on the hardware's rasteriser"))
    elif method != "exact":
        plan.append(("cost", "replayed", "times are those of a walk over tiles, not of the method's published form"))
    nearest, farthest = how.depth_range or _depth_range(meshes, camera, how)
    if how.method.takes_range:
        why = "as asked" if how.depth_range else "of the translucent vertices: depth_range= sets it"
        plan.append(("depth range", f"{nearest:g} to {farthest:g}", why))
    request = all_of(options, pipeline) | {
        "method": how.parts(nearest, farthest),
        "width": width,
        "height": height,
        "lists": {False: "none", True: "translucent"}.get(fragments, fragments),
        "memory": _bytes(memory),
        "samples": samples,
        "pipeline": pipeline,
        "blends": [(blend.name or "blend", blend.wgsl) for blend in own],
    }
    blends, colors = [mesh.blend for mesh in meshes], [*(mesh.colors for mesh in meshes), background]
    request["least_transmittance"] = least_transmittance(request["cutoff"], blends, colors, request, samples)
    warn_of_clamping(request["node_format"], meshes, fragments == "all")
    dtype = np.float64 if precision == "float64" else np.float32
    behind = np.ascontiguousarray(background, dtype) if background.ndim == 3 else background.astype(np.float64).tolist()
    return Job(
        scene=scene,
        camera=camera,
        adapter=adapter,
        may_change=may_change,
        plan=plan,
        own=own,
        how=how,
        background=background,
        request=request,
        parts=[mesh._parts(own) for mesh in meshes],
        view=camera._parts(width, height),
        behind=behind,
        dtype=dtype,
    )


ARGUMENTS = (*(name for name in inspect.signature(prepared).parameters if name != "options"), "max_error")


# The nearest depth where an eye is amid a scene, as a share of the farthest: a logarithm has no place for 0.
NEAREST = 1e-3


def _depth_range(meshes, camera, how):
    """The depths that a method normalises by: from the nearest translucent vertex to the farthest."""
    if not how.method.takes_range:
        return None, None
    axis = camera.view[2]
    depths = [-(mesh.used_positions() @ axis[:3] + axis[3]) for mesh in meshes if not mesh.opaque]
    if not depths:
        return 0.0, 0.0
    nearest, farthest = min(float(d.min()) for d in depths), max(float(d.max()) for d in depths)
    if camera.is_perspective and nearest <= 0:
        nearest = NEAREST * max(farthest, 0.0)
    return nearest, farthest


def _case(meshes, samples, fragments, options):
    """What a GPU has to do (see `measured.CASES`)."""
    if any(mesh.blend != "over" for mesh in meshes) or options.keys() - {"cutoff"}:
        return "stored"
    if fragments == "all" and any(mesh.opaque for mesh in meshes):
        return "stored"
    if samples > 1:
        return "samples"
    return "lists" if fragments in (True, "all") else "image"


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
