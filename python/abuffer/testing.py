"""Checks of other renderers' images, for tests.

What is compared, and what is left out, is told by `assert_matches_reference`.
"""

import os
import warnings
from pathlib import Path

import numpy as np

from . import _check, _core, options
from .camera import Camera
from .diagnosis import Case, Form, Rendering, difference, explanations, is_off, shifted, silhouette_off
from .errors import ParameterError, UnsupportedError
from .frame import Frame
from .render import render
from .scene import as_scene

NEAR_TIE = 1e-5  # relative depth difference that a float32 renderer may order either way
MANY = 0.1  # of the pixels of two silhouettes: if more are in one alone, the cameras may differ
LISTED = 12  # fragments of the worst pixel that a message lists
SMOOTHED = 0.75  # pixels: an edge that is no nearer to a pixel's centre does not cross the pixel
CHUNK = 1 << 21  # pixels next to edges that are looked at together


def assert_matches_reference(
    image,
    scene,
    camera,
    *,
    background=(0, 0, 0, 0),
    samples=1,
    srgb=False,
    premultiplied=False,
    tolerance=1 / 255,
    edge=1 / 64,
    save_failure=None,
):
    """Asserts that an image of any renderer is what `scene` looks like, and says what is wrong if it is not.

    The reference is the exact method in float64 on the CPU, at the image's size, with one sample a pixel; every mesh
    is blended by its own mode. Compared are colour times alpha, and alpha. Not compared are pixels whose centre is
    within `edge` pixels of a projected triangle edge, and near ties: pixels in which two fragments in a row differ in
    depth by less than 1e-5 of it but are not exactly equal.

    An antialiased image, of whatever renderer, is checked with edge=0.75: that leaves out all pixels that an edge
    crosses. If it is the mean of samples in the standard positions of Vulkan and Direct3D, give their number as
    `samples` instead, and edges are compared too: the reference has as many then, and only pixels are left out in
    which an edge is within `edge` of a sample or of the centre. A fragment has one colour and one depth in a pixel, as
    in `render`; a renderer that shades or sorts each sample by itself may differ where colours are steep at an edge,
    and where triangles cross.

    Args:
        image: path of a PNG, or (H, W, 3|4) uint8 or floats, row 0 on top, or a Frame, whose `image` it then is, or the
            mean of its samples if that holds samples. Of 3 channels RGB alone is compared, with the reference over its
            background, and that over black where it is translucent.
        scene: Scene or what `Scene.add` takes. A `Blend` in it needs its `numpy`.
        camera: Camera.
        background: straight: grey, (3|4,) or (H, W, 3|4).
        samples: of the reference, a pixel: 1, 2, 4, 8 or 16.
        srgb: the image is sRGB-encoded. The reference is then brought into the image's form, straight or
            premultiplied, and encoded; the tolerance is in encoded values.
        premultiplied: the image's colours are; straight otherwise.
        tolerance: largest difference of a channel that passes, of 1.
        edge: pixels.
        save_failure: where to write image, reference and difference (the largest white) side by side if they differ:
            a path that ends in .png, or a directory.

    Raises:
        AssertionError: they differ, the image is not finite, no triangle is in view, or nothing is left to be
            compared.
        ParameterError: an image of another shape, type or aspect ratio; an array of samples, which must be averaged.
        UnsupportedError: a path is given and Pillow is not installed.

    Warns if under half of the pixels that show geometry are compared.

    >>> import abuffer as ab
    >>> triangle = ab.Mesh([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], colors=(1, 0, 0, .5))
    >>> camera = ab.Camera.look_at((0, 0, 3), (0, 0, 0))
    >>> image = ab.render(triangle, camera, width=64, height=48, device="cpu").to_uint8()
    >>> assert_matches_reference(image, triangle, camera)
    >>> assert_matches_reference(image[::-1], triangle, camera)
    Traceback (most recent call last):
        ...
    AssertionError: the image differs from the reference: ...
    """
    __tracebackhide__ = True  # pytest then shows the caller's line
    tolerance, edge = _check.number("tolerance", tolerance, 0), _check.number("edge", edge, 0)
    samples = options.samples(samples)
    if isinstance(image, Frame):
        image, premultiplied = image.image, True
        if image.ndim == 4:
            image = image.mean(axis=2, dtype=np.float64)
    pixels, clipped = _pixels(image)
    if not isinstance(camera, Camera):
        raise ParameterError(f"camera must be an abuffer.Camera, got {type(camera).__name__}")
    _assert_finite(pixels)
    scene = as_scene(scene)

    settings = {"background": background, "width": pixels.shape[1], "height": pixels.shape[0]}
    settings |= {"device": "cpu", "precision": "float64", "samples": samples}

    form = Form(pixels.shape[-1], bool(premultiplied), bool(srgb), clipped)
    reference, left_out = _reference(scene, camera, settings, edge)
    if not reference.shown.any():
        raise AssertionError(_nothing_in_view(scene, pixels.shape))
    if not reference.compared.any():
        raise AssertionError(f"no pixel can be compared: {left_out}")
    got, expected = form.of_image(pixels), form.of_reference(reference.image)
    distance = np.where(reference.compared, difference(got, expected), 0)
    if not is_off(distance, tolerance).any():
        return
    case = Case(
        pixels,
        form,
        tolerance,
        scene,
        camera,
        background,
        reference,
        another=lambda scene=scene, **changes: render(scene, camera, **(settings | changes)).image,
        seen_by=lambda other: _reference(scene, other, settings, edge)[0],
    )
    lines = [
        *_summary(form, got, expected, distance, reference.compared, tolerance, left_out),
        *_worst(form, got, expected, distance, reference.fragments, scene),
        *_diagnosis(case, samples),
    ]
    if save_failure is not None:
        lines.append(f"image | reference | difference: {_save(save_failure, form, got, expected, distance)}")
    raise AssertionError("\n".join(lines))


