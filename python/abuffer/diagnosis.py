"""What would explain that an image differs from the reference: usual mistakes, made on purpose and compared."""

import copy
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ._srgb import encode_srgb
from .camera import Camera
from .scene import Scene

EXPLAINS = 0.1  # a hypothesis is named if at most this part of the pixels that are off stays off
ROUNDING = 1e-9  # of these comparisons' own float64 arithmetic: a difference of exactly the tolerance passes


class Rendering(NamedTuple):
    """One reference: premultiplied image (H, W, 4), its lists, and two (H, W) bool."""

    image: np.ndarray
    fragments: Any
    compared: np.ndarray  # pixels that it can vouch for
    shown: np.ndarray  # pixels that show geometry


@dataclass(frozen=True)
class Form:
    """How the numbers of the image under test are meant, and how a reference is brought into that form.

    What is compared is colour times alpha (and alpha, where there is one), so that the colours of invisible pixels
    do not matter.
    """

    channels: int
    premultiplied: bool
    srgb: bool
    clipped: bool  # integers cannot hold more than 1

    def of_image(self, pixels):
        """Pixels as given, (H, W, C), as what is compared."""
        if self.channels == 3 or self.premultiplied:
            return pixels
        return np.concatenate([pixels[..., :3] * pixels[..., 3:], pixels[..., 3:]], axis=-1)

    def of_reference(self, image):
        """A premultiplied rendering, (H, W, 4), as what is compared, (H, W, C)."""
        rgb, alpha = image[..., :3], image[..., 3:]
        straight = self.channels == 4 and not self.premultiplied
        if straight:
            rgb = _divided(rgb, alpha)
        if self.srgb:
            rgb = encode_srgb(rgb)
        if self.clipped:
            rgb = np.clip(rgb, 0, 1)
        if straight:
            rgb = rgb * alpha
        return rgb if self.channels == 3 else np.concatenate([rgb, alpha], axis=-1)

    def blended(self, pixels):
        """Pixels as given, as the premultiplied numbers that were blended: the inverse of `of_reference`."""
        rgb = decode_srgb(pixels[..., :3]) if self.srgb else pixels[..., :3]
        if self.channels == 3:
            return rgb
        alpha = pixels[..., 3:]
        return np.concatenate([rgb if self.premultiplied else rgb * alpha, alpha], axis=-1)


@dataclass(frozen=True)
class Case:
    """An image that fails, what it was compared with, and ways to other references."""

    pixels: np.ndarray
    form: Form
    tolerance: float
    scene: Scene
    camera: Camera
    background: Any
    rendering: Rendering
    another: Callable[..., np.ndarray]  # (scene=, background=) to a premultiplied image
    seen_by: Callable[[Camera], Rendering]


class Hypothesis(NamedTuple):
    name: str
    what: str
    image: np.ndarray
    candidate: np.ndarray
    compared: np.ndarray


class Explanation(NamedTuple):
    name: str
    what: str
    share: float  # of the compared pixels that are off by more than the tolerance if the hypothesis holds


def difference(image, reference):
    """Largest difference of a pixel's channels, (H, W)."""
    return np.abs(image - reference).max(axis=-1)


def is_off(distance, tolerance):
    return distance > tolerance + ROUNDING


def explanations(case) -> tuple[list[Explanation], list[str]]:
    """What explains the image, best first, and the names of all that was tried."""
    original = _residual(case, case.form.of_image(case.pixels), _reference(case), case.rendering.compared)[0]
    found, tried = [], []
    for family in (_layouts, _ranges, _alphas, _transfers, _orders, _faces, _backgrounds, _shifts):
        if family is _shifts and any(explanation.share == 0 for *_, explanation in found):
            break  # eight more references, of which none can do better
        for hypothesis in family(case):
            tried.append(hypothesis.name)
            share, rmse = _residual(case, *hypothesis[2:])
            if share <= EXPLAINS * original:
                # Differences of rounding alone leave the order in which hypotheses are tried.
                rank = round(share, 9), round(rmse / max(case.tolerance, ROUNDING), 2)
                found.append((rank, len(found), Explanation(hypothesis.name, hypothesis.what, share)))
    return [explanation for *_, explanation in sorted(found)], list(dict.fromkeys(tried))


