"""No method that mixes colours makes one of its own: of any list it stays between the darkest and the brightest.

Then it is off by their range R at most; and by A (max c − min c) alone where coverage A is exact, as both are A times a
mean of the fragments' colours over the same share of the background.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import methods
from abuffer._methods import METHODS

# The flags are of defaults. Other parameters let light through twice, leave a sum as it is, or show black where no draw
# has hit; averages of alphas do not cover exactly, nor do the nearest alone, and two estimators do.
MAKES_COLOURS = [
    ("phenomenological", {"transmission": 0.3}),
    ("phenomenological", {"transmission": 1}),
    ("adaptive", {"k": 3, "renormalise": False}),
    ("stochastic", {"draws": 3, "estimator": "b"}),
]
COVERS_OTHERWISE = [
    ("hybrid", {"k": 3, "coverage": "average"}),
    ("depth_peeling", {"layers": 1}),
    ("depth_peeling", {"layers": 3}),
]
ALL = [("exact", {}), *methods.variants([id for id in METHODS if not METHODS[id].sorts and id != "exact"])]
IN_HULL = [variant for variant in ALL if "hull" in METHODS[variant[0]].flags and variant not in MAKES_COLOURS]
COVERING = [
    variant
    for variant in IN_HULL
    if ("exact_coverage" in METHODS[variant[0]].flags and variant not in COVERS_OTHERWISE)
    or variant[1].get("estimator") == "c"
]
# What absorbances of opaque layers stop at: they let so much through, and coverage is exact but for that.
LET_THROUGH = {"wavelet": 1e-5, "fourier": 1e-5, "mboit": 2.0**-24}

# No number so small that a product of ten is below what float64 has with all its digits.
alphas = st.sampled_from([0.0, 1.0, 1e-7]) | st.floats(1e-30, 1)
channels = st.sampled_from([0.0, 1.0]) | st.floats(1e-30, 1) | st.floats(1, 1e4)
fragments = st.tuples(st.integers(1, 9) | st.floats(1, 9), channels, channels, channels, alphas)
lists = st.lists(fragments, max_size=12)


def checked(frags, colors, background, variants):
    """Asserts all of it, of one pixel over an opaque background."""
    exact = frags.composite()[0, 0, :3]
    everything = np.vstack([colors[:, :3], background])
    low, high = everything.min(axis=0), everything.max(axis=0)
    with np.errstate(divide="ignore"):
        alpha = -np.expm1(np.log1p(-colors[:, 3]).sum())
    own = alpha * np.ptp(colors[:, :3], axis=0) if len(colors) else 0.0
    # Some hundred sums and products of numbers that are no larger; a weight has no sign, however few digits it keeps.
    rounding = 1e-13 * high
    for variant in variants:
        id, options = variant
        got = frags.composite(id, **options)[0, 0, :3]
        name = methods.name_of(variant)
        assert (got >= low - rounding).all() and (got <= high + rounding).all(), f"{name} leaves the hull: {got}"
        off = np.abs(got - exact)
        assert (off <= high - low + rounding).all(), f"{name} is off by more than the range"
        if variant in COVERING:
            most = own + rounding + LET_THROUGH.get(id, 0) * (high - low)
            assert (off <= most).all(), f"{name} is off by more than its coverage of the range"


@settings(max_examples=200, derandomize=True, deadline=None)
@given(lists, st.tuples(channels, channels, channels), st.randoms(use_true_random=False))
def test_no_list_makes_a_method_leave_the_hull_or_its_bounds(rows, background, random):
    rows = np.array(rows, float).reshape(-1, 5)
    order = np.array(random.sample(range(len(rows)), len(rows)), int)[None]
    frags = methods.lists_of(rows[None, :, 0], rows[None, :, 1:], order, (*background, 1))
    checked(frags, rows[:, 1:], background, IN_HULL)


@pytest.mark.parametrize(
    ("variant", "alphas", "message"),
    [
        (("additive", {}), (0.5, 0.75), "leaves the hull"),
        (("weighted_sum", {}), (0.75, 0.75), "leaves the hull"),
        (("adaptive", {"k": 1, "renormalise": False}), (0.5, 0.75), "leaves the hull"),
        # Alphas 0 and 1 cover as two halves do: what the background shows is beyond any mean of the two.
        (("weighted_average", {}), (0, 1), "coverage of the range"),
    ],
    ids=str,
)
def test_what_makes_colours_or_covers_otherwise_would_fail(variant, alphas, message, monkeypatch):
    colors = np.array([[1, 0.5, 1, alphas[0]], [1, 0.5, 1, alphas[1]]])
    background = (0.75, 0.25, 1)
    frags = methods.lists_of([[1, 2]], colors[None], background=(*background, 1))
    monkeypatch.setattr("test_methods_hull.COVERING", [variant])
    with pytest.raises(AssertionError, match=message):
        checked(frags, colors, background, [variant])


def test_two_opaque_layers_reach_those_bounds():
    """White before black, of which the first k submitted are black alone: off by R, and so by A (max c − min c)."""
    colors = np.array([[[1, 1, 1, 1], [0, 0, 0, 1]]])
    frags = methods.lists_of([[1, 2]], colors, [[1, 0]], (0.5, 0.5, 0.5, 1))
    off = np.abs(frags.composite("stencil_routed", k=1) - frags.composite())[0, 0, :3]
    np.testing.assert_array_equal(off, 1)
