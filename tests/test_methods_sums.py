"""Closed forms of the methods that sum fragments in whatever order: additive, weighted_sum, weighted_average, wboit and
phenomenological."""

import numpy as np
import pytest

import abuffer as ab
import methods

U64 = 2.0**-53
BEHIND = (0.2, 0.6, 0.4, 0.5)
SUMS = ["additive", "weighted_sum", "weighted_average", "wboit", "phenomenological"]
DEPTH_WEIGHTS = ["7", "8", "9", "10"]


def at_window_depth(d):
    """Depths that have a window depth, of a range from 1 to 2."""
    return 2 / (2 - np.asarray(d, float))


RANGE = {"depth_range": (1.0, 2.0)}


def sums(colors):
    """Σ α c and Σ α of lists (..., n, 4)."""
    alpha = colors[..., 3:]
    return (alpha * colors[..., :3]).sum(axis=-2), alpha.sum(axis=-2)


def mean_over(colors, weights, background=BEHIND):
    """Equation 5 of McGuire and Bavoil 2013, with weights (..., n): A Σ α w c / Σ α w, over a straight background."""
    through = np.prod(1 - colors[..., 3], axis=-1)[..., None]
    share = (colors[..., 3] * weights)[..., None]
    mean = (share * colors[..., :3]).sum(axis=-2) / share.sum(axis=-2)
    *rgb, alpha = background
    image = (1 - through) * mean + through * alpha * np.asarray(rgb)
    return np.concatenate([image, 1 - through * (1 - alpha)], axis=-1)


def weights_of(equation, z, alpha, d=None):
    """w of equations 7 to 10."""
    if equation == "10":
        return alpha * np.maximum(1e-2, 3e3 * (1 - d) ** 3)
    of_depth = {
        "7": lambda: 10 / (1e-5 + (z / 5) ** 2 + (z / 200) ** 6),
        "8": lambda: 10 / (1e-5 + (z / 10) ** 3 + (z / 200) ** 6),
        "9": lambda: 0.03 / (1e-5 + (z / 200) ** 4),
    }
    return alpha * np.clip(of_depth[equation](), 1e-2, 3e3)


@pytest.mark.parametrize("method", SUMS)
def test_sums_do_not_depend_on_the_order_of_depths_or_submission_but_through_weights(method):
    """The depths of two fragments exchanged: nothing changes, unless weights are of depth. Within 3n roundings."""
    depths, colors, order = methods.random_stacks(8)
    weightless = {"wboit": {"weight": "none"}, "phenomenological": RANGE}.get(method, {})
    wanted = methods.lists_of(depths, colors, order, BEHIND).composite(method, **weightless)
    again = methods.lists_of(depths[:, ::-1], colors, order[:, ::-1], BEHIND).composite(method, **weightless)
    if method == "phenomenological":
        assert np.abs(again - wanted).max() > 1e-3
    else:
        np.testing.assert_allclose(again, wanted, rtol=3 * 8 * U64, atol=8 * 8 * U64)


def test_additive_is_the_sum_and_leaves_alpha():
    depths, colors, order = methods.random_stacks(12)
    image = methods.lists_of(depths, colors, order, BEHIND).composite("additive")[0]
    wanted = sums(colors)[0] + np.multiply(BEHIND[:3], BEHIND[3])
    np.testing.assert_allclose(image[:, :3], wanted, rtol=3 * 12 * U64)
    np.testing.assert_array_equal(image[:, 3], BEHIND[3])
    assert image[:, :3].max() > 2  # nothing is clamped


def test_weighted_sum_is_the_sum_in_front_of_what_alphas_leave():
    depths, colors, order = methods.random_stacks(12)
    image = methods.lists_of(depths, colors, order, BEHIND).composite("weighted_sum")[0]
    color, alpha = sums(colors)
    np.testing.assert_allclose(
        image, np.c_[color, alpha] + (1 - alpha) * np.multiply([*BEHIND[:3], 1], BEHIND[3]), rtol=0, atol=12 * 12 * U64
    )
    assert image[:, 3].max() > 2  # alpha neither


def test_equal_layers_of_a_weighted_sum_are_linear_in_their_number():
    """1 − N α instead of (1 − α)ᴺ of the background, which counts negatively above 1/α of them."""
    for n in (1, 4, 5, 20):
        stack = np.broadcast_to([0.0, 0.0, 0.0, 0.25], (1, n, 4))
        image = methods.lists_of(np.arange(n)[None], stack, background=(1, 1, 1)).composite("weighted_sum")[0, 0]
        np.testing.assert_array_equal(image, [1 - n / 4] * 3 + [1])


