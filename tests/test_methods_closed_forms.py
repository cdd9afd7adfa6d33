"""Closed forms of n-layer `over`, rendered: on every pipeline, by every method that is exact of so few layers."""

import numpy as np
import pytest

import methods
from abuffer._methods import METHODS
from comparison import CPU32, CPU64, GPU, GPU_PREFIX, GPU_TILES
from sheets import everywhere, one_by_one, render, sheets, unit

EVERY = pytest.mark.parametrize("pipeline", [CPU32, CPU64, GPU, GPU_PREFIX, GPU_TILES], ids=str)
BEHIND = np.array([0.25, 0.5, 0.75, 1.0])


# ---- equal layers ----

ALPHAS = np.float32([0, 1e-7, 1e-4, 0.01, 0.1, 0.5, 0.9, 1 - 1e-3, 1 - 1e-7, 1]).astype(float)


def coverage(alpha, n):
    """1 − (1 − α)ⁿ, of integers, rounded once."""
    one = 2**60
    return (one**n - (one - int(alpha * one)) ** n) / one**n


def assert_covers(image, alpha, n, dtype):
    """c A in a pixel with nothing behind it, c A + B (1 − A) in another: within 2 (n + 1) u, as no term is negative.

    What is below the least normal number may be flushed to 0.
    """
    color, covered = np.array([1, 0.5, 0, 1]), coverage(alpha, n)
    through = (2**60 - int(alpha * 2**60)) ** n / 2 ** (60 * n)
    wanted = np.array([color * covered, color * covered + BEHIND * through])
    u, tiny = np.finfo(dtype).eps / 2, np.finfo(dtype).tiny
    assert (np.abs(image[0] - wanted) <= 2 * (n + 1) * u * 1.01 * wanted + tiny).all()


@EVERY
@pytest.mark.parametrize("n", [0, 1, 2, 10, 100, 1000, 4096])
def test_equal_layers_reach_their_closed_form_within_the_bound(pipeline, n):
    background = np.array([[[0, 0, 0, 0], BEHIND]])
    for alpha in ALPHAS:
        scene = sheets(1 + np.arange(n) / 1024, np.tile([1, 0.5, 0, alpha], (n, 1)))
        assert_covers(render(pipeline, scene, background=background).image, alpha, n, pipeline.precision)


def test_alpha_taken_from_transmittance_would_fail_that_bound():
    """By a fifth: of 1 − 1e-7 a float32 has no more digits."""
    n, alpha = 1000, ALPHAS[1]
    through = np.float32(1)
    for _ in range(n):
        through *= np.float32(1) - np.float32(alpha)
    front = np.array([1, 0.5, 0, 1]) * (1 - through)
    with pytest.raises(AssertionError):
        assert_covers(np.array([[front, front + BEHIND * through]]), alpha, n, np.float32)


# ---- few layers ----

N = 10
# With which options a method is exact of up to N layers that are spread evenly; unsorted is if the farthest come first.
EXACT = {
    "exact": {},
    "depth_peeling": {},
    "dual_depth_peeling": {},
    "k_buffer": {"k": N},
    "object_sorted": {},
    "triangle_sorted": {},
    "unsorted": {},
    "mlab": {"k": N - 1},
    "hybrid": {"k": N - 1},
    "adaptive": {"k": N},
    "bucket_peeling": {"buckets": N},
    "stencil_routed": {"k": N},
}
WHERE_EXACT = pytest.mark.parametrize(("id", "pipeline"), everywhere(EXACT), ids=str)


def image(id, pipeline, colors, background=(0, 0, 0, 0)):
    """Of layers (n, 4), the nearest first, at depths 1 to n; submitted in some order."""
    n = len(colors)
    order = np.arange(n)[::-1] if id == "unsorted" else np.random.default_rng(n).permutation(n)
    scene = one_by_one(1 + order, np.asarray(colors)[order])
    return render(pipeline, scene, id, background=background, **EXACT.get(id, {})).image[0, 0]


def grey(values, alphas):
    values = np.float32(values).astype(float)
    return np.stack([values, values, values, np.broadcast_to(np.float32(alphas).astype(float), values.shape)], axis=-1)


