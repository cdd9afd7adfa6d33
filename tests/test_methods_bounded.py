"""Closed forms of the bounded methods: what each keeps exactly, and by how much the rest is off."""

import numpy as np
import pytest

import methods
from comparison import CPU32, GPU_TILES
from sheets import render, sheets

# Of what is the same sum in another order, in float64.
ROUNDINGS = 1e-13
GREY = (0.5, 0.5, 0.5, 1.0)


def off(frags, id, **options):
    """What a method's image has more than the exact one, (P, 4)."""
    return (frags.composite(id, **options) - frags.composite())[0]


def rmse(n, alpha, id, **options):
    """Of RGB, with random depths, colours in [0, 1] and alphas up to `alpha`, over grey."""
    frags = methods.lists_of(*methods.random_stacks(n, pixels=4000, alpha=alpha), background=GREY)
    return np.sqrt((off(frags, id, **options)[:, :3] ** 2).mean())


def equal_alphas(n, alpha, seed=0):
    depths, colors, order = methods.random_stacks(n, seed=seed)
    colors[..., 3] = alpha
    return depths, colors, order


# ---- mlab ----


@pytest.mark.parametrize("k", [1, 2, 4])
def test_mlab_is_exact_for_fragments_that_arrive_front_to_back_or_back_to_front(k):
    """Whatever is merged are true neighbours."""
    depths, colors, order = methods.random_stacks(24)
    rising = np.argsort(np.argsort(depths, axis=1), axis=1)
    for arrival in (rising, -rising):
        assert np.abs(off(methods.lists_of(depths, colors, arrival, GREY), "mlab", k=k)).max() < ROUNDINGS
    assert np.abs(off(methods.lists_of(depths, colors, order, GREY), "mlab", k=k)).max() > 0.01


@pytest.mark.parametrize("k", [1, 2, 4])
def test_mlab_puts_a_new_fragment_in_front_of_those_of_its_depth(k):
    """So fragments of one depth arrive back to front."""
    _, colors, order = methods.random_stacks(24)
    frags = methods.lists_of(np.ones((200, 24)), colors, order, GREY)
    assert np.abs(off(frags, "mlab", k=k)).max() < ROUNDINGS


def test_mlab_of_2_is_off_by_one_swap_for_depths_that_arrive_as_1_2_4_3():
    """T₃ α₃ α₄ (c₄ − c₃): 4 is merged behind 2, where 3 can no longer come between."""
    _, colors, _ = methods.random_stacks(4)
    arrival = [[0, 1, 3, 2]] * 200  # of depths 1 to 4
    frags = methods.lists_of(np.tile(np.arange(1.0, 5), (200, 1)), colors, arrival, GREY)
    alpha = colors[..., 3:]
    through = (1 - alpha[:, 0]) * (1 - alpha[:, 1])
    wanted = through * alpha[:, 2] * alpha[:, 3] * (colors[:, 3] - colors[:, 2])[:, :3]
    np.testing.assert_allclose(off(frags, "mlab", k=2)[:, :3], wanted, atol=ROUNDINGS)
    assert np.abs(wanted).max() > 0.05
    assert np.abs(off(frags, "mlab", k=3)).max() < ROUNDINGS


@pytest.mark.parametrize("k", [1, 2, 4])
def test_the_alpha_of_mlab_is_exact_in_any_order(k):
    error = off(methods.lists_of(*methods.random_stacks(24, alpha=0.5)), "mlab", k=k)
    assert np.abs(error[:, 3]).max() < ROUNDINGS < 0.01 < np.abs(error[:, :3]).max()


# ---- hybrid ----


@pytest.mark.parametrize("coverage", ["exact", "average"])
def test_hybrid_covers_exactly_where_alphas_are_equal(coverage):
    frags = methods.lists_of(*equal_alphas(24, 0.1))
    error = off(frags, "hybrid", k=3, coverage=coverage)
    assert np.abs(error[:, 3]).max() < ROUNDINGS < 0.01 < np.abs(error[:, :3]).max()


def test_hybrid_as_published_never_covers_more_than_exactly():
    """(1 − ᾱ)ᵐ ≥ Π (1 − αᵢ), the mean of logarithms being at most the logarithm of the mean."""
    for n in (5, 8, 24):
        error = off(methods.lists_of(*methods.random_stacks(n, alpha=0.6)), "hybrid", k=3, coverage="average")[:, 3]
        assert error.max() < ROUNDINGS
        assert error.min() < -1e-3


# ---- adaptive ----