@pytest.mark.parametrize(
    ("method", "options", "power"),
    [
        ("weighted_sum", {}, 2),
        ("wboit", {"weight": "none"}, 2),
        *(("wboit", {"weight": weight} | RANGE, 1) for weight in DEPTH_WEIGHTS),
    ],
)
def test_what_power_of_alpha_errors_go_with(method, options, power):
    """Alphas a tenth: errors a hundredth, or with weights of depth a tenth, within what the next power adds."""
    depths, colors, order = methods.random_stacks(6)
    rmse = []
    for scale in (1e-3, 1e-4):
        scaled = colors * [1, 1, 1, scale]
        frags = methods.lists_of(at_window_depth(depths / 10), scaled, order, (0.2, 0.6, 0.4))
        rmse.append(np.sqrt(np.mean((frags.composite(method, **options) - frags.composite()) ** 2)))
    assert rmse[1] / rmse[0] == pytest.approx(0.1**power, rel=1e-2)


def fuzzed():
    """12,500 lists in batches of one length: even colours, colours at the ends of the range, large and small alphas."""
    rng = np.random.default_rng(24)
    for n in (2, 3, 5, 9, 16):
        colors = rng.uniform(0, 1, (2500, n, 4))
        colors[::2, :, :3] = colors[::2, :, :3].round()
        colors[..., 3] **= rng.choice([0.3, 1, 3, 9], (2500, 1))
        yield rng.uniform(0, 1, (2500, n)), colors


BLACK_TO_WHITE = (0.0, 1.0, 0.5)


def ratios(method, **options):
    """|ΔC| over R Σ_{i<j} αᵢ αⱼ = R ((Σ α)² − Σ α²) / 2, of each list and channel."""
    found = []
    for d, colors in fuzzed():
        frags = methods.lists_of(at_window_depth(d), colors, background=BLACK_TO_WHITE)
        off = np.abs(frags.composite(method, **options) - frags.composite())[0, :, :3]
        behind = np.broadcast_to(BLACK_TO_WHITE, (len(colors), 1, 3))
        range_of = np.ptp(np.concatenate([colors[..., :3], behind], axis=1), axis=1)
        alpha = colors[..., 3]
        # Summed pair by pair: the difference of squares would cancel.
        pairs = sum((alpha[:, :i] * alpha[:, i : i + 1]).sum(axis=1) for i in range(1, alpha.shape[1]))
        bound = pairs[:, None] * range_of
        above = bound > 1e-9  # what is less is of the size of roundings
        found.append(off[above] / bound[above])
    return np.concatenate(found)


@pytest.mark.parametrize(("method", "options"), [("wboit", {"weight": "none"}), ("weighted_sum", {})])
def test_without_weights_of_depth_errors_have_a_second_order_bound(method, options):
    """Nearly reached, never exceeded."""
    found = ratios(method, **options)
    assert len(found) > 10_000
    assert 0.97 < found.max() <= 1 + 1e-6  # roundings of 1e-15 over a bound of 1e-9


@pytest.mark.parametrize("weight", DEPTH_WEIGHTS)
def test_weights_of_depth_break_that_bound(weight):
    assert ratios("wboit", weight=weight, **RANGE).max() > 2


# RMSE of stacks of random window depths and colours in front of .5, by how many and the greatest alpha:
# unweighted, by equation 10, and as a weighted average.
BANDS = {
    (4, 0.9): (0.095, 0.068, 0.096),
    (8, 0.2): (0.018, 0.061, 0.018),
    (8, 0.9): (0.161, 0.083, 0.161),
    (16, 0.9): (0.187, 0.120, 0.187),
    (64, 0.2): (0.066, 0.033, 0.066),
    # And of thin media; averages are as unweighted sums there.
    (8, 0.1): (4.8e-3, 4.1e-2, 4.8e-3),
    (8, 0.01): (5.5e-5, 5.5e-3, 5.5e-5),
    (8, 0.001): (5.9e-7, 5.4e-4, 5.9e-7),
}


@pytest.mark.parametrize(("stack", "wanted"), BANDS.items(), ids=str)
def test_errors_of_random_stacks_are_as_published_here(stack, wanted):
    """Within half of them: they are of 200 to 300 trials, these of 2,000."""
    n, most = stack
    rng = np.random.default_rng(311)
    colors = rng.uniform(0, 1, (2000, n, 4)) * [1, 1, 1, most]
    frags = methods.lists_of(at_window_depth(rng.uniform(0, 1, (2000, n))), colors, background=0.5)
    images = (
        frags.composite("wboit", weight="none"),
        frags.composite("wboit", weight="10", **RANGE),
        frags.composite("weighted_average"),
    )
    rmse = [np.sqrt(np.mean((image - frags.composite())[..., :3] ** 2)) for image in images]
    np.testing.assert_allclose(rmse, wanted, rtol=0.5)


