"""One call from a scene to a frame."""

from . import within
from .frame import Frame
from .job import prepared
from .mesh import Mesh


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
    max_error=None,
    **options,
) -> Frame:
    """Renders a scene: the exact image whatever order the triangles come in, and the lists behind it.

    Args:
        scene: Scene, or anything that `Scene.add` takes.
        camera: Camera. None: `Camera.fit(scene)`.
        width, height: pixels. None: the camera's own size, else the background image's, else 640×480.
        method: one of `methods()`, which says the pipelines that have each.
        pipeline: "auto" or one of `pipelines()`.
        device: "auto", "cpu", "gpu" or a part of a device's name. "auto" is a real GPU if there is one, else
            the CPU; the environment variable ABUFFER_DEVICE sets what it means. "gpu" is the best adapter: a
            software driver where there is no other.
        samples: a pixel: 1, 2, 4, 8 or 16; all of them on the CPU, those that it has on a GPU.
        background: straight: grey, (3|4,) or (H, W, 3|4). Three channels have alpha 1.
        fragments: True: the lists too; "count": their lengths; "all": opaque surfaces too, hiding nothing. False:
            the frame's `fragments` and `counts` are None.
        precision: "float32", or "float64" on the CPU.
        max_error: let the image be off by up to this in every channel, wherever that is proven to be all, and take the cheapest
            method for it: `frame.plan` says which and why, and `frame.error_bound` by how much each pixel may be off, beside
            the same fragments composited exactly. None, the default: as `method` says.
        memory: bytes, or "2GiB", that lists, bins and scratch may take; not what is returned.

    Options of every method:
        msaa_resolve: what becomes of a pixel's samples. "per_pixel", the default: their mean, all made in one walk
            over the pixel's list. "per_sample": the same numbers, with a walk a sample. "hdr": a mean that weighs
            each by 1 / (1 + its largest colour channel). "none": the image is the samples, (H, W, samples, 4).

    Options of the other methods are their parameters, which `methods()` lists, and of those that normalise depths:
        depth_range: (nearest, farthest) in eye depth. None, the default: those of the translucent vertices.

    Options of pipeline hardware:
        targets: what colours are drawn as, and summed in: "float32", the default, or "float16", as most were published: up to
            four times as fast, with a rounding for each fragment, and infinite or stuck where sums grow large.

    Options of method "exact", on every pipeline:
        sort: how lists are sorted, "auto" (default), "insertion", "selection", "bitonic", "merge" or "heap". The image
            is the same.
        max_sorted_fragments: composite at most so many fragments a pixel; `stats.dropped_fragments` says how many
            others there were. Lists that are returned are whole. None, the default: all, whatever their number.
        limit_policy: which those are, "nearest" (default) or "last_submitted", of the greatest primitives.
        blend_order: "front_to_back" (default) or "back_to_front": the direction in which sorted fragments are
            blended. The image is the same up to rounding. A scene with a `Blend` always goes back to front.
        cutoff: front to back, leave a list as soon as what lies behind can change no channel by more than this, alpha
            among them; the background then shows in its place. Counts and lists stay whole. `stats.error_bound` is
            this again. 0, the default: where it changes no bit. More is for scenes that are all "over".

    Options of method "exact" on pipelines linked_list and prefix_sum:
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
    arguments = {
        "width": width,
        "height": height,
        "method": method,
        "pipeline": pipeline,
        "device": device,
        "samples": samples,
        "background": background,
        "fragments": fragments,
        "precision": precision,
        "memory": memory,
        **options,
    }
    if max_error is not None:
        return within.rendered(scene, camera, arguments, max_error)
    job = prepared(scene, camera, **arguments)
    return job.frame(job.output())


def render_triangles(positions, colors, camera, **kw) -> Frame:
    """Renders (T, 3, 3) positions with colours as `Mesh` takes them: `render(Mesh(positions, ...), ...)`.

    >>> from abuffer import Camera
    >>> camera = Camera.look_at((0, 0, 3), (0, 0, 0))
    >>> frame = render_triangles([[[-1, -1, 0], [1, -1, 0], [0, 1, 0]]], (1, 1, 1), camera, device="cpu")
    >>> frame.image[240, 320].tolist()
    [1.0, 1.0, 1.0, 1.0]
    """
    return render(Mesh(positions, colors=colors), camera, **kw)
