"""What tests of methods share: random lists, the rows of variants and tolerances, and what each flag of the table means.

A method adds its rows here: parameters to try beside the defaults, and a tolerance where roundings are not all there is.
"""

import numpy as np

import abuffer as ab
from abuffer._methods import METHODS

U = 2.0**-24

# Parameters that are tried, beside the defaults.
VARIANTS = {
    "depth_peeling": [{"layers": 1}, {"layers": 3}],
    "object_sorted": [{"key": "nearest"}],
    "triangle_sorted": [{"key": "nearest"}, {"key": "farthest"}],
    "k_buffer": [{"k": 1}, {"k": 3, "tail": "blend"}, {"k": 3, "tail": "average"}],
    "phenomenological": [{"transmission": 0.3}, {"transmission": 1}],
    "mlab": [{"k": 1}, {"k": 8}],
    "hybrid": [{"k": 1}, {"k": 3, "coverage": "average"}],
    "adaptive": [{"k": 1}, {"k": 8}, {"k": 3, "renormalise": False}],
    "bucket_peeling": [{"buckets": 1}, {"buckets": 5}],
    "stencil_routed": [{"k": 1}, {"k": 3}],
    "wboit": [{"weight": w} for w in ("8", "9", "10", "none")],
    "wavelet": [{"rank": 1}, {"rank": 5}],
    "fourier": [{"terms": 1}, {"terms": 16}],
    "stochastic": [{"draws": 3, "estimator": "b"}, {"draws": 16, "estimator": "c", "seed": 2**32 - 1}],
    "mboit": [
        {"moments": 6},
        {"moments": 8, "beta": 0},
        {"bits": 16},
        *({"moments": n, "trigonometric": True} for n in (4, 6, 8)),
    ],
}
# Triangles of a scene of 40 that a method of many passes is given: Mesa's llvmpipe ends loops after so many turns.
TRIANGLES = {"depth_peeling": 12, "dual_depth_peeling": 16}
# How far CPU float32 and a GPU may be from float64 in an image of colours in [0, 1]: what up to 40 layers round, and what
# depths themselves are off by.
TOLERANCE = {
    # Weights are up to the sixth power of a depth, whose error comes with it.
    "wboit": 2e-5,
    # At rank 5, F rises by up to 5 within a cell, 1/64 of the range: 300 times what a depth is off by.
    "wavelet": 5e-5,
    # With 16 terms F rises 33 times as fast as its range; waves round 16 times.
    "fourier": 2e-5,
    # Where layers almost touch, the variance of their depths is of the size of λ, 4e-7 and more, beside which moments are
    # rounded by 2⁻²⁴: the weights of the two are off by hundredths, and the image by thousandths. It is 1.2e-3 in one pixel
    # here; all but a thousandth are within 2e-5, as are stacks that are apart (test_methods_moments.py). Of 16 bits, one that
    # is rounded the other way is off by 2⁻¹⁶, beside a λ of 6e-5: 2e-4 here.
    "mboit": 2e-3,
}
DEFAULT_TOLERANCE = 5e-6


def variants(ids=None):
    """Each method but exact with its defaults and with the parameters of VARIANTS."""
    ids = [id for id in METHODS if id != "exact"] if ids is None else ids
    return [(id, options) for id in ids for options in ({}, *VARIANTS.get(id, ()))]


def name_of(variant):
    id, options = variant
    return "-".join([id, *(f"{key}={value}" for key, value in options.items())])


def tolerance(id):
    return TOLERANCE.get(id, DEFAULT_TOLERANCE)


def lists_of(depths, colors, order=None, background=(0, 0, 0, 0)):
    """Fragments (P, n) and (P, n, 4) of P pixels in a row, in any order; `order`: of submission, (P, n)."""
    depths, colors = np.asarray(depths, float), np.asarray(colors, float)
    order = np.broadcast_to(np.arange(depths.shape[1]), depths.shape) if order is None else order
    return ab.Fragments.from_padded(
        depths[None], colors[None], primitive=np.asarray(order)[None], background=background
    )


