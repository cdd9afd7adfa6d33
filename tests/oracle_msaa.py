"""The reference with several samples a pixel, in float64: rays through sample positions.

A ray is cast through the centre and through every sample position of each pixel, by `oracle.trace` with the image moved
under it. Nothing of the package is imported. The rules:

- a fragment's mask has bit s where the ray through sample s hits its triangle;
- it has one colour and one depth in a pixel: those of the ray through the centre if that hits it, else of the ray through
  the sample of the lowest number that does;
- a pixel's list is sorted by that depth, the later primitive first at equal depth, whatever the masks;
- opaque surfaces hide samples: at each, what is strictly behind the nearest opaque hit *there*. A fragment whose mask that
  empties is no fragment;
- the image is the mean of the samples, each composited over the fragments that cover it.

Conventions as in oracle.py. S counts samples; sample s is bit s of a mask.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

import oracle
from oracle import OracleCamera, U

# "Standard sample locations" of the Vulkan specification, as offsets from the pixel's centre, right and down, in 1/16 px.
PATTERNS = {
    1: ((0, 0),),
    2: ((4, 4), (-4, -4)),
    4: ((-2, -6), (6, -2), (-6, 2), (2, 6)),
    8: ((1, -3), (-1, 3), (5, 1), (-3, -5), (-5, 5), (-7, -1), (3, 7), (7, -7)),
    16: ((1, 1), (-1, -3), (-3, 2), (4, -1), (-5, -2), (2, 5), (5, 3), (3, -5),
         (-2, 6), (0, -7), (-4, -6), (-6, 4), (-8, 0), (7, -4), (6, 7), (-7, -8)),
}  # fmt: skip


def positions(samples):
    """(S, 2): offsets of the samples from the pixel's centre, in pixels, right and down."""
    return np.array(PATTERNS[samples]) / 16


def shifted(camera, width, height, offset):
    """The camera whose pixel centres see what `camera` sees `offset` pixels (right, down) from its own."""
    projection = camera.projection.copy()
    for axis, (step, size) in enumerate(zip((-offset[0], offset[1]), (width, height), strict=True)):
        projection[axis] += 2 * step / size * camera.projection[3]  # moves by `step` in units of w: ndc, that is
    return OracleCamera(camera.view, projection, camera.near, camera.far)


def per_sample_hits(triangles, colors, camera, width, height, offset, **kw):
    """`oracle.trace` at the positions `offset` pixels (right, down) from the centres.

    The mean over the samples of these is the image where each face has one colour and no two depth ranges overlap in a
    pixel: then it does not matter where in the pixel colour and depth are taken.
    """
    return oracle.trace(triangles, colors, shifted(camera, width, height, offset), width, height, **kw)


def edge_distance(triangles, camera, width, height, samples):
    """(H, W): distance in pixels from the nearest of centre and samples to the nearest projected edge, at most 1."""
    offsets = [(0, 0), *positions(samples)]
    at = [oracle.edge_distance(triangles, shifted(camera, width, height, o), width, height) for o in offsets]
    return np.min(at, axis=0)


def popcount(masks):
    """How many of 32 bits are set."""
    masks = np.asarray(masks, np.uint32)
    return ((masks[..., None] >> np.arange(32, dtype=np.uint32)) & 1).sum(-1)


@dataclass
class _Given(oracle.Hits):
    """Hits whose gradients are known already, since their rays are not all through pixel centres."""

    known_gradients: tuple = field(repr=False)  # (F, 4), (F,)

    @property
    def _gradients(self):
        return self.known_gradients


@dataclass
class MsaaHits(_Given):
    """The lists of `trace_msaa`, each fragment once; `sample(s)` gives one sample's own, which `oracle` composites.

    As a list, `opaque_gap` (H, W) is the least of the samples', and there is no background. With S samples:
    """

    coverage: np.ndarray  # (F,) uint32
    samples: int
    sample_background: np.ndarray = field(repr=False)  # (H, W, S, 4) straight, valid where opaque_depths is finite
    opaque_depths: np.ndarray = field(repr=False)  # (H, W, S)
    opaque_gaps: np.ndarray = field(repr=False)  # (H, W, S)

    def sample(self, s):
        """oracle.Hits of what covers sample s, in the pixel's order."""
        on = (self.coverage >> np.uint32(s)) & 1 == 1
        counts = np.bincount(self.pixel[on], minlength=self.width * self.height)
        return _Given(
            self.width,
            self.height,
            np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
            self.depth[on],
            self.primitive[on],
            self.color[on],
            self.sample_background[:, :, s],
            self.opaque_depths[:, :, s],
            self.opaque_gaps[:, :, s],
            self.setup,
            (self.gradient[on], self.depth_gradient[on]),
        )

    @cached_property
    def each(self):
        """The hits of every sample."""
        return [self.sample(s) for s in range(self.samples)]