def edge_band(scene, camera, width, height, edge) -> np.ndarray:
    """(H, W) bool: pixels whose centre is less than `edge` pixels from a projected triangle edge.

    Edges count where they are in front of the eye and between near and far; the lines in which near and far cut
    triangles are edges too.

    >>> import abuffer as ab
    >>> square = ab.Mesh([[-2, 0, 0], [2, 0, 0], [2, 5, 0], [-2, 5, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> camera = ab.Camera.orthographic((0, 0, 1), (0, 0, 0), height=3)
    >>> edge_band(ab.Scene(square), camera, 4, 3, .01)[:, 0].tolist()
    [False, True, False]
    """
    parts = camera._parts(width, height)
    view, projection = parts["view"], parts["projection"]
    eye = scene.triangles() @ view[:3, :3].T + view[:3, 3]
    x, y, w = np.moveaxis(eye @ projection[[0, 1, 3], :3].T + projection[[0, 1, 3], 3], -1, 0)
    # Pixel coordinates times w, w and depth: all affine along an edge, so that it can be cut before the divide.
    corners = np.stack([(w + x) * (width / 2), (w - y) * (height / 2), w, -eye[..., 2]], axis=-1)
    segments = [np.stack([corners[:, i], corners[:, j]], axis=1) for i, j in ((0, 1), (1, 2), (2, 0))]
    limits = [(parts[name], sign) for name, sign in (("near", 1), ("far", -1)) if parts[name] is not None]
    segments += [_cuts(corners, plane) for plane, _ in limits]

    # What must not be negative: further out than `edge`, or beyond near and far, nothing is within reach.
    margin = edge + 1
    rules = [(1, 0, margin), (-1, 0, width + margin), (0, 1, margin), (0, -1, height + margin)]
    rules = [np.array([*rule, 0.0]) for rule in rules]
    inside = [(rule, 0.0) for rule in rules] + [(np.array([0, 0, 0, sign]), -sign * plane) for plane, sign in limits]
    a, b = _clipped(np.concatenate(segments), inside)
    band = np.zeros((height, width), dtype=bool)
    if edge > 0:
        steep = np.abs(b - a)[:, 1] > np.abs(b - a)[:, 0]
        _mark(band, a[~steep], b[~steep], edge)
        _mark(band.T, a[steep][:, ::-1], b[steep][:, ::-1], edge)
    return band


def _cuts(corners, plane):
    """Segments (N, 2, 4) in which triangles (T, 3, 4) cross a depth."""
    a, b = corners, np.roll(corners, -1, axis=1)
    above, next_above = a[..., 3] - plane, b[..., 3] - plane
    crossing = (above < 0) != (next_above < 0)  # on none or two of a triangle's edges
    above, next_above = above[crossing], next_above[crossing]
    at = (above / (above - next_above))[:, None]
    return (a[crossing] + at * (b[crossing] - a[crossing])).reshape(-1, 2, 4)