def silhouette_off(case) -> float:
    """Of the compared pixels in which the image or the reference is not background, the share where only one is not."""
    empty = case.form.of_reference(case.another(scene=Scene()))
    ours, theirs = (
        is_off(difference(image, empty), case.tolerance) & case.rendering.compared
        for image in (_reference(case), case.form.of_image(case.pixels))
    )
    return float((ours ^ theirs).sum() / max((ours | theirs).sum(), 1))


def decode_srgb(encoded):
    """sRGB to linear light, IEC 61966-2-1."""
    encoded = np.asarray(encoded, dtype=np.float64)
    curved = ((np.maximum(encoded, 0.04045) + 0.055) / 1.055) ** 2.4
    return np.where(encoded <= 0.04045, encoded / 12.92, curved)


def _reference(case):
    return case.form.of_reference(case.rendering.image)


def _residual(case, image, candidate, compared):
    """Share of the compared pixels that are off, and RMSE."""
    if not compared.any():
        return 1.0, np.inf
    error = (image - candidate)[compared]
    off = is_off(np.abs(error).max(axis=-1), case.tolerance)
    return float(off.mean()), float(np.sqrt((error**2).mean()))


def _layouts(case):
    """The right numbers in the wrong place."""
    pixels, candidate = case.pixels, _reference(case)
    for name, what, moved in (
        ("flipped rows", "row 0 must be the top one", pixels[::-1]),
        ("flipped columns", "column 0 must be the left one", pixels[:, ::-1]),
        ("turned by 180°", "rows and columns are both flipped", pixels[::-1, ::-1]),
        ("red and blue swapped", "channels must be R, G, B", pixels[..., [2, 1, 0, 3][: pixels.shape[-1]]]),
    ):
        yield Hypothesis(name, what, case.form.of_image(moved), candidate, case.rendering.compared)


def _ranges(case):
    """Floats that run to 255. Twice white is no evidence yet: it may be a highlight."""
    pixels = case.pixels
    if case.form.clipped or pixels.max() <= 2 or case.rendering.image.max() > 1 + ROUNDING:
        return
    scale = np.full(pixels.shape[-1], 255.0)
    if pixels.shape[-1] == 4 and pixels[..., 3].max() <= 1:
        scale[3] = 1  # only the colours do
    what = "the image's floats run from 0 to 255: divide by 255, or give uint8"
    yield Hypothesis(
        "values up to 255", what, case.form.of_image(pixels / scale), _reference(case), case.rendering.compared
    )


def _alphas(case):
    """Alpha multiplied in once too often, or not at all: in the image, or while blending."""
    form, (image, frags, compared, _) = case.form, case.rendering
    given = form.of_image(case.pixels)
    if form.channels == 4:
        other = replace(form, premultiplied=not form.premultiplied)
        is_now, flag = ("straight", False) if form.premultiplied else ("premultiplied", True)
        what = f"the image's colours are {is_now}: pass premultiplied={flag}"
        yield Hypothesis(f"{is_now} alpha", what, other.of_image(case.pixels), other.of_reference(image), compared)
        what = "colour over black is right, the alpha channel is not"
        yield Hypothesis("alpha channel", what, given[..., :3], _reference(case)[..., :3], compared)
    else:
        alpha = image[..., 3:]
        straight = np.concatenate([_divided(image[..., :3], alpha), alpha], axis=-1)
        what = "RGB without alpha must be over black"
        yield Hypothesis("straight alpha", what, given, form.of_reference(straight), compared)
    rgb, alpha = frags.color[:, :3].astype(np.float64), frags.color[:, 3:].astype(np.float64)
    # The least alpha stands for 0, which no straight colour can make a full contribution of.
    for name, what, changed in (
        (
            "alpha never multiplied in",
            "straight colours were blended as if premultiplied",
            rgb / np.maximum(alpha, ROUNDING),
        ),
        ("alpha multiplied in twice", "premultiplied colours were blended as if straight", rgb * alpha),
    ):
        blended = _composited(_relisted(frags, color=np.concatenate([changed, np.maximum(alpha, ROUNDING)], axis=-1)))
        if blended is not None:
            yield Hypothesis(name, what, given, form.of_reference(blended), compared)