@pytest.mark.parametrize("weight", [*DEPTH_WEIGHTS, "none"])
def test_wboit_is_exact_for_equal_colours_whatever_the_weights(weight):
    depths, colors, order = methods.random_stacks(12)
    colors[..., :3] = colors[:, :1, :3]
    frags = methods.lists_of(depths, colors, order, BEHIND)
    image = frags.composite("wboit", weight=weight, depth_range=(1, 10))
    np.testing.assert_allclose(image, frags.composite(), rtol=6 * 12 * U64, atol=0)
    colors[:, 0, :3] = 1 - colors[:, 0, :3]  # one of another colour
    frags = methods.lists_of(depths, colors, order, BEHIND)
    image = frags.composite("wboit", weight=weight, depth_range=(1, 10))
    assert np.abs(image - frags.composite()).max() > 1e-2


@pytest.mark.parametrize("weight", DEPTH_WEIGHTS)
def test_wboit_of_two_layers_has_its_closed_form(weight):
    """C = A (w₁α₁c₁ + w₂α₂c₂) / (w₁α₁ + w₂α₂) over the background, with the published weights."""
    rng = np.random.default_rng(2)
    d = np.sort(rng.uniform(0, 1, (500, 2)), axis=1)
    colors = rng.uniform(0.01, 1, (500, 2, 4))
    near, far = 0.5, 400.0
    z = near * far / (far - d * (far - near))
    frags = methods.lists_of(z, colors, background=BEHIND)
    image = frags.composite("wboit", weight=weight, depth_range=(near, far))[0]
    wanted = mean_over(colors, weights_of(weight, z, colors[..., 3], d))
    # d is recovered from z, whose error (1 − d)³ and the 6th power multiply.
    np.testing.assert_allclose(image, wanted, rtol=0, atol=1e-11)
    other = {"7": "8", "8": "9", "9": "7", "10": "7"}[weight]
    assert np.abs(image - mean_over(colors, weights_of(other, z, colors[..., 3], d))).max() > 1e-2


def test_two_layers_whose_weights_fall_as_transmittance_are_exact():
    """w₂ / w₁ = 1 − α₁: by equation 10, which also weighs by alpha."""
    near, far = [1.0, 0.2, 0.4, 0.5], [0.1, 0.9, 0.3, 0.8]
    d = 1 - np.cbrt((1 - near[3]) * near[3] / far[3])
    for depth, least, most in ((d, 0, 4e-15), (d + 0.1, 1e-2, 1)):  # the second is the control
        frags = methods.lists_of(at_window_depth([[0, depth]]), [[near, far]], background=BEHIND)
        off = np.abs(frags.composite("wboit", weight="10", **RANGE) - frags.composite()).max()
        assert least <= off <= most


def test_an_opaque_front_is_mixed_with_what_it_hides():
    """ΔC = w₂α₂ (c₂ − c₁) / (w₁ + w₂α₂): half the range where both are opaque and about as near."""
    colors = [[[1, 1, 1, 1], [0, 0, 0, 1]]]
    for weight in (*DEPTH_WEIGHTS, "none"):
        frags = methods.lists_of([[3.0, 3.0001]], colors)
        image = frags.composite("wboit", weight=weight, depth_range=(1, 10))[0, 0]
        np.testing.assert_array_equal(frags.composite()[0, 0], 1)
        assert image[0] == pytest.approx(0.5, abs=1e-3)
        assert image[3] == 1


def test_equation_10_depends_on_near_and_far_and_the_others_do_not():
    depths, colors, order = methods.random_stacks(6)
    frags = methods.lists_of(depths, colors, order, BEHIND)
    for weight in (*DEPTH_WEIGHTS, "none"):
        images = [frags.composite("wboit", weight=weight, depth_range=of) for of in ((1, 10), (0.1, 1000))]
        assert (np.abs(images[0] - images[1]).max() > 1e-2) == (weight == "10"), weight


def test_equations_7_to_9_depend_on_the_scale_of_the_scene_and_exact_does_not():
    depths, colors, order = methods.random_stacks(6)
    scales = (1, 128)
    stacks = [methods.lists_of(depths * scale, colors, order, BEHIND) for scale in scales]
    np.testing.assert_array_equal(*(frags.composite() for frags in stacks))
    for weight in ("7", "8", "9"):
        images = [frags.composite("wboit", weight=weight) for frags in stacks]
        assert np.abs(images[0] - images[1]).max() > 1e-2, weight
    scaled = [f.composite("wboit", weight="10", depth_range=(s, 10 * s)) for f, s in zip(stacks, scales, strict=True)]
    np.testing.assert_array_equal(*scaled)  # by a power of two, which rounds nothing