def _clipped(segments, inside):
    """The part of segments (N, 2, 4) where the affine functions `inside` are not negative, in pixels: two (N', 2)."""
    a, b = segments[:, 0], segments[:, 1]
    begin, end = np.zeros(len(a)), np.ones(len(a))
    kept = np.ones(len(a), dtype=bool)
    for factors, offset in inside:
        fa, fb = a @ factors + offset, b @ factors + offset
        kept &= (fa >= 0) | (fb >= 0)
        entering, leaving = np.flatnonzero((fa < 0) & (fb >= 0)), np.flatnonzero((fa >= 0) & (fb < 0))
        for which, ends, nearest in ((entering, begin, np.maximum), (leaving, end, np.minimum)):
            ends[which] = nearest(ends[which], fa[which] / (fa[which] - fb[which]))
    kept &= begin <= end
    a, b, begin, end = a[kept], b[kept], begin[kept, None], end[kept, None]
    a, b = np.where(begin > 0, a + begin * (b - a), a), np.where(end < 1, a + end * (b - a), b)
    seen = (a[:, 2] > 0) & (b[:, 2] > 0)  # the eye itself is nowhere in the image
    return a[seen, :2] / a[seen, 2:3], b[seen, :2] / b[seen, 2:3]


def _mark(band, a, b, edge):
    """Sets the pixels of band[v, u] within reach of segments (N, 2) in (u, v), at most as steep as a diagonal."""
    length, count = band.shape[1], len(a)
    if not count:
        return
    back = a[:, 0] > b[:, 0]
    a, b = np.where(back[:, None], b, a), np.where(back[:, None], a, b)
    along = b - a
    square = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    slope = np.divide(along[:, 1], along[:, 0], out=np.zeros(count), where=along[:, 0] > 0)
    first = np.clip(np.ceil(a[:, 0] - edge - 0.5), 0, length).astype(np.int64)
    last = np.clip(np.floor(b[:, 0] + edge - 0.5), -1, length - 1).astype(np.int64)
    columns = np.maximum(last - first + 1, 0)
    ends = np.cumsum(columns)
    # Beside the line, and beside its continuation next to an end, what is within reach is at most 2·edge away in v.
    reach = max(int(np.ceil(2 * edge - 0.5)), 0)
    stops = np.unique(np.append(np.searchsorted(ends, np.arange(CHUNK, ends[-1], CHUNK)), count))
    for start, stop in zip(np.append(0, stops[:-1]), stops, strict=True):
        of = np.repeat(np.arange(start, stop), columns[start:stop])
        u = np.arange(len(of)) - (ends[of] - columns[of] - (ends[start] - columns[start])) + first[of]
        beside = u + 0.5 - a[of, 0]
        nearest = np.floor(a[of, 1] + slope[of] * beside).astype(np.int64)
        for v in range(-reach, reach + 1):
            v = nearest + v
            above = v + 0.5 - a[of, 1]
            at = np.clip((beside * along[of, 0] + above * along[of, 1]) / square[of], 0, 1)
            squared = (beside - at * along[of, 0]) ** 2 + (above - at * along[of, 1]) ** 2
            hit = (squared < edge**2) & (v >= 0) & (v < band.shape[0])
            band[v[hit], u[hit]] = True


def _pixels(image):
    """The image as float64 (H, W, 3|4), and whether its numbers were integers."""
    if isinstance(image, (str, os.PathLike)):
        image = _read_png(image)
    try:
        array = np.asarray(image)
    except ValueError as e:
        raise ParameterError(f"image is not an array: {e}") from None
    if array.ndim != 3 or array.shape[2] not in (3, 4) or not array.size:
        hint = ": move the channels to the end" if array.ndim == 3 and array.shape[0] in (3, 4) else ""
        if array.ndim == 4:
            hint = ": average samples first, as premultiplied colours, image.mean(axis=2); of a batch give one image"
        raise ParameterError(f"image must have shape (H, W, 3) or (H, W, 4), got {array.shape}{hint}")
    if array.dtype == np.uint8:
        return array / 255.0, True
    if array.dtype.kind != "f":
        raise ParameterError(f"image must be uint8 or floats, got dtype {array.dtype}: divide it by its largest value")
    return array.astype(np.float64), False


def _read_png(path):
    """(H, W, 3|4) uint8. Grey becomes RGB, a palette RGB or RGBA."""
    path = os.path.expanduser(path)
    with open(path, "rb") as file:
        head = file.read(26)
    if head[:8] != b"\x89PNG\r\n\x1a\n":
        raise ParameterError(f"{path!r} is not a PNG: read it yourself and give the array")
    if head[24:25] == b"\x10":
        # Pillow would keep the upper 8 bits without a word.
        raise ParameterError(f"{path!r} has 16 bits a channel: read it yourself and give the array divided by 65535")
    try:
        from PIL import Image
    except ImportError as e:
        raise UnsupportedError("reading a PNG needs Pillow: pip install pillow, or give an array") from e
    with Image.open(path) as file:
        has_alpha = "A" in file.mode or "transparency" in file.info
        return np.array(file.convert("RGBA" if has_alpha else "RGB"))