def trace_msaa(triangles, colors, camera, width, height, samples, *, opaque=None, cutoff=None, cull=None):
    """The lists of triangles (T, 3, 3) with straight colours (T, 3, 4) by the rules above -> MsaaHits.

    opaque: (T,) bool. cutoff: (T,); an opaque triangle of less alpha where its colour is taken is not in that pixel.
    """
    T = max(len(triangles), 1)
    offsets = [(0, 0), *positions(samples)]
    at = [per_sample_hits(triangles, colors, camera, width, height, o, cull=cull) for o in offsets]
    keys = [h.pixel * T + h.primitive for h in at]  # a ray hits a triangle once
    fragment = np.unique(np.concatenate(keys[1:]))
    covered = np.zeros((len(fragment), samples), bool)
    depth_at = np.full((len(fragment), samples), np.nan)
    slope_at = np.zeros((len(fragment), samples))
    depth, color = np.zeros(len(fragment)), np.zeros((len(fragment), 4))
    gradient, depth_gradient = np.zeros((len(fragment), 4)), np.zeros(len(fragment))
    # From the last sample to the first, then the centre: the last that a fragment meets is where it is evaluated.
    for k in (*range(samples, 0, -1), 0):
        known = np.isin(keys[k], fragment)
        i, hits = np.searchsorted(fragment, keys[k][known]), at[k]
        depth[i], color[i] = hits.depth[known], hits.color[known]
        gradient[i], depth_gradient[i] = hits.gradient[known], hits.depth_gradient[known]
        if k:
            covered[i, k - 1], depth_at[i, k - 1], slope_at[i, k - 1] = True, hits.depth, hits.depth_gradient
    pixel, primitive = np.divmod(fragment, T)
    setup = at[0].setup

    solid = np.zeros(len(fragment), bool) if opaque is None else np.asarray(opaque, bool)[primitive]
    if cutoff is not None:
        hole = solid & (color[:, 3] < np.asarray(cutoff, np.float64)[primitive])
        covered[hole] = False
    shape = (width * height, samples)
    wall, gap, background = np.full(shape, np.inf), np.full(shape, np.inf), np.zeros((*shape, 4))
    for s in range(samples):
        front = np.flatnonzero(solid & covered[:, s])
        front = front[np.lexsort((-primitive[front], depth_at[front, s], pixel[front]))]
        where, first = np.unique(pixel[front], return_index=True)
        owner = np.full(width * height, -1)
        owner[where] = front[first]
        wall[where, s] = depth_at[owner[where], s]
        background[where, s, :3], background[where, s, 3] = color[owner[where], :3], 1.0
        # How far from the wall others are, beyond what float32 vertices move the two by.
        other = np.flatnonzero(covered[:, s] & (owner[pixel] >= 0))
        behind = owner[pixel[other]]
        other, behind = (a[setup.tie[primitive[other]] != setup.tie[primitive[behind]]] for a in (other, behind))
        z, z_wall = depth_at[other, s], depth_at[behind, s]
        scale = np.maximum(np.abs(z), np.abs(z_wall)) if camera.perspective else np.abs(depth).max(initial=0)
        moves = 4 * U * max(width, height) * (slope_at[other, s] + slope_at[behind, s])
        np.minimum.at(gap[:, s], pixel[other], (np.abs(z - z_wall) - moves) / np.maximum(scale, 1e-300))
        covered[:, s] &= solid | ~(depth_at[:, s] > wall[pixel, s])
    kept = np.flatnonzero(~solid & covered.any(1))
    kept = kept[np.lexsort((-primitive[kept], depth[kept], pixel[kept]))]
    coverage = (covered[kept] << np.arange(samples)).sum(1).astype(np.uint32)
    counts = np.bincount(pixel[kept], minlength=width * height)
    return MsaaHits(
        width,
        height,
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        depth[kept],
        primitive[kept],
        color[kept],
        np.zeros((height, width, 4)),
        np.full((height, width), np.inf),
        gap.min(1).reshape(height, width),
        setup,
        (gradient[kept], depth_gradient[kept]),
        coverage,
        samples,
        background.reshape(height, width, samples, 4),
        wall.reshape(height, width, samples),
        gap.reshape(height, width, samples),
    )