def _transfers(case):
    """sRGB encoded or decoded at another place."""
    form, (image, frags, compared, _) = case.form, case.rendering
    given = form.of_image(case.pixels)
    plain, encoded = replace(form, srgb=False), replace(form, srgb=True)
    if form.srgb:
        blended = _composited(_recolored(frags, encode_srgb))
        rows = (
            ("not sRGB-encoded", "pass srgb=False, or encode the image", plain, image),
            ("encoded before blending", "colours were sRGB-encoded first and blended then", plain, blended),
        )
    else:
        blended = _composited(_recolored(frags, decode_srgb))
        rows = (
            ("sRGB-encoded", "pass srgb=True, or do not encode the image", encoded, image),
            ("blended in linear light", "colours were decoded from sRGB, blended, and encoded again", encoded, blended),
            (
                "decoded but not encoded",
                "colours were decoded from sRGB and blended, but not encoded again",
                plain,
                blended,
            ),
        )
    for name, what, other, candidate in rows:
        if candidate is not None:
            yield Hypothesis(name, what, given, other.of_reference(candidate), compared)


def _orders(case):
    """The reference's own fragments in other orders, or some of them lost."""
    form, (_, frags, compared, _) = case.form, case.rendering
    pixel, key, primitive = frags.pixel, frags.key, frags.primitive.astype(np.int64)
    place = np.arange(len(frags))
    first_first, last_first = np.lexsort((primitive, pixel)), np.lexsort((-primitive, pixel))
    tied = (pixel[1:] == pixel[:-1]) & (key[1:] == key[:-1])
    one_left = "one of several fragments of equal depth was lost:"
    for name, what, taken in (
        ("arrival order", "blended over each other as submitted, unsorted", last_first),
        ("reverse arrival order", "unsorted, what was submitted first is in front", first_first),
        ("back to front swapped", "sorted, but the farthest fragment is in front", np.lexsort((-place, pixel))),
        (
            "depth writes left on",
            "fragments behind what was submitted before were lost",
            _depth_tested(first_first, pixel),
        ),
        ("ties swapped", "of equal depths, what was submitted first is in front", np.lexsort((primitive, key, pixel))),
        (
            "coincident layer lost",
            f"{one_left} the last submitted was kept",
            place[~np.append(False, tied)[: len(place)]],
        ),
        (
            "coincident layer lost",
            f"{one_left} the first submitted was kept",
            place[~np.append(tied, False)[: len(place)]],
        ),
        *(
            (
                "painter's algorithm",
                f"whole triangles were sorted by {by}, not fragments by depth",
                np.lexsort((-primitive, depths[primitive], pixel)),
            )
            for by, depths in _triangle_depths(case)
        ),
    ):
        blended = _composited(_relisted(frags, taken))
        if blended is not None:
            yield Hypothesis(name, what, form.of_image(case.pixels), form.of_reference(blended), compared)


def _triangle_depths(case):
    """What renderers that sort triangles go by: its name, and one number a primitive."""
    height, width = case.pixels.shape[:2]
    view = case.camera._at(width, height).view
    eye = case.scene.triangles() @ view[:3, :3].T + view[:3, 3]
    yield "the depth of their centroid", -eye.mean(axis=1)[:, 2]
    yield "the distance of their centroid", np.linalg.norm(eye.mean(axis=1), axis=1)
    yield "the depth of their nearest corner", -eye[..., 2].max(axis=1)


def _depth_tested(submitted, pixel):
    """Which fragments pass a depth test with writes, front first: nearer than all that were submitted before."""
    # Places fall from pixel to pixel, so that one running minimum serves all pixels.
    place = submitted - 2 * len(submitted) * pixel[submitted]
    return np.sort(submitted[place == np.minimum.accumulate(place)])


