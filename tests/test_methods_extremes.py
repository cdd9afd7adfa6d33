"""Every method at the extremes: opaque, almost invisible, bright and thousands of layers, in both precisions and on GPUs.

And what framebuffers of 8 and 16 bits make of such layers, in numpy: there sums stagnate, which ours must not.
"""

import numpy as np
import pytest

import methods
from abuffer._methods import METHODS
from comparison import CPU32, CPU64
from sheets import HARDWARE, everywhere, render, sheets, unit

# Equal layers: how many, of which alpha and colour.
EXTREMES = [
    (1, 1.0, 1.0),
    (100, 1.0, 1.0),
    (100, 1e-30, 1.0),
    (100, 1e-7, 1.0),
    (50, 0.3, 1e4),
    (1000, 1e-7, 1e4),
    (2000, 0.9, 1e4),
    (4096, 1 - 1e-7, 1.0),
    (5000, 1e-4, 1.0),
    (5000, 1e-3, 1.0),
    (5000, 1 / 255, 1.0),
    (5000, 0.004, 1e4),
]
# Of equal layers, how many count, where that is not all of them.
COUNTING = {"k_buffer": 8, "stencil_routed": 8, "bucket_peeling": 32}


def coverage(alpha, n):
    with np.errstate(divide="ignore"):
        return -np.expm1(n * np.log1p(-alpha))


def closed_form(id, n, alpha, color):
    """Of n layers of an RGB over nothing."""
    if id == "additive":
        return np.array([*(n * alpha * color), 0])
    if id == "weighted_sum":
        return n * alpha * np.array([*color, 1])
    return coverage(alpha, min(n, COUNTING.get(id, n))) * np.array([*color, 1])


def rtol(n, pipeline):
    """A sum of n terms that are merged: 3 n u. Where absorbances are sums, (1 − α)ⁿ is off by n a of them, and so no more."""
    return (3 * n + 6) * unit(pipeline)


def layers(n, alpha, color):
    return sheets(1 + np.random.default_rng(n).permutation(n) / 1024, np.tile([*color, alpha], (n, 1)))


def too_deep(id, pipeline, n):
    """What software drivers do not take, loops of more turns; and a peeling has a pass over all layers for each of them."""
    if id.endswith("depth_peeling"):
        return n > (2000 if pipeline.device == "cpu" else 100 if pipeline is HARDWARE else 20)
    return n > 100 and id != "exact" and pipeline.device == "gpu" and pipeline is not HARDWARE


def image(id, pipeline, n, alpha, color):
    return render(pipeline, layers(n, alpha, color), id).image[0, 0]


@pytest.mark.parametrize(("id", "pipeline"), everywhere([id for id in METHODS if id != "stochastic"]), ids=str)
def test_equal_layers_reach_their_closed_form_at_the_extremes(id, pipeline):
    for n, alpha, bright in EXTREMES:
        if too_deep(id, pipeline, n):
            continue
        color, alpha = bright * np.array([1, 0.5, 0]), float(np.float32(alpha))
        got = image(id, pipeline, n, alpha, color)
        wanted = closed_form(id, n, alpha, color)
        # Weights that are proportional to alpha make it α², and of 1e-30 that is below all floats.
        np.testing.assert_allclose(got, wanted, rtol=rtol(n, pipeline), atol=1e-27, err_msg=f"{n} of {alpha}")


@pytest.mark.parametrize("pipeline", [p for id, p in everywhere(["stochastic"])], ids=str)
def test_equal_layers_of_draws_have_the_colour_of_the_draws_that_hit(pipeline):
    """Of 8 draws, and of all where alpha is 1."""
    for n, alpha, bright in EXTREMES:
        if too_deep("stochastic", pipeline, n):
            continue
        got = image("stochastic", pipeline, n, alpha, bright * np.array([1, 0.5, 0]))
        hits = round(8 * float(got[3]))
        assert hits == 8 if alpha == 1 else 0 <= hits <= 8
        np.testing.assert_allclose(got, hits / 8 * np.array([bright, bright / 2, 0, 1]), rtol=9 * unit(pipeline))


