"""Moment-based transparency: where it is exact, how far off it is elsewhere, and what it does at the extremes."""

import numpy as np
import pytest

import abuffer as ab
import methods
from abuffer import ParameterError
from abuffer._methods import METHODS

RANGE = (1.0, 10.0)
# All that there is, by the columns of the tables below.
KINDS = [{"moments": n, "trigonometric": t} for t in (False, True) for n in (4, 6, 8)]
POWER, TRIGONOMETRIC = KINDS[:3], KINDS[3:]
# For 32-bit floats, as published; what is exact but for the bias is off by less than it, or by little more.
LAMBDA = (5e-7, 5e-6, 5e-5, 4e-7, 8e-7, 1.5e-6)


# Four power moments of 16 bits, and λ for them.
SIXTEEN = {"moments": 4, "trigonometric": False, "bits": 16}
LAMBDA_16 = 6e-5


def name_of(kind):
    bits = "-16-bits" if "bits" in kind else ""
    return f"{'trigonometric' if kind['trigonometric'] else 'power'}-{kind['moments']}{bits}"


kinds = pytest.mark.parametrize("kind", KINDS, ids=name_of)
kinds_and_bits = pytest.mark.parametrize("kind", [*KINDS, SIXTEEN], ids=name_of)


def lists(zeta, grey, alpha, behind=0.5):
    """Lists of grey fragments at depths ζ in −1 … 1, which are logarithms over RANGE."""
    colors = np.stack([grey, grey, grey, alpha], axis=-1)
    depths = 10 ** ((np.asarray(zeta) + 1) / 2)
    return methods.lists_of(depths, colors, background=(behind, behind, behind, 1))


def random_lists(n, most_alpha, pixels=3000, apart=0.0, seed=3):
    """Of n fragments at depths that are `apart` at least."""
    rng = np.random.default_rng([seed, n])
    zeta = np.sort(rng.uniform(-1, 1 - (n - 1) * apart, (pixels, n)), axis=1) + apart * np.arange(n)
    return lists(zeta, rng.uniform(0, 1, (pixels, n)), rng.uniform(0, most_alpha, (pixels, n)))


def errors(frags, **options):
    image = frags.composite("mboit", depth_range=RANGE, **options)
    return (image - frags.composite())[..., 0]


def rmse(frags, **options):
    return np.sqrt(np.mean(errors(frags, **options) ** 2))


def spread_lists(n):
    """Of n fragments at depths spread evenly, but for a little."""
    rng = np.random.default_rng([4, n])
    middle = np.linspace(-0.9, 0.9, n) if n > 1 else np.zeros(1)
    zeta = middle + rng.uniform(-0.05, 0.05, (3000, n))
    return lists(zeta, rng.uniform(0, 1, (3000, n)), rng.uniform(0, 0.9, (3000, n)))


@pytest.mark.parametrize("n", range(1, 7))
@pytest.mark.parametrize(("kind", "bias"), list(zip(KINDS, LAMBDA, strict=True)), ids=map(name_of, KINDS))
def test_one_depth_more_than_half_the_moments_is_still_exact_without_overestimation(kind, bias, n):
    """m + 1 depths, one of them that of the fragment, are their own canonical representation. Up to λ; of complex moments
    up to some λ, under 1e-5."""
    off = np.abs(errors(spread_lists(n), **kind, beta=0)).max()
    if n <= kind["moments"] // 2 + 1:
        assert off < max(bias, 1e-5)
    else:
        assert off > 1e-3, "more depths should not be exact"


def test_two_complex_moments_tell_two_depths_apart_to_a_tenth_of_the_bias():
    assert rmse(spread_lists(2), **TRIGONOMETRIC[0], beta=0) < 4e-8


@kinds
def test_overestimation_makes_a_fragment_hide_itself(kind):
    """By β of its own absorbance: RMSE 0.0108 of two random layers, and none where β is 0."""
    frags = random_lists(2, 0.9, apart=0.1)
    assert rmse(frags, **kind, beta=0.25) == pytest.approx(0.0108, rel=0.5)
    assert rmse(frags, **kind, beta=0) < 5e-5


# RMSE of n layers of alphas up to α, with β = 0.25: power moments 4, 6, 8, then trigonometric ones. Measured with another
# program, on some hundred pixels: bands of ± 50 %.
TABLE = {
    (4, 0.9): (0.023, 0.015, 0.016, 0.029, 0.015, 0.015),
    (8, 0.2): (0.004, 0.003, 0.003),
    (8, 0.9): (0.057, 0.038, 0.029, 0.067, 0.050, 0.036),
    (16, 0.9): (0.078, 0.061, 0.049, 0.092, 0.072, 0.061),
    (64, 0.2): (0.025, 0.019, 0.016),
}