def _assert_finite(pixels):
    __tracebackhide__ = True
    bad = ~np.isfinite(pixels).all(axis=-1)
    if bad.any():
        y, x = (int(i) for i in np.argwhere(bad)[0])
        raise AssertionError(
            f"the image is not finite in {int(bad.sum()):,} of {bad.size:,} pixels, first [y, x] = [{y}, {x}]: "
            f"{_numbers(pixels[y, x])}"
        )


def _reference(scene, camera, settings, edge):
    """The reference, and what of it is not compared, in words. `settings` are those of `render`."""
    width, height, samples = (settings[name] for name in ("width", "height", "samples"))
    frame = render(scene, camera, fragments=True, **settings)
    seen = [camera]  # from the centre, and from each sample
    if samples > 1:
        seen += [shifted(camera, -x / 16, -y / 16, width, height) for x, y in _core.sample_positions(samples)]
    lists = [frame.fragments]
    if any(mesh.opaque for mesh in scene.meshes):
        # What is opaque ties too, with what is next to it and with other opaque surfaces, and in each sample apart.
        lists += [render(scene, at, fragments="all", **settings | {"samples": 1}).fragments for at in seen]
    band = np.any([edge_band(scene, at, width, height, edge) for at in seen], axis=0)
    ties = np.any([_near_ties(frags) for frags in lists], axis=0) & ~band
    compared = ~(band | ties)
    near = "an edge" if samples == 1 else "an edge, at a sample or the centre"
    left_out = (
        f"{int(band.sum()):,} pixels ({band.mean():.2%}) are within {edge:.3g} px of {near}, "
        f"{int(ties.sum()):,} ({ties.mean():.2%}) have near ties in depth"
    )
    shown = np.any([frags.counts > 0 for frags in lists], axis=0)
    if compared.any() and shown.any() and compared[shown].mean() < 0.5:
        share = f"{compared[shown].mean():.0%} of the pixels that show geometry"
        warnings.warn(f"only {share} are compared: {left_out}", UserWarning, stacklevel=3)
    return Rendering(frame.image, frame.fragments, compared, shown), left_out


def _nothing_in_view(scene, shape):
    """Why a reference that shows nothing is no reference."""
    what = f"no triangle is in view of this camera at {shape[1]}×{shape[0]}, so that any background would pass"
    if not scene.triangle_count:
        return f"{what}: the scene has no triangles"
    return (
        f"{what}: check world_to_camera against camera_to_world. Camera and Camera.from_intrinsics take "
        f"world_to_camera, Camera.from_pose takes camera_to_world. The scene's bounds are {scene.bounds.tolist()}"
    )


def _near_ties(frags):
    """(H, W) bool: pixels in which two fragments in a row, of one sample, are so close that float32 may swap them."""
    ties = np.zeros(frags.shape[0] * frags.shape[1], dtype=bool)
    for sample in range(frags.samples):
        there = slice(None) if frags.coverage is None else frags.coverage >> sample & 1 == 1
        pixel, depth, key = frags.pixel[there], frags.depth[there], frags.key[there]
        nearer, farther = depth[:-1], depth[1:]
        close = (pixel[1:] == pixel[:-1]) & (farther - nearer < NEAR_TIE * np.abs(farther)) & (key[1:] != key[:-1])
        ties[pixel[1:][close]] = True
    return ties.reshape(frags.shape)


def _summary(form, got, expected, distance, compared, tolerance, left_out):
    off, total = int(is_off(distance, tolerance).sum()), int(compared.sum())
    rmse = np.sqrt(((got - expected)[compared] ** 2).mean())
    what = "RGBA, premultiplied" if form.channels == 4 else "RGB"
    yield (
        f"the image differs from the reference: {off:,} of {total:,} compared pixels ({off / total:.2%}) "
        f"by more than {tolerance:.4g}"
    )
    yield f"largest difference {distance.max():.4g}, RMSE {rmse:.4g} ({what}{', sRGB-encoded' if form.srgb else ''})"
    yield f"not compared: {left_out}"