def random_stacks(n, pixels=200, seed=0, alpha=1.0):
    """Depths, colours and an order of submission of n fragments in each of some pixels, all random."""
    rng = np.random.default_rng([seed, n])
    colors = rng.uniform(0, 1, (pixels, n, 4))
    colors[..., 3] *= alpha
    order = rng.permuted(np.broadcast_to(np.arange(n), (pixels, n)), axis=1)
    return rng.uniform(1, 10, (pixels, n)), colors, order


def rmse(variant, n, alpha, pixels=900):
    """The error of colours over grey, of random stacks: n layers with alphas up to `alpha`, depths from 0 to 1."""
    id, options = variant
    depths, colors, order = random_stacks(n, pixels, alpha=alpha)
    frags = lists_of((depths - 1) / 9, colors, order, (0.5, 0.5, 0.5, 1))
    return np.sqrt(np.mean((frags.composite(id, **options) - frags.composite())[..., :3] ** 2))


LENGTHS = (1, 2, 5, 12, 24)
BEHIND = (0.2, 0.6, 0.4, 0.5)
RANGE = (0.5, 12.0)


def composite(variant, frags):
    id, options = variant
    takes_range = {"depth_range": RANGE} if METHODS[id].takes_range else {}
    return frags.composite(id, **options, **takes_range)


def off_single(variant):
    depths, colors, order = random_stacks(1)
    colors[::5, :, 3], colors[1::5, :, 3] = 0, 1
    frags = lists_of(depths, colors, order, BEHIND)
    return composite(variant, frags) - frags.composite()


def off_equal_colors(variant):
    errors = []
    for n in LENGTHS:
        depths, colors, order = random_stacks(n)
        colors[..., :3] = colors[:, :1, :3]
        colors[::4, n // 2, 3] = 1
        frags = lists_of(depths, colors, order, BEHIND)
        errors.append(composite(variant, frags) - frags.composite())
    return np.concatenate(errors)


def off_noop_alpha0(variant):
    errors = []
    for n in LENGTHS:
        depths, colors, order = random_stacks(2 * n)
        colors[:, n:, 3] = 0
        with_none = lists_of(depths, colors, order, BEHIND)
        without = lists_of(depths[:, :n], colors[:, :n], order[:, :n], BEHIND)
        errors.append(composite(variant, with_none) - composite(variant, without))
    return np.concatenate(errors)


def off_opaque_front(variant):
    errors = []
    for n in LENGTHS:
        depths, colors, order = random_stacks(n)
        front = np.argmin(depths, axis=1)[:, None]
        np.put_along_axis(colors[..., 3], front, 1.0, axis=1)
        wanted = np.take_along_axis(colors, front[..., None], axis=1)[:, 0]
        errors.append(composite(variant, lists_of(depths, colors, order, BEHIND))[0] - wanted)
    return np.concatenate(errors)


def off_exact_coverage(variant):
    errors = []
    for n in LENGTHS:
        depths, colors, order = random_stacks(n, alpha=0.9)
        colors[::4, n // 2, 3] = 1
        image = composite(variant, lists_of(depths, colors, order))
        with np.errstate(divide="ignore"):
            errors.append(image[0, :, 3] + np.expm1(np.log1p(-colors[..., 3]).sum(axis=1)))
    return np.concatenate(errors)


def off_order_free(variant):
    errors = []
    for n in LENGTHS:
        depths, colors, order = random_stacks(n)
        images = [composite(variant, lists_of(depths, colors, o, BEHIND)) for o in (order, order[:, ::-1])]
        errors.append(images[0] - images[1])
    return np.concatenate(errors)


def off_hull(variant):
    errors = []
    for n in LENGTHS:
        depths, colors, order = random_stacks(n)
        background = (0.2, 0.6, 0.4, 1.0)
        image = composite(variant, lists_of(depths, colors, order, background))[0]
        all_colors = np.concatenate([colors, np.broadcast_to(background, (len(colors), 1, 4))], axis=1)[..., :3]
        low, high = all_colors.min(axis=1), all_colors.max(axis=1)
        errors.append(np.maximum(np.maximum(low - image[..., :3], image[..., :3] - high), 0))
    return np.concatenate(errors)


OFF = {name.removeprefix("off_"): function for name, function in list(globals().items()) if name.startswith("off_")}