@pytest.mark.parametrize("weight", ["7", "8", "9"])
def test_half_precision_overflows_at_22_near_layers_and_ours_at_none(weight):
    """22 · 3000 > 65504."""
    share = np.float16(weights_of(weight, 1e-6, 1.0))
    total, finite = np.float16(0), []
    with np.errstate(over="ignore"):
        for _ in range(22):
            total = total + share
            finite.append(np.isfinite(total))
    assert finite == [True] * 21 + [False]

    n = 10_000
    colors = np.tile([[1, 1, 1, 0.5], [0, 0, 0, 0.5]], (n // 2, 1))
    frags = methods.lists_of(np.full((1, n), 1e-6), colors[None])
    # A grey of many terms: each adds a rounding at most.
    np.testing.assert_allclose(frags.composite("wboit", weight=weight)[0, 0], [0.5] * 3 + [1], rtol=2 * n * U64)
    z = 1e-3 * (1 + 1e-5 * np.arange(n))[:, None]
    corners = np.stack([np.c_[x * z, y * z, -z] for x, y in ((-3, -3), (3, -3), (0, 9))], axis=1)
    camera = ab.Camera.look_at((0, 0, 0), (0, 0, -1))
    image = ab.render(
        ab.Mesh(corners, colors=colors), camera, width=4, height=4, method="wboit", weight=weight, device="cpu"
    ).image
    # All weights are the greatest.
    np.testing.assert_allclose(image, np.broadcast_to([0.5, 0.5, 0.5, 1], image.shape), rtol=2 * n * methods.U)


def test_an_invisible_fragment_makes_a_weighted_average_leak():
    """Alphas 1 and 0: (1 − ½)² of the background."""
    frags = methods.lists_of([[1, 2]], [[[1, 1, 1, 1], [1, 1, 1, 0]]], background=(0, 0, 0))
    np.testing.assert_array_equal(frags.composite("weighted_average")[0, 0], [0.75, 0.75, 0.75, 1])
    np.testing.assert_array_equal(frags.composite()[0, 0], 1)


def phenomenological_weights(d, held_back):
    return np.clip((10 * (1 - 0.99 * d) * held_back) ** 3, 0.01, 30)


def test_phenomenological_transparency_without_transmission_is_a_mean_of_its_weights():
    rng = np.random.default_rng(35)
    d, colors = rng.uniform(0, 1, (500, 6)), rng.uniform(0, 1, (500, 6, 4))
    image = methods.lists_of(at_window_depth(d), colors, background=BEHIND).composite("phenomenological", **RANGE)[0]
    wanted = mean_over(colors, phenomenological_weights(d, colors[..., 3]))
    np.testing.assert_allclose(image, wanted, rtol=0, atol=1e-13)
    assert np.abs(image - mean_over(colors, 1.0)).max() > 1e-2


@pytest.mark.parametrize("t", [0.0, 0.25, 0.9, 1.0])
def test_phenomenological_transparency_is_as_published_and_has_its_limit(t):
    """C = (1 − M) Σ α w c / Σ α (1 − t) w + M B with M = Π (1 − α (1 − t)). At t = 1: Σ α times the mean, and all of B."""
    rng = np.random.default_rng(36)
    d, colors = rng.uniform(0, 1, (500, 6)), rng.uniform(0, 1, (500, 6, 4))
    frags = methods.lists_of(at_window_depth(d), colors, background=(0.2, 0.6, 0.4))
    image = frags.composite("phenomenological", transmission=t, **RANGE)[0]
    held_back = colors[..., 3] * (1 - t)
    through = np.prod(1 - held_back, axis=1)[:, None]
    share = (colors[..., 3] * phenomenological_weights(d, held_back))[..., None]
    mean = (share * colors[..., :3]).sum(axis=1) / share.sum(axis=1)
    amount = (1 - through) / (1 - t) if t < 1 else colors[..., 3].sum(axis=1)[:, None]
    np.testing.assert_allclose(image[:, :3], amount * mean + through * [0.2, 0.6, 0.4], rtol=0, atol=1e-13)
    shown = [frags.composite("phenomenological", background=b, transmission=t, **RANGE)[0] for b in (0, 1)]
    np.testing.assert_allclose((shown[1] - shown[0])[:, :3], np.broadcast_to(through, (500, 3)), atol=1e-14)


def test_phenomenological_transparency_is_continuous_up_to_full_transmission():
    depths, colors, order = methods.random_stacks(6)
    frags = methods.lists_of(depths, colors, order, BEHIND)
    ends = [frags.composite("phenomenological", transmission=t, depth_range=(1, 10)) for t in (1 - 1e-9, 1)]
    np.testing.assert_allclose(*ends, atol=1e-7)  # 1e-9 times a derivative of some Σ α