@pytest.mark.parametrize(("id", "pipeline"), everywhere(), ids=str)
def test_layers_of_alpha_0_alone_show_the_background(id, pipeline):
    """0 / 0 of what divides by a sum of weights."""
    scene = sheets(np.arange(1, 21), np.tile([1, 0.5, 0, 0], (20, 1)))
    got = render(pipeline, scene, id, background=(0.5, 0.25, 1, 0.5)).image
    np.testing.assert_array_equal(got, np.broadcast_to([0.25, 0.125, 0.5, 0.5], got.shape))


@pytest.mark.parametrize("variant", methods.variants([*METHODS]), ids=methods.name_of)
def test_mixed_extremes_stay_finite_and_between_black_and_the_brightest(variant):
    """Thousands of layers of alphas 0 to 1 and colours up to 1e4, over black. Sums alone are brighter."""
    id, options = variant
    rng = np.random.default_rng(7)
    colors = np.float32(10.0 ** rng.uniform(-4, 4, (3000, 4)))
    alphas = np.float32([0, 1e-30, 1e-7, 1e-3, 0.5, 1 - 1e-7, 1])
    colors[:, 3] = rng.choice(alphas, 3000, p=[0.2, 0.2, 0.2, 0.39, 0.006, 0.002, 0.002])
    for first in (0, 3):
        scene = sheets(np.arange(1, 3001 - first), colors[first:])
        for pipeline in (CPU64, CPU32):
            got = render(pipeline, scene, id, background=(0, 0, 0, 1), **options).image
            assert np.isfinite(got).all()
            assert (got >= 0).all() or id == "weighted_sum"
            if "hull" in METHODS[id].flags and options.get("transmission", 0) == 0:
                assert (got[..., :3] <= colors[..., :3].max(axis=0) * (1 + 1e-5)).all()
            np.testing.assert_allclose(got[..., 3], 1, rtol=1e-5)


# ---- framebuffers of few bits, where sums stagnate ----


def unorm8(per_mille, n):
    """White painted n times with an alpha in thousandths onto black of 255 steps, each result rounded: in integers."""
    color = 0
    for _ in range(n):
        color = (2 * (per_mille * 255 + (1000 - per_mille) * color) + 1000) // 2000
    return color / 255


def half(alpha, n):
    """White accumulated front to back, and painted back to front, each operation rounded to 16 bits."""
    alpha = np.float16(alpha)
    rest = np.float16(1) - alpha
    front, through, painted = np.float16(0), np.float16(1), np.float16(0)
    for _ in range(n):
        front += through * alpha
        through *= rest
        painted = alpha + rest * painted
    return front, painted


@pytest.mark.parametrize(("per_mille", "stalls"), [(1, 0.0), (4, 0.513725), (50, 0.965)])
def test_8_bits_stagnate_where_an_increment_is_less_than_half_a_step(per_mille, stalls):
    """α (1 − C) < 1/510: 5000 white layers are black, half grey, and almost white."""
    assert unorm8(per_mille, 5000) == pytest.approx(stalls, abs=1 / 255)
    assert unorm8(per_mille, 5000) < coverage(per_mille / 1000, 5000) - 0.03


@pytest.mark.parametrize(
    ("alpha", "accumulated", "painted"), [(1e-4, 0.25, 0.25), (1e-3, 0.93, 0.75), (1 / 255, 0.966, 0.9375)]
)
def test_16_bits_stagnate_where_an_increment_is_less_than_half_an_ulp(alpha, accumulated, painted):
    for got, stalls in zip(half(alpha, 5000), (accumulated, painted), strict=True):
        assert abs(float(got) - stalls) <= np.spacing(np.float16(stalls))
        assert got < coverage(alpha, 5000) - 0.03


def test_what_stagnates_would_not_pass_for_the_closed_form():
    """Of the layers above: the bounds in which ours are 5000 times are a thirtieth of what those are off by."""
    for alpha, stalled in ((0.004, unorm8(4, 5000)), *((a, max(half(a, 5000))) for a in (1e-4, 1e-3, 1 / 255))):
        assert any(np.isclose(alpha, row[1]) and row[0] == 5000 for row in EXTREMES)
        wanted = coverage(alpha, 5000)
        assert wanted - stalled > 30 * rtol(5000, CPU32) * wanted