def test_adaptive_without_renormalisation_darkens_deep_thin_media():
    """The greedy steps occlude too early: RMSE 0.207 and 0.036 in a trial of a few hundred pixels."""
    plain, renormalised = (rmse(64, 0.2, "adaptive", k=4, renormalise=r) for r in (False, True))
    assert plain == pytest.approx(0.207, rel=0.1)
    assert renormalised == pytest.approx(0.036, rel=0.1)


def test_adaptive_weighs_by_the_step_function_that_is_left():
    """White halves of depths 1, 8, 9 and k = 2: of areas 7/4 and 1/8 node 9 goes, and V is 1, ½, ⅛."""
    frags = methods.lists_of([[9.0, 1.0, 8.0]], [[[1, 1, 1, 0.5]] * 3])
    plain = frags.composite("adaptive", k=2, renormalise=False)[0, 0]
    np.testing.assert_array_equal(plain, [0.5 + 0.25 + 0.0625] * 3 + [0.875])


# ---- bucket_peeling ----


@pytest.mark.parametrize("buckets", [2, 8, 32, 64])
def test_bucket_peeling_is_exact_without_collisions(buckets):
    _, colors, order = methods.random_stacks(buckets)
    depths = np.tile(np.arange(buckets, dtype=float), (200, 1))
    frags = methods.lists_of(depths, colors, order, GREY)
    assert np.abs(off(frags, "bucket_peeling", buckets=buckets)).max() < ROUNDINGS
    assert np.abs(off(frags, "bucket_peeling", buckets=buckets // 2)).max() > 0.1


@pytest.mark.parametrize(("n", "buckets"), [(8, 32), (16, 8), (8, 4)])
def test_bucket_peeling_keeps_a_fragment_of_each_bucket_that_is_hit(n, buckets):
    """Of n uniform depths two are the ends of the range, in the first and the last bucket, and the others are uniform.

    Borders that are fixed before would be hit K (1 − (1 − 1/K)ⁿ) times.
    """
    pixels = 40_000
    depths = np.random.default_rng([n, buckets]).uniform(1, 10, (pixels, n))
    frags = methods.lists_of(depths, np.full((pixels, n, 4), 0.5))
    alpha = frags.composite("bucket_peeling", buckets=buckets)[0, :, 3]
    kept = np.round(-np.log2(1 - alpha))  # alpha = 1 − 2^−kept
    sigma = kept.std() / np.sqrt(pixels)
    share = 1 - 1 / buckets
    assert abs(kept.mean() - (2 + (buckets - 2) * (1 - share ** (n - 2)))) < 5 * sigma
    assert abs(kept.mean() - buckets * (1 - share**n)) > 5 * sigma


def test_bucket_peeling_of_one_depth_keeps_the_last_submitted():
    _, colors, order = methods.random_stacks(5)
    image = methods.lists_of(np.full((200, 5), 3.0), colors, order).composite("bucket_peeling")[0]
    last = np.take_along_axis(colors, np.argmax(order, axis=1)[:, None, None], axis=1)[:, 0]
    np.testing.assert_allclose(image[:, :3], last[:, :3] * last[:, 3:], atol=ROUNDINGS)
    np.testing.assert_allclose(image[:, 3], last[:, 3], atol=ROUNDINGS)


# ---- stencil_routed ----


@pytest.mark.parametrize("k", [1, 3, 8])
def test_stencil_routed_is_exact_of_the_first_k_submitted(k):
    depths, colors, order = methods.random_stacks(12)
    image = methods.lists_of(depths, colors, order, GREY).composite("stencil_routed", k=k)
    first = np.where(order < k, colors[..., 3], 0)  # the others invisible
    wanted = methods.lists_of(depths, np.dstack([colors[..., :3], first]), order, GREY).composite()
    np.testing.assert_allclose(image, wanted, atol=ROUNDINGS)
    assert np.abs(off(methods.lists_of(depths, colors, order, GREY), "stencil_routed", k=k)).max() > 0.1


# ---- all of them ----

BOUNDED = [
    ("k_buffer", {}),
    ("mlab", {}),
    ("hybrid", {}),
    ("hybrid", {"coverage": "average"}),
    ("adaptive", {}),
    ("adaptive", {"renormalise": False}),
    ("stencil_routed", {}),
]


@pytest.mark.parametrize("k", [1, 4, 9])
@pytest.mark.parametrize(("id", "options"), BOUNDED)
def test_up_to_k_fragments_are_exact_and_twice_as_many_are_not(id, options, k):
    """One more is, where it is a tail of its own, or merged with its neighbour when all have come."""
    most = k + 1 if id in ("mlab", "hybrid") else k
    for n in (*range(1, most + 1), 2 * k + 1):
        frags = methods.lists_of(*methods.random_stacks(n, alpha=0.9), background=GREY)
        error = np.abs(off(frags, id, k=k, **options)).max()
        assert error < ROUNDINGS if n <= most else error > 1e-4


@pytest.mark.parametrize("id", ["mlab", "adaptive"])
def test_invisible_fragments_change_no_bit(id):
    """They would take a node from what is visible."""
    depths, colors, order = methods.random_stacks(24)
    colors[:, 12:, 3] = 0
    images = [methods.lists_of(depths[:, :n], colors[:, :n], order[:, :n], GREY).composite(id, k=2) for n in (12, 24)]
    np.testing.assert_array_equal(*images)


def test_what_a_k_buffer_drops_is_seen_through_what_it_keeps():
    """|ΔC| ≤ T R, of what the k nearest let through and the range of all colours: reached, never exceeded."""
    ratios = []
    for n in range(2, 9):
        depths, colors, order = methods.random_stacks(n, pixels=6000)
        rng = np.random.default_rng(n)
        # Corners of what is possible come near the bound.
        colors = np.where(rng.random(colors.shape) < 0.5, np.round(colors), colors)
        background = rng.integers(0, 2, 3)
        frags = methods.lists_of(depths, colors, order, (*background, 1))
        k = int(rng.integers(1, n))
        alpha = np.take_along_axis(colors[..., 3], np.argsort(depths, axis=1), axis=1)
        through = np.prod(1 - alpha[:, :k], axis=1)
        low = np.minimum(colors[..., :3].min(axis=1), background)
        high = np.maximum(colors[..., :3].max(axis=1), background)
        bound = (through[:, None] * (high - low)).ravel()
        error = np.abs(off(frags, "k_buffer", k=k)[:, :3]).ravel()
        assert (error <= bound + ROUNDINGS).all()
        ratios.append((error[bound > 0.01] / bound[bound > 0.01]).max())
    assert max(ratios) > 0.99


# RMSE of a few hundred pixels each, by a program of its own; another has other depths and colours.
KINDS = {"k_buffer": {"k": 4}, "mlab": {"k": 4}, "hybrid": {"k": 4, "coverage": "average"}, "adaptive": {"k": 4}}
BANDS = {
    (4, 0.9): (0, 0, 0, 0),
    (8, 0.2): (0.039, 0.004, 0.005, 0.007),
    (8, 0.9): (0.028, 0.011, 0.017, 0.018),
    (16, 0.9): (0.026, 0.019, 0.023, 0.034),
    (64, 0.2): (0.047, 0.041, 0.040, 0.036),
}


@pytest.mark.parametrize(("n", "alpha"), BANDS)
def test_errors_of_random_stacks_are_of_the_expected_size(n, alpha):
    for (id, options), expected in zip(KINDS.items(), BANDS[n, alpha], strict=True):
        assert rmse(n, alpha, id, **options) == pytest.approx(expected, rel=0.5, abs=ROUNDINGS), id


@pytest.mark.parametrize("id", KINDS)
def test_that_size_would_tell_k_of_1_from_4(id):
    expected = dict(zip(KINDS, BANDS[16, 0.9], strict=True))[id]
    assert rmse(16, 0.9, id, **KINDS[id] | {"k": 1}) > 1.5 * expected


@pytest.mark.parametrize(("n", "alpha"), list(BANDS)[1:])
def test_mlab_of_8_is_no_worse_than_of_4(n, alpha):
    assert rmse(n, alpha, "mlab", k=8) <= rmse(n, alpha, "mlab", k=4)


# ---- what is left out ----


@pytest.mark.parametrize("pipeline", [CPU32, GPU_TILES], ids=str)
@pytest.mark.parametrize("id", ["mlab", "hybrid", "adaptive", "bucket_peeling", "stencil_routed"])
def test_what_is_left_out_is_counted(id, pipeline):
    """Merged, or dropped by the methods that show nothing of it."""
    options = {"buckets": 4} if id == "bucket_peeling" else {"k": 4}
    scene = sheets(np.arange(1, 12), [(1, 0, 0, 0.5)] * 11)
    stats = render(pipeline, scene, id, width=3, height=2, **options).stats
    found = (stats.merged_fragments, stats.dropped_fragments)
    drops = id in ("bucket_peeling", "stencil_routed")
    assert found == ((0, 3 * 2 * 7) if drops else (3 * 2 * 7, 0))
