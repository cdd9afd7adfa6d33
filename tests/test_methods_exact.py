"""Closed forms of `exact`: the colours of lists that can be said in a formula."""

import numpy as np
import pytest

import methods

U64 = 2.0**-53


def stack(colors, alphas, background=(0, 0, 0, 0), **options):
    """The exact image of greys, (n,), or RGB, (n, 3), front to back."""
    colors, alphas = np.asarray(colors, float), np.asarray(alphas, float)
    rgb = np.broadcast_to(colors[:, None] if colors.ndim == 1 else colors, (len(colors), 3))
    rgba = np.c_[rgb, np.broadcast_to(alphas, len(rgb))]
    return methods.lists_of(np.arange(1, len(rgb) + 1)[None], rgba[None], background=background).composite(**options)[
        0, 0
    ]


def assert_equal_to(got, wanted, n):
    """Within the forward error bound of n layers, γ_{2n+2} C, and as much again for the closed form."""
    np.testing.assert_allclose(got, wanted, rtol=4 * (n + 1) * U64, atol=0)


def test_geometric_colours_make_a_geometric_series():
    for n in (1, 2, 10, 100):
        for alpha in (0.01, 0.5, 0.9):
            for q in (0.3, 0.9):
                ratio = q * (1 - alpha)
                wanted = alpha * (1 - ratio**n) / (1 - ratio)
                assert_equal_to(stack(q ** np.arange(n), alpha)[0], wanted, n)


def test_alternating_white_and_black_are_a_series_of_every_other_power():
    for n in (1, 2, 3, 10, 101):
        for alpha in (0.1, 0.5, 0.9):
            r = 1 - alpha
            wanted = alpha * (1 - r ** (2 * -(-n // 2))) / (1 - r * r)
            assert_equal_to(stack((np.arange(n) + 1) % 2, alpha)[0], wanted, n)


def test_black_in_front_would_fail_that_formula():
    with pytest.raises(AssertionError):
        assert_equal_to(stack([0, 1, 0], 0.5)[0], 0.5 * (1 - 0.5**4) / 0.75, 3)


def test_red_over_green_over_blue():
    """The example of Enderton et al. 2010: alphas .45, .45 and 1."""
    assert_equal_to(stack(np.eye(3), [0.45, 0.45, 1]), [0.45, 0.2475, 0.3025, 1], 3)
    assert_equal_to(stack(np.eye(3)[:2], 0.45, background=(0, 0, 1)), [0.45, 0.2475, 0.3025, 1], 3)


def test_alphas_of_1_over_their_place_from_behind_make_the_mean():
    """`over` is then a running average: the i-th from behind has a share of 1/i."""
    colors = np.random.default_rng(1).random((200, 3))
    image = stack(colors, 1 / np.arange(200, 0, -1))
    assert_equal_to(image, [*colors.mean(axis=0), 1], 200)


def test_n_layers_of_alpha_1_over_n_approach_1_minus_1_over_e():
    for n in (10, 1000, 100_000):
        wanted = -np.expm1(n * np.log1p(-1 / n))
        assert_equal_to(stack(np.ones(n), 1 / n), wanted, n)
    assert abs(stack(np.ones(1000), 1 / 1000)[0] - 0.632305) < 5e-7
    # (1 − 1/n)ⁿ = (1 − 1/(2n) + …) / e
    assert abs(stack(np.ones(100_000), 1e-5)[0] - (1 - np.exp(-1))) < 0.51 * np.exp(-1) * 1e-5
