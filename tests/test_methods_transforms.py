"""Wavelet and Fourier transparency: the absorbance that they see in front of a depth, against their formulas in numpy.

Depths are in the range (0, 1), which is linear, so that a depth is the normalised x of the papers.
"""

import numpy as np
import pytest

import abuffer as ab
import methods

UNIT = {"depth_range": (0.0, 1.0)}
BOTH = [("wavelet", {"rank": rank}) for rank in (1, 3, 5)] + [("fourier", {"terms": terms}) for terms in (1, 3, 16)]
PAPERS = pytest.mark.parametrize("variant", BOTH, ids=methods.name_of)
# So thin that two of them change no other's transmittance by more than 1e-8.
PROBE = 1e-9


def transmittance(variant, x, alphas, at):
    """What layers at x let through to each depth of `at`: a green probe there, beside a red one at 0, where T is 1."""
    id, options = variant
    x, alphas, at = np.asarray(x, float), np.asarray(alphas, float), np.asarray(at, float)
    pixels, n = len(at), len(x)
    depths = np.concatenate([np.broadcast_to(x, (pixels, n)), np.zeros((pixels, 1)), at[:, None]], axis=1)
    colors = np.zeros((pixels, n + 2, 4))
    colors[:, :n, 3], colors[:, n:, 3] = alphas, PROBE
    colors[:, n, 0] = colors[:, n + 1, 1] = 1
    image = methods.lists_of(depths, colors).composite(id, **options, **UNIT)[0]
    return image[:, 1] / image[:, 0]


def layers(n, seed, cells=2**12):
    """Places and alphas of n layers. The places are on a grid, so that sums over a finer one are integrals of steps."""
    rng = np.random.default_rng([seed, n])
    return rng.integers(0, cells, n) / cells, rng.uniform(0.05, 0.9, n)


# ---- wavelet ----


def cells_by_quadrature(y, a, rank):
    """F projected to C cells: in each its average, over a grid on which it is constant."""
    cells = 2 ** (rank + 1)
    grid = (np.arange(2**14) + 0.5) / 2**14
    step = (a * (y <= grid[:, None])).sum(axis=1)
    return step.reshape(cells, -1).mean(axis=1)


def haar_of(y, a, rank):
    """The coefficients of F by quadrature against every Haar wavelet, put together again."""
    grid = (np.arange(2**14) + 0.5) / 2**14
    step = (a * (y <= grid[:, None])).sum(axis=1)
    rebuilt = np.full(len(grid), step.mean())
    for level in range(rank + 1):
        v = 2**level * grid
        for k in range(2**level):
            wavelet = 2 ** (level / 2) * np.where(np.floor(v) == k, np.where(v - k < 0.5, 1.0, -1.0), 0.0)
            rebuilt += (step * wavelet).mean() * wavelet
    return rebuilt.reshape(2 ** (rank + 1), -1)[:, 0]


@pytest.mark.parametrize("rank", [1, 2, 3, 4, 5])
def test_wavelet_coefficients_are_the_projection_of_the_step_function(rank):
    """Seen where it is interpolated between cells i − 1 and i, at (i + t) / (C − 1)."""
    y, alphas = layers(9, 1)
    cells = 2 ** (rank + 1)
    y *= (cells - 1) / cells - 2**-12
    y = np.floor(y * 2**12) / 2**12
    averages = haar_of(y, -np.log1p(-alphas), rank)
    np.testing.assert_allclose(averages, cells_by_quadrature(y, -np.log1p(-alphas), rank), atol=1e-12)
    i, t = np.repeat(np.arange(cells - 1), 3), np.tile([0, 0.25, 0.75], cells - 1)
    before = np.where(i > 0, averages[i - 1], 0.0)
    wanted = np.exp(-(before + (averages[i] - before) * t))
    got = transmittance(("wavelet", {"rank": rank}), y * cells / (cells - 1), alphas, (i + t) / (cells - 1))
    np.testing.assert_allclose(got, wanted, atol=1e-6)  # probes are 1e-9 thick; float64 is far below
    other = transmittance(("wavelet", {"rank": rank}), y, alphas, (i + t) / (cells - 1))
    assert np.abs(other - wanted).max() > 1e-3  # without C / (C − 1)


@pytest.mark.parametrize("rank", [1, 3, 5])
def test_wavelet_transmittance_never_rises_with_depth(rank):
    at = np.linspace(0, 1, 1000)
    for seed in range(5):
        x, alphas = layers(12, seed)
        assert np.diff(transmittance(("wavelet", {"rank": rank}), x, alphas, at)).max() < 1e-8  # probes