def assert_equal_to(got, wanted, n, pipeline):
    """Relatively: front to back 2 (n + 1) u, a merge of layers 3 n u, and 4 u for a scale to the exact coverage. In
    float64 half as much again for the closed form."""
    np.testing.assert_allclose(got, wanted, rtol=(4.5 * n + 6) * unit(pipeline), atol=0)


@WHERE_EXACT
def test_geometric_colours_make_a_geometric_series(id, pipeline):
    for alpha, q in ((0.5, 0.5), (0.125, 0.75)):  # powers that float32 has
        ratio = q * (1 - alpha)
        wanted = alpha * (1 - ratio**N) / (1 - ratio)
        got = image(id, pipeline, grey(q ** np.arange(N), alpha))
        assert_equal_to(got, [wanted] * 3 + [coverage(alpha, N)], N, pipeline)


@WHERE_EXACT
def test_alternating_white_and_black_are_a_series_of_every_other_power(id, pipeline):
    for n in (N - 1, N):
        for alpha in np.float32([0.1, 0.9]).astype(float):
            r = 1 - alpha
            wanted = alpha * (1 - r ** (2 * -(-n // 2))) / (1 - r * r)
            got = image(id, pipeline, grey((np.arange(n) + 1) % 2, alpha))
            assert_equal_to(got, [wanted] * 3 + [coverage(alpha, n)], n, pipeline)


@WHERE_EXACT
def test_red_over_green_over_blue(id, pipeline):
    """The example of Enderton et al. 2010: alphas .45, .45 and 1; and blue as the background."""
    a = float(np.float32(0.45))
    wanted = [a, (1 - a) * a, (1 - a) ** 2, 1]
    np.testing.assert_allclose(wanted, [0.45, 0.2475, 0.3025, 1], atol=2e-8)
    layers = np.c_[np.eye(3), [a, a, 1]]
    assert_equal_to(image(id, pipeline, layers), wanted, 3, pipeline)
    assert_equal_to(image(id, pipeline, layers[:2], (0, 0, 1, 1)), wanted, 2, pipeline)


@WHERE_EXACT
def test_alphas_of_1_over_their_place_from_behind_make_the_mean(id, pipeline):
    """`over` is then a running average. An alpha of 1/i rounds by u, and with it the share of each of the i."""
    colors = np.random.default_rng(1).random((N, 3)).astype(np.float32)
    got = image(id, pipeline, np.c_[colors, 1 / np.arange(N, 0, -1)])
    np.testing.assert_allclose(got[3], 1, rtol=(4 * N + 6) * unit(pipeline))
    # Shares are products of N such alphas, whether float32 or float64 goes on with them.
    np.testing.assert_allclose(got[:3], colors.astype(float).mean(axis=0), rtol=(6 * N + 6) * methods.U)


@WHERE_EXACT
def test_two_adjacent_layers_exchanged_change_the_colour_by_the_swap_identity(id, pipeline):
    """ΔC = T α_a α_b (c_b − c_a), of a in front that goes behind b; alpha is as it was."""
    rng = np.random.default_rng(2)
    colors = rng.uniform(0, 1, (N, 4)).astype(np.float32).astype(float)
    before, changes = image(id, pipeline, colors, BEHIND), []
    for at in range(N - 1):
        swapped = colors.copy()
        swapped[[at, at + 1]] = colors[[at + 1, at]]
        a, b = colors[at], colors[at + 1]
        change = np.prod(1 - colors[:at, 3]) * a[3] * b[3] * (b - a)[:3]
        got = image(id, pipeline, swapped, BEHIND) - before
        # A difference of two images below 1.
        np.testing.assert_allclose(got, [*change, 0], rtol=0, atol=2 * (4 * N + 6) * unit(pipeline))
        changes.append(np.abs(change).max())
    assert max(changes) > 0.01


@pytest.mark.parametrize("id", [id for id in METHODS if id not in EXACT])
def test_the_other_methods_are_off_by_more_than_any_of_these_bounds(id):
    wanted, got = (image(method, CPU64, grey((np.arange(N) + 1) % 2, 0.5)) for method in ("exact", id))
    assert np.abs(got - wanted).max() > 1e-3