def _faces(case):
    given = case.form.of_image(case.pixels)
    for side in ("back", "front"):
        meshes = [mesh if mesh.cull else mesh.replaced(cull=side) for mesh in case.scene.meshes]
        candidate = case.form.of_reference(case.another(scene=Scene(meshes)))
        what = f"{side} faces were left out: meshes are two-sided unless they have cull={side!r}"
        yield Hypothesis(f"{side} faces culled", what, given, candidate, case.rendering.compared)


def _backgrounds(case):
    form, compared = case.form, case.rendering.compared
    given = form.of_image(case.pixels)
    image = case.another(background=(0, 0, 0, 0))
    if np.any(case.background):
        what = "the image is over nothing: pass background=(0, 0, 0, 0)"
        yield Hypothesis("no background", what, given, form.of_reference(image), compared)
    # image = ours + T · background: the background by least squares, weighted by how much of it is seen.
    through = np.where(compared, 1 - image[..., 3], 0)[..., None]
    seen = (through**2).sum()
    if seen < 1e-6:
        return
    missing = form.blended(case.pixels)
    missing = missing - image[..., : missing.shape[-1]]
    behind = np.clip((through * missing).sum(axis=(0, 1)) / seen, 0, None)
    if form.channels == 4:
        behind[3] = min(behind[3], 1)
        shown = [*_divided(behind[:3], behind[3:]), behind[3]]
    else:
        shown, behind = behind, np.append(behind, 0)
    what = f"the image is over about ({', '.join(f'{v:.3g}' for v in np.round(shown, 3))})"
    candidate = form.of_reference(image + (1 - image[..., 3:]) * behind)
    yield Hypothesis("another background", what, given, candidate, compared)


def _shifts(case):
    height, width = case.pixels.shape[:2]
    given = case.form.of_image(case.pixels)
    steps = [(x, y) for x in (-0.5, 0.5) for y in (-0.5, 0.5)] + [(-0.5, 0), (0.5, 0), (0, -0.5), (0, 0.5)]
    for x, y in steps:
        other = case.seen_by(shifted(case.camera, x, y, width, height))
        ways = [way for way, step in (("left", -x), ("right", x), ("up", -y), ("down", y)) if step > 0]
        what = f"everything lies half a pixel too far {' and '.join(ways)}: pixel centres are at .5"
        yield Hypothesis("half a pixel off", what, given, case.form.of_reference(other.image), other.compared)


def shifted(camera, x, y, width, height) -> Camera:
    """A camera whose images of this size lie x pixels further right and y pixels further down."""
    camera = camera._at(width, height)
    _, projection = camera.matrices(width, height)
    xy = projection[:2] + np.outer((2 * x / width, -2 * y / height), projection[3])
    return Camera._made(**(camera._fields() | {"xy": xy, "aspect": width / height}))


def _composited(lists):
    """The image of lists that a hypothesis made. None: a user's Blend, or a mode beside it, does not take them."""
    try:
        return lists.composite()
    except Exception:  # of a user's own function, for colours that its scene does not have
        return None


def _recolored(frags, transfer):
    """The lists with a transfer function applied to all colours, background included."""

    def recolored(rgba):
        return np.concatenate([transfer(rgba[..., :3]), rgba[..., 3:]], axis=-1)

    lists = _relisted(frags, color=recolored(frags.color))
    lists.background = recolored(frags.background)
    return lists


def _relisted(frags, taken=None, *, color=None):
    """A copy with the fragments `taken` (indices, pixel by pixel) in that order, or with other colours.

    Not a new `Fragments`, which would insist on lists that are sorted.
    """
    lists = copy.copy(frags)
    if color is not None:
        lists.color = np.ascontiguousarray(color, dtype=np.float64)
    if taken is not None:
        counts = np.bincount(frags.pixel[taken], minlength=len(frags.offsets) - 1)
        lists.offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        for field in ("depth", "key", "color", "primitive", "coverage", "blend"):
            values = getattr(frags, field)
            if values is not None:
                setattr(lists, field, np.ascontiguousarray(values[taken]))
    return lists


def _divided(rgb, alpha):
    """Colours with alpha divided out, 0 where alpha is 0."""
    alpha = np.broadcast_to(alpha, rgb.shape)
    return np.divide(rgb, alpha, out=np.zeros(rgb.shape), where=alpha > 0)