def test_the_last_cell_of_wavelets_holds_all_absorbance():
    """All of it is in front of x = 1, which is interpolated to cell C − 2, if no layer is in the last two."""
    for rank in (2, 3, 5):
        x, alphas = layers(8, rank)
        x *= 1 - 2 / (2 ** (rank + 1) - 1)
        got = transmittance(("wavelet", {"rank": rank}), x, alphas, [1.0])
        np.testing.assert_allclose(got, np.prod(1 - alphas), rtol=1e-7)  # probes


def test_wavelets_are_exact_for_two_layers_at_the_ends_of_the_range():
    depths, colors, _ = methods.random_stacks(2)
    depths[:] = (1, 0)
    frags = methods.lists_of(depths, colors, background=methods.BEHIND)
    for rank in range(1, 6):
        np.testing.assert_allclose(frags.composite("wavelet", rank=rank, **UNIT), frags.composite(), atol=1e-12)
    close = methods.lists_of(depths / 5, colors, background=methods.BEHIND)
    assert np.abs(close.composite("wavelet", rank=1, **UNIT) - close.composite()).max() > 0.01


# Measured of 300 random pixels by an implementation apart from this one: within half of that.
@pytest.mark.parametrize(
    ("rank", "n", "alpha", "expected"),
    [(3, 4, 0.9, 0.021), (3, 8, 0.2, 0.003), (3, 8, 0.9, 0.033), (3, 16, 0.9, 0.048), (3, 64, 0.2, 0.011)]
    + [(4, 8, 0.9, 0.024), (4, 64, 0.2, 0.007)],
)
def test_wavelets_err_as_much_as_expected(rank, n, alpha, expected):
    error = methods.rmse(("wavelet", {"rank": rank} | UNIT), n, alpha)
    assert expected / 2 < error < expected * 1.5


def test_wavelets_of_a_higher_rank_err_less():
    for n in (4, 16):
        errors = [methods.rmse(("wavelet", {"rank": rank} | UNIT), n, 0.9) for rank in range(1, 6)]
        assert errors == sorted(errors, reverse=True)


# ---- fourier ----


def series(x, a, at, terms):
    """F of the truncated series, as printed."""
    k = np.arange(1, terms + 1)
    waves = 2 * np.pi * k * x[:, None]
    a_k, b_k = 2 * (a[:, None] * np.cos(waves)).sum(axis=0), 2 * (a[:, None] * np.sin(waves)).sum(axis=0)
    at = at[:, None]
    rings = (a_k * np.sin(2 * np.pi * k * at) + b_k * (1 - np.cos(2 * np.pi * k * at))) / (2 * np.pi * k)
    return 2 * a.sum() * at[:, 0] / 2 + rings.sum(axis=1)


@pytest.mark.parametrize("terms", [1, 3, 16])
def test_fourier_transmittance_is_that_of_the_series(terms):
    x, alphas = layers(9, 2)
    at = np.linspace(0, 1, 200)
    wanted = np.exp(-np.maximum(series(x, -np.log1p(-alphas), at, terms), 0))
    got = transmittance(("fourier", {"terms": terms}), x, alphas, at)
    np.testing.assert_allclose(got, wanted, atol=1e-6)  # probes are 1e-9 thick; float64 is far below
    assert np.abs(transmittance(("fourier", {"terms": terms}), x[1:], alphas[1:], at) - wanted).max() > 1e-3


@pytest.mark.parametrize("terms", [1, 3, 16])
def test_all_absorbance_is_in_front_of_the_end_of_a_fourier_series(terms):
    x, alphas = layers(9, 3)
    got = transmittance(("fourier", {"terms": terms}), x, alphas, [1.0])
    np.testing.assert_allclose(got, np.prod(1 - alphas), rtol=1e-7)  # probes


def test_fourier_series_ring_in_front_of_a_layer_and_behind_it():
    """The known failure: a step is overshot by 9 % of it however many terms there are, so transmittance falls and rises."""
    at = np.linspace(0, 1, 1000)
    for terms in (1, 3, 16):
        through = transmittance(("fourier", {"terms": terms}), [0.5], [0.9], at)
        assert through.max() == pytest.approx(1, abs=1e-8)  # clamped: it would be e^(.09 · 2.3) = 1.2 somewhere
        assert series(np.array([0.5]), np.array([1.0]), at, terms).min() < -0.04
        assert np.diff(through).max() > 1e-5
    assert np.diff(transmittance(("wavelet", {}), [0.5], [0.9], at)).max() < 1e-8  # probes