@pytest.mark.parametrize(("n", "most_alpha"), TABLE)
def test_errors_of_random_layers_are_in_their_bands(n, most_alpha):
    frags = random_lists(n, most_alpha)
    for kind, wanted in zip(KINDS, TABLE[n, most_alpha], strict=False):
        assert rmse(frags, **kind) == pytest.approx(wanted, rel=0.5), kind


@pytest.mark.parametrize(("n", "most_alpha"), [row for row in TABLE if row[0] >= 8])
def test_more_moments_err_less(n, most_alpha):
    frags = random_lists(n, most_alpha)
    for family in (POWER, TRIGONOMETRIC):
        four, six, eight = (rmse(frags, **kind) for kind in family)
        assert eight < six < four


def test_those_bands_would_fail_for_a_weighted_average():
    frags = random_lists(8, 0.9)
    off = np.sqrt(np.mean((frags.composite("weighted_average") - frags.composite())[..., 0] ** 2))
    assert off > 1.5 * max(TABLE[8, 0.9])


@pytest.mark.parametrize(
    ("kind", "wanted"), list(zip(POWER, (0.032, 0.026, 0.086), strict=True)), ids=map(name_of, POWER)
)
def test_layers_that_are_too_close_are_merged_by_the_bias(kind, wanted):
    """White over black, ζ a thousandth apart: a variance of 2.5e-7 beside a bias of λ times b*."""
    frags = lists([[0.0, 1e-3]], np.array([[1.0, 0.0]]), np.array([[0.5, 0.5]]), behind=0)
    assert np.abs(errors(frags, **kind)).max() == pytest.approx(wanted, rel=0.5)
    apart = lists([[0.0, 0.3]], np.array([[1.0, 0.0]]), np.array([[0.5, 0.5]]), behind=0)
    assert np.abs(errors(apart, **kind, beta=0)).max() < wanted / 100


@kinds_and_bits
def test_coverage_is_exact_where_absorbance_stops_too(kind):
    """It stops at −ln 2⁻²⁴, in the moments; coverage is a product of its own."""
    rng = np.random.default_rng(0)
    alpha = rng.choice([0, 1e-9, 0.1, 0.5, 0.99, 1], (500, 5))
    frags = methods.lists_of(rng.uniform(1, 10, (500, 5)), np.stack([alpha * 0 + 0.5] * 3 + [alpha], axis=-1))
    image = frags.composite("mboit", **kind)
    # Of five alphas each rounds twice.
    np.testing.assert_allclose(image[0, :, 3], frags.composite()[0, :, 3], rtol=1e-14)


@kinds_and_bits
def test_colors_times_a_power_of_two_give_the_image_times_it_to_the_bit(kind):
    rng = np.random.default_rng(1)
    triangles = rng.uniform(-1, 1, (12, 3, 3))
    colors = rng.uniform(0.1, 1, (12, 4))
    images = [
        ab.render(
            ab.Mesh(triangles, colors=colors * (s, s, s, 1)), ab.Camera.look_at((0, 0, 4), (0, 0, 0)), width=32,
            height=24, device="cpu", method="mboit", background=(0.1 * s, 0.2 * s, 0.3 * s, 1), **kind,
        ).image[..., :3]
        for s in (1, 1024)
    ]  # fmt: skip
    np.testing.assert_array_equal(1024 * images[0], images[1])


@kinds
def test_a_scene_and_its_range_of_another_size_give_the_same_image(kind):
    """To roundings of depths, over λ."""
    depths, colors, order = methods.random_stacks(7)
    images = [
        methods.lists_of(depths * s, colors, order).composite("mboit", depth_range=(0.9 * s, 11 * s), **kind)
        for s in (1, 1e-5, 3e6)
    ]
    for image in images[1:]:
        np.testing.assert_allclose(image, images[0], atol=1e-15 / min(LAMBDA))
    wider = methods.lists_of(depths, colors, order).composite("mboit", depth_range=(0.09, 11), **kind)
    assert np.abs(wider - images[0]).max() > 1e-3, "the range alone should change the image"


def test_a_range_from_the_eye_on_is_linear():
    """Then it is a shift of all depths that changes nothing; of logarithms it does."""
    depths, colors, order = methods.random_stacks(7)

    def shifted(by, nearest):
        frags = methods.lists_of(depths + by, colors, order)
        return frags.composite("mboit", depth_range=(nearest + by, 12 + by))

    np.testing.assert_allclose(shifted(0, -3), shifted(2, -3), atol=1e-15 / min(LAMBDA))
    assert np.abs(shifted(0, 1) - shifted(2, 1)).max() > 1e-3