def composite_samples(hits, background=(0, 0, 0, 0)):
    """Each sample over the fragments that cover it -> premultiplied (H, W, S, 4)."""
    return np.stack([oracle.composite(sample, background) for sample in hits.each], axis=2)


def composite(hits, background=(0, 0, 0, 0)):
    """The mean over the samples -> premultiplied (H, W, 4)."""
    return composite_samples(hits, background).mean(axis=2)


def colour_bound(hits, width, height, *, background=(0, 0, 0, 0), interpolation_ulps=0.0):
    """(H, W, 4): the mean of oracle.colour_bound over the samples, and S u C for their sum and its division by S."""
    options = {"background": background, "interpolation_ulps": interpolation_ulps}
    bounds = [oracle.colour_bound(sample, width, height, **options) for sample in hits.each]
    return np.mean(bounds, axis=0) + hits.samples * U * composite(hits, background)


def hull(hits, background=(0, 0, 0, 0), relative=1e-5):
    """(low, high), (H, W, 4): the means of oracle.hull, for a near tie may fall out otherwise at every sample."""
    low, high = zip(*(oracle.hull(sample, background, relative) for sample in hits.each), strict=True)
    return np.mean(low, axis=0), np.mean(high, axis=0)


# What a straight colour c of opacity a makes of a destination d, channel by channel, and of the alpha behind it.
MODES = {
    "over": (lambda d, c, a: d * (1 - a) + a * c, lambda A, a: A * (1 - a) + a),
    "additive": (lambda d, c, a: d + a * c, lambda A, a: A),
    "multiply": (lambda d, c, a: d * (1 - a + a * c), lambda A, a: A),
    "screen": (lambda d, c, a: 1 - (1 - d) * (1 - a * c), lambda A, a: A),
    "premultiplied": (lambda d, c, a: d * (1 - a) + c, lambda A, a: A * (1 - a) + a),
}


def blend_lists(offsets, color, behind, modes=None, kept=None):
    """Back to front, over straight `behind` (P, 4) -> premultiplied (P, 4), float64.

    offsets (P + 1,), color (F, 4) straight, front to back. modes: (F,) names of MODES, None: all over. kept: (F,) bool,
    which fragments count (those that cover a sample, say).
    """
    color = np.asarray(color, np.float64)
    behind = np.asarray(behind, np.float64)
    result = np.concatenate([behind[:, :3] * behind[:, 3:], behind[:, 3:]], axis=1)
    counts = np.diff(offsets)
    for k in range(counts.max(initial=0)):
        pixels = np.flatnonzero(counts > k)
        i = offsets[pixels + 1] - 1 - k
        if kept is not None:
            pixels, i = pixels[kept[i]], i[kept[i]]
        for name, (rgb, alpha) in MODES.items():
            own = np.full(len(i), name == "over") if modes is None else modes[i] == name
            p, c, a = pixels[own], color[i[own], :3], color[i[own], 3:]
            result[p, :3], result[p, 3:] = rgb(result[p, :3], c, a), alpha(result[p, 3:], a)
    return result


def blend_bound(offsets, color, behind, modes):
    """(P, 4): how far float32 may be off `blend_lists` of the same lists, front to back or back to front.

    A layer turns what is behind into a + f d, none of them negative. Relative to the result, a layer adds at most 3 roundings
    in f, 1 in a, 1 in the product with d or T and 1 in the sum, and the background has 2 of its own: (6 n + 2) u C. One of these
    is not relative: screen's f = 1 - alpha c keeps the absolute rounding of alpha c, at most u. It meets what lies behind, and
    what is in front lets the part f of it through.
    """
    color, behind = np.asarray(color, np.float64), np.asarray(behind, np.float64)
    d = behind[:, :3] * behind[:, 3:]  # what lies behind, layer by layer
    error = np.zeros((len(offsets) - 1, 3))
    counts = np.diff(offsets)
    for k in range(counts.max(initial=0)):
        pixels = np.flatnonzero(counts > k)
        i = offsets[pixels + 1] - 1 - k
        for name, (rgb, _) in MODES.items():
            p, c, a = pixels[modes[i] == name], color[i, :3][modes[i] == name], color[i, 3:][modes[i] == name]
            f = rgb(np.ones_like(c), c, a) - rgb(np.zeros_like(c), c, a)
            error[p] = f * error[p] + (U * d[p] if name == "screen" else 0)
            d[p] = rgb(d[p], c, a)
    result = blend_lists(offsets, color, behind, modes)
    return (6 * counts[:, None] + 2) * U * result + np.concatenate([error, 0 * error[:, :1]], axis=1)