def _worst(form, got, expected, distance, frags, scene):
    y, x = (int(i) for i in np.unravel_index(distance.argmax(), distance.shape))
    yield f"worst pixel [y, x] = [{y}, {x}]: got {_numbers(got[y, x])}, expected {_numbers(expected[y, x])}"
    rows, behind = frags[y, x], _behind(frags.background[y, x])
    if not len(rows):
        yield f"no translucent fragment there; behind it {behind}, straight RGBA"
        return
    mesh, face = scene.locate(rows.primitive[:LISTED])
    yield f"its {len(rows)} fragments, front to back:" if len(rows) > 1 else "its only fragment:"
    wide = max(frags.samples, len("samples"))
    title = f"{'samples':<{wide}}  " if frags.samples > 1 else ""
    yield f"  {'depth':>12}  {'straight RGBA':<32}  {title}primitive  mesh"
    for row, m, f in zip(rows[:LISTED], mesh, face, strict=True):
        name = scene.meshes[m].name or f"mesh {m}"
        mask = f"{f'{row.coverage:0{frags.samples}b}':<{wide}}  " if frags.samples > 1 else ""
        yield f"  {row.depth:>12.7g}  {_numbers(row.color):<32}  {mask}{row.primitive:>9}  {name}, face {f}"
    if len(rows) > LISTED:
        yield f"  and {len(rows) - LISTED} more behind them"
    yield f"  behind them {behind}, straight RGBA, opaque surfaces included"


def _behind(background):
    """A pixel's background (4,), or that of its samples (S, 4), in words."""
    colors, counts = np.unique(background.reshape(-1, 4), axis=0, return_counts=True)
    if len(colors) == 1:
        return _numbers(colors[0])
    each = zip(colors, counts, strict=True)
    return ", ".join(f"{_numbers(color)} in {count} sample{'s' if count > 1 else ''}" for color, count in each)


def _diagnosis(case, samples):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what is left out of a hypothesis is no news
        found, tried = explanations(case)
    if not found:
        yield f"none of the usual mistakes explains it; tried: {', '.join(tried)}"
        agreeing = _smoothed(case)
        if agreeing:
            yield (
                f"all of them are next to edges, and the {agreeing:,} others that show geometry agree: edges may be "
                f"smoothed in another way than by samples={samples}, so give the image's own samples=, or edge={SMOOTHED}"
            )
        share = silhouette_off(case)
        if share > MANY and not agreeing:
            yield f"the silhouettes differ in {share:.0%} of the pixels that either one covers: check the camera"
        return
    yield "what would explain it, best first (and how many of the pixels would still be off):"
    for name, what, share in found:
        yield f"  {name}: {what} ({share:.2%} off)"


def _smoothed(case):
    """How many pixels show geometry and no edge, if all of these agree and many of those with an edge are off; or 0."""
    height, width = case.pixels.shape[:2]
    crossed = edge_band(case.scene, case.camera, width, height, SMOOTHED)
    compared, shown = case.rendering.compared, case.rendering.shown
    form = case.form
    off = is_off(difference(form.of_image(case.pixels), form.of_reference(case.rendering.image)), case.tolerance)
    if (off & compared & ~crossed).any() or (off & compared).sum() <= MANY * (crossed & compared).sum():
        return 0
    return int((compared & shown & ~crossed).sum())


def _save(where, form, got, expected, distance):
    """Writes the three pictures side by side, and returns the path."""
    path = Path(where)
    if path.suffix.lower() != ".png":
        # Never the file that another failure's message names.
        names = ("mismatch.png", *(f"mismatch-{i}.png" for i in range(2, 10**6)))
        path = next(path / name for name in names if not (path / name).exists())
    path.parent.mkdir(parents=True, exist_ok=True)
    shades = np.broadcast_to((distance / distance.max())[..., None], (*distance.shape, 3))
    gap = np.zeros((len(distance), 4, 4))
    panels = [_straight(form, got), gap, _straight(form, expected), gap, np.pad(shades, ((0, 0), (0, 0), (0, 1)))]
    panels[-1][..., 3] = 1
    picture = np.clip(np.concatenate(panels, axis=1), 0, 1)
    path.write_bytes(_core.encode_png(np.rint(picture * 255).astype(np.uint8)))
    return path


def _straight(form, compared):
    """What is compared as straight RGBA, for a picture."""
    if form.channels == 3:
        return np.pad(compared, ((0, 0), (0, 0), (0, 1)), constant_values=1)
    alpha = compared[..., 3:]
    rgb = np.divide(compared[..., :3], alpha, out=np.zeros_like(compared[..., :3]), where=alpha > 0)
    return np.concatenate([rgb, alpha], axis=-1)


def _numbers(values):
    return f"({', '.join(f'{float(v):.4g}' for v in values)})"