@kinds
def test_the_order_of_submission_changes_roundings_alone(kind):
    """Of moments, 2⁻⁵³, over λ."""
    depths, colors, order = methods.random_stacks(12)
    images = [methods.lists_of(depths, colors, o).composite("mboit", **kind) for o in (order, order[:, ::-1])]
    np.testing.assert_allclose(*images, atol=1e-15 / min(LAMBDA))


def in_hull(image, low, high, rounding):
    return bool((image >= low - rounding).all() and (image <= high + rounding).all())


def test_a_value_outside_the_hull_or_none_at_all_is_told():
    assert in_hull(np.array([0.25, 0.75]), 0.25, 0.75, 1e-14)
    assert not any(in_hull(np.array([0.5, bad]), 0.25, 0.75, 1e-14) for bad in (0.24, 0.76, np.nan))


@kinds_and_bits
@pytest.mark.parametrize("beta", [0, 0.25, 1])
def test_no_list_makes_it_leave_the_hull_of_its_colors(kind, beta):
    """A hundred thousand pixels, with alphas 0 and 1, almost 0 and almost 1, equal depths and almost equal ones."""
    rng = np.random.default_rng(7)
    shape = (100_000 // 3, 6)
    alpha = rng.choice([0, 1, 1e-300, 1e-8, 1 - 1e-9, 0.5, 2], shape)
    alpha = np.where(alpha == 2, rng.uniform(0, 1, shape), alpha)
    depth = rng.choice([1, 2, 2 + 1e-6, 5, 10, 0], shape) + rng.choice([0, 1e-9, 1e-3, 1], shape) * rng.uniform(
        0, 1, shape
    )
    grey = rng.uniform(0.25, 0.75, shape)
    frags = methods.lists_of(depth, np.stack([grey, grey, grey, alpha], axis=-1), background=(0.25, 0.5, 0.75, 1))
    for depth_range in (None, (1, 10), (2, 2), (0, 5)):
        image = frags.composite("mboit", beta=beta, depth_range=depth_range, **kind)
        assert in_hull(image[..., :3], 0.25, 0.75, 1e-14)
        np.testing.assert_allclose(image[..., 3], 1, rtol=1e-14)


@kinds_and_bits
def test_no_scene_makes_float32_leave_the_hull_of_its_colors(kind, needs_gpu):
    """A hundred thousand pixels on the CPU, of 60 triangles, some of them at the same depth. A sum of weights rounds once
    a layer, and so does coverage."""
    rng = np.random.default_rng(8)
    triangles = rng.uniform(-2, 2, (60, 1, 3)) + rng.uniform(-2, 2, (60, 3, 3))
    triangles[::3, :, 2] = rng.choice([0, 1e-6, 1e-3, 0.5], (20, 1))
    alpha = rng.choice([0, 1, 1e-30, 1e-8, 0.5, 0.999999], 60)
    colors = np.stack([*rng.uniform(0.25, 0.75, (3, 60)), alpha], axis=-1)
    for device, size in (("cpu", 320), ("gpu", 48)):
        image = ab.render(
            ab.Mesh(triangles, colors=colors), ab.Camera.look_at((0, 0, 5), (0, 0, 0)), width=size, height=size,
            device=device, pipeline="tiles", method="mboit", background=(0.5, 0.5, 0.5, 1), **kind,
        ).image  # fmt: skip
        assert in_hull(image[..., :3], 0.25, 0.75, 60 * 2 * methods.U)


@kinds_and_bits
def test_thousands_of_bright_layers_keep_their_color(kind):
    """In float32, where the transmittance of each is 0: what is weighed is how much less it is than the greatest."""
    corners = np.array([[-9, -9, 0], [9, -9, 0], [0, 9, 0.0]])
    depths = np.linspace(-2, 2, 3000)
    triangles = corners + depths[:, None, None] * (0, 0, 1)
    camera = ab.Camera.look_at((0, 0, 4), (0, 0, 0))
    for alpha in (1e-4, 0.5, 1):
        frame = ab.render(
            ab.Mesh(triangles, colors=(1e4, 2e4, 0.5, alpha)), camera, width=4, height=3, device="cpu", method="mboit",
            **kind,
        )  # fmt: skip
        coverage = -np.expm1(3000 * np.log1p(-alpha)) if alpha < 1 else 1
        wanted = coverage * np.array([1e4, 2e4, 0.5, 1])
        # A product of 3000 transmittances rounds at most so often.
        np.testing.assert_allclose(frame.image, np.broadcast_to(wanted, frame.image.shape), rtol=3000 * methods.U)


@pytest.mark.parametrize("kind", [*POWER, *TRIGONOMETRIC], ids=name_of)
def test_floats_are_far_off_only_where_layers_almost_touch(kind, needs_gpu):
    """On random triangles 999 of 1000 values within 2e-5 of float64, on the CPU and on a GPU: see methods.TOLERANCE."""
    rng = np.random.default_rng(5)
    triangles = rng.uniform(-1, 1, (40, 1, 3)) + rng.uniform(-0.6, 0.6, (40, 3, 3))
    mesh = ab.Mesh(triangles, colors=rng.uniform(0.05, 1, (40, 4)))
    camera = ab.Camera.look_at((0, 0, 4), (0, 0, 0))

    def image(device, precision="float32", beta=0.25):
        return ab.render(
            mesh, camera, width=61, height=45, device=device, precision=precision, pipeline="tiles", method="mboit",
            beta=beta, **kind,
        ).image  # fmt: skip

    double = image("cpu", "float64")
    for device in ("cpu", "gpu"):
        assert np.quantile(np.abs(image(device) - double), 0.999) < 2e-5
    assert np.quantile(np.abs(image("gpu", beta=0.24) - double), 0.999) > 1e-4, "another beta should be told apart"


def rendered(zeta, colors, **options):
    """Stacks (P, n) and (P, n, 4) on the CPU, (P, 4): one small triangle of one colour about a pixel's centre for each layer,
    where a float32 is given what a double is but for roundings."""
    side = int(np.ceil(np.sqrt(len(zeta))))
    y, x = np.divmod(np.arange(len(zeta)), side)
    triangles = np.empty((*zeta.shape, 3, 3))
    triangles[..., :2] = np.array([[-0.7, -0.7], [0.7, -0.7], [0, 0.7]])
    triangles[..., 0] += (2 * x + 1 - side)[:, None, None]
    triangles[..., 1] += (side - 2 * y - 1)[:, None, None]
    triangles[..., 2] = -(10 ** ((zeta + 1) / 2))[..., None]
    mesh = ab.Mesh(triangles.reshape(-1, 3, 3), colors=colors.reshape(-1, 4))
    camera = ab.Camera.orthographic((0, 0, 0), (0, 0, -1), height=2 * side)
    frame = ab.render(mesh, camera, width=side, height=side, device="cpu", fragments="count", **options)
    assert (frame.counts.ravel()[: len(zeta)] == zeta.shape[1]).all()
    return frame.image.reshape(-1, 4)[: len(zeta)]


def float_errors(zeta, colors, **options):
    """How far float32 is from float64, (P,)."""
    given = {"method": "mboit", "depth_range": RANGE} | options
    single, double = (rendered(zeta, colors, precision=precision, **given) for precision in ("float32", "float64"))
    return np.abs(single - double).max(axis=-1)


def stacks_apart(n, pixels=4000, apart=0.1):
    """Of random depths ζ that are `apart` at least, and random colours."""
    rng = np.random.default_rng([11, n])
    zeta = np.sort(rng.uniform(-1, 1 - (n - 1) * apart, (pixels, n)), axis=1) + apart * np.arange(n)
    return rng.permuted(zeta, axis=1), rng.uniform(0, 1, (pixels, n, 4))


@kinds
def test_a_float_is_as_good_as_a_double_for_two_layers_that_are_apart(kind):
    """Their matrix is singular but for the bias, and its other roots are anywhere. What is left is what alphas near 1 round,
    2⁻²⁴ / (1 − α)."""
    assert float_errors(*stacks_apart(2), **kind).max() < 1e-5


@kinds
@pytest.mark.parametrize("n", range(3, 7))
def test_a_float_is_almost_as_good_for_more_layers_that_are_apart(kind, n):
    """Roundings of moments, 2⁻²⁴, over pivots of the matrix, the smallest of which are of the size of the bias."""
    off = float_errors(*stacks_apart(n), **kind)
    assert np.quantile(off, 0.999) < 1e-4
    assert off.max() < 2e-3


@kinds
def test_a_float_is_exact_up_to_the_bias_where_a_double_is(kind):
    for n in range(1, kind["moments"] // 2 + 2):
        rng = np.random.default_rng([4, n])
        middle = np.linspace(-0.9, 0.9, n) if n > 1 else np.zeros(1)
        zeta = middle + rng.uniform(-0.05, 0.05, (1000, n))
        colors = rng.uniform(0, 0.9, (1000, n, 4))
        image = rendered(zeta, colors, method="mboit", depth_range=RANGE, beta=0, **kind)
        np.testing.assert_allclose(image, rendered(zeta, colors, precision="float64"), atol=5e-5)


def test_that_floats_are_far_off_where_layers_touch_is_seen():
    """The comparison above would tell."""
    zeta, colors = stacks_apart(2)
    zeta[:, 1] = zeta[:, 0] + 1e-3
    assert float_errors(zeta, colors).max() > 1e-4


@pytest.mark.parametrize("n", range(1, 5))
def test_sixteen_bits_are_exact_up_to_their_bias_where_32_are(n):
    """For up to three depths; of two, what a step of 2⁻¹⁶ moves is less than λ."""
    off = np.abs(errors(spread_lists(n), **SIXTEEN, beta=0)).max()
    assert off < LAMBDA_16 if n <= 3 else off > 1e-3
    if n in (2, 3):
        assert np.abs(errors(spread_lists(n), **POWER[0], beta=0)).max() < off, "16 bits should show"


@pytest.mark.parametrize("n", [8, 16, 64])
def test_sixteen_bits_err_as_32_do(n):
    """Images within 5e-3 of each other: half a step, 2⁻¹⁷, over λ, where layers are close together; and an RMSE that is the
    same to a fiftieth."""
    frags = random_lists(n, 0.9)
    of_16, of_32 = errors(frags, **SIXTEEN), errors(frags, **POWER[0])
    assert 0 < np.abs(of_16 - of_32).max() < 5e-3
    assert np.sqrt(np.mean(of_16**2)) == pytest.approx(np.sqrt(np.mean(of_32**2)), rel=0.02)


def test_two_layers_that_are_apart_differ_by_little_in_16_bits_and_32():
    """By λ and a step, over the variance of depths a twentieth of the range apart."""
    frags = random_lists(2, 0.9, apart=0.1)
    assert np.abs(errors(frags, **SIXTEEN) - errors(frags, **POWER[0])).max() < 1e-3


def test_the_order_of_submission_shows_a_little_in_16_bits():
    """Each fragment rounds what the ones before left. Not where there is one."""
    for n, most in ((1, 0), (12, 2e-2)):
        depths, colors, order = methods.random_stacks(n)
        images = [methods.lists_of(depths, colors, o).composite("mboit", bits=16) for o in (order, order[:, ::-1])]
        assert np.abs(images[0] - images[1]).max() <= most
    assert np.abs(images[0] - images[1]).max() > 1e-6


def test_sixteen_bits_are_of_four_power_moments_and_take_28_bytes():
    row = METHODS["mboit"]
    assert row.bytes_per_pixel(**row.checked({"bits": 16})) == 28 < row.bytes_per_pixel(**row.checked({})) == 36
    frags = random_lists(3, 0.9, pixels=5)
    for other in (*POWER[1:], *TRIGONOMETRIC):
        with pytest.raises(ParameterError, match=r"bits=16 exists for 4 power moments, and there are \d \w+ ones"):
            frags.composite("mboit", bits=16, **other)
    with pytest.raises(ParameterError, match="bits must be one of 32, 16, got 8"):
        frags.composite("mboit", bits=8)


def test_moments_are_4_6_or_8():
    frags = random_lists(3, 0.9, pixels=5)
    for bad in (5, 4.0, "4", True, None, [4]):
        with pytest.raises(ParameterError, match="moments must be one of 4, 6, 8, got"):
            frags.composite("mboit", moments=bad)
    np.testing.assert_array_equal(frags.composite("mboit", moments=np.int64(6)), frags.composite("mboit", moments=6))


@pytest.mark.parametrize("device", ["cpu", "gpu"])
@kinds
def test_a_fragment_at_the_nearest_depth_is_in_front_in_float32_too(kind, device, needs_gpu):
    """Its phase is 0 on the circle, which may be rounded to the end of the zone: then all would be in front of it."""
    depths, alphas = (3.2046447837829026, 4.01395396), (0.23, 0.48)
    colors = [(0.7, 0.3, 0.1, alphas[0]), (0.7, 0.5, 0.6, alphas[1])]
    sheets = ab.Mesh([[(-30, -30, -d), (30, -30, -d), (0, 60, -d)] for d in depths], colors=colors, color_mode="face")
    camera = ab.Camera.look_at((0, 0, 0), (0, 0, -1))
    arguments = {"width": 4, "height": 4, "method": "mboit", "depth_range": (depths[0], 4.96), **kind}
    double = ab.render(sheets, camera, **arguments, precision="float64").image
    single = ab.render(sheets, camera, **arguments, device=device, pipeline="tiles").image
    np.testing.assert_allclose(single, double, atol=1e-5)