def test_layers_at_both_ends_of_a_fourier_series_are_the_same():
    """Known failure: it is periodic, so the first depth and the last hide alike what is between them."""
    middle = [0.5]
    first, last = (transmittance(("fourier", {}), [x], [0.75], middle)[0] for x in (0.0, 1.0))
    assert first == pytest.approx(last, abs=1e-12)
    assert first == pytest.approx(0.5, abs=1e-7)  # half of the absorbance
    first, last = (transmittance(("wavelet", {}), [x], [0.75], middle)[0] for x in (0.0, 1.0))
    assert (first, last) == (pytest.approx(0.25, abs=1e-7), pytest.approx(1, abs=1e-7))


# ---- both ----


@PAPERS
def test_a_range_of_one_depth_gives_the_mean_colour(variant):
    id, options = variant
    depths, colors, _ = methods.random_stacks(6)
    depths[:] = 3
    frags = methods.lists_of(depths, colors)
    alphas = colors[..., 3:]
    mean = (colors[..., :3] * alphas).sum(axis=1) / alphas.sum(axis=1)
    through = np.prod(1 - alphas, axis=1)
    image = frags.composite(id, **options)[0]
    np.testing.assert_allclose(image, np.concatenate([mean * (1 - through), 1 - through], axis=1), atol=1e-12)
    assert np.abs(image - frags.composite()).max() > 0.01


@PAPERS
def test_an_opaque_layer_lets_nothing_of_the_background_through(variant):
    """Its absorbance is bounded where it weighs colours, and what is behind it is as well hidden as by alpha 0.99999."""
    id, options = variant
    frags = methods.lists_of([[0, 1]], [[(1, 0, 0, 1), (0, 1, 0, 0)]], background=(0, 0, 1, 1))
    np.testing.assert_array_equal(frags.composite(id, **options, **UNIT)[0, 0], (1, 0, 0, 1))
    two = [
        methods.lists_of([[0, 1]], [[(1, 0, 0, alpha), (0, 1, 0, 0.5)]], background=(0, 0, 1, 1))
        for alpha in (1, 1 - 1e-5)
    ]
    (one, almost) = (frags.composite(id, **options, **UNIT)[0, 0] for frags in two)
    assert one[2] == 0 and almost[2] == pytest.approx(5e-6)
    assert one[1] / one[0] == pytest.approx(almost[1] / almost[0], rel=2e-5)  # α, that of the colour itself


@PAPERS
def test_thousands_of_opaque_layers_keep_their_colours(variant):
    """All their transmittances are 0 in float64, not the ratios between them."""
    id, options = variant
    depths, colors, _ = methods.random_stacks(5000, pixels=2)
    colors[..., :3], colors[..., 3] = (0.25, 0.5, 1), 1
    for depth in (depths, np.full_like(depths, 2)):
        image = methods.lists_of(depth, colors).composite(id, **options)
        np.testing.assert_allclose(image[0], np.broadcast_to((0.25, 0.5, 1, 1), (2, 4)), rtol=1e-11)


@PAPERS
def test_thin_layers_keep_their_digits(variant):
    id, options = variant
    depths, colors, _ = methods.random_stacks(10)
    colors[..., 3] *= 1e-9
    frags = methods.lists_of(depths, colors)
    # Second order in alpha, of order 1e-17.
    np.testing.assert_allclose(frags.composite(id, **options), frags.composite(), rtol=1e-7)


@PAPERS
def test_colours_scale_by_powers_of_two_to_the_bit(variant):
    id, options = variant
    depths, colors, _ = methods.random_stacks(10)
    bright = colors * (2.0**14, 2.0**14, 2.0**14, 1)
    image, scaled = (methods.lists_of(depths, c).composite(id, **options)[0] for c in (colors, bright))
    np.testing.assert_array_equal(scaled, image * (2.0**14, 2.0**14, 2.0**14, 1))


@PAPERS
def test_depths_scale_where_all_are_in_front_of_the_eye(variant):
    """They are taken by their logarithm, in the lists' own range."""
    id, options = variant
    depths, colors, _ = methods.random_stacks(10)
    image, scaled, moved = (
        methods.lists_of(z, colors).composite(id, **options) for z in (depths, 100 * depths, depths + 100)
    )
    np.testing.assert_allclose(scaled, image, atol=1e-11)
    assert np.abs(moved - image).max() > 1e-3


@PAPERS
def test_float32_images_of_depths_beyond_the_range_are_finite(variant):
    id, options = variant
    mesh = ab.Mesh(np.random.default_rng(0).uniform(-1, 1, (20, 3, 3)), colors=(0.5, 0.25, 1, 0.5))
    for depth_range in ((3.9, 4.0), (0, 1), (-2, -1), (1e-30, 1e30)):
        image = ab.render(mesh, width=32, height=32, device="cpu", method=id, **options, depth_range=depth_range).image
        assert np.isfinite(image).all() and image.max() <= 1 + 1e-6
