"""What a fragment is stored as: smaller nodes round colour and depth, and by how much is known beforehand.

Every image is compared with that of the same pipeline's float32 nodes, whose lists give the bound. With weights T in front
of each fragment, from rounded alphas, and A the alpha they make, rounding colours by d_c and alphas by d_a moves a channel by
at most

    d_c A + d_a R sum(T),   R: the range of the colours and the background,

because C is affine in each alpha with slope T (c - what lies behind), and in each colour with slope T alpha. Fragments whose
depths round to one code may come in any order; exchanging neighbours a and b moves C by T alpha_a alpha_b (c_a - c_b).
"""

import warnings

import numpy as np
import pytest

import abuffer as ab
import scenes
from comparison import GPU, GPU_PREFIX, U
from oracle_msaa import MODES, blend_bound, blend_lists

EVERY = pytest.mark.parametrize("pipeline", [GPU, GPU_PREFIX], ids=str)
FRONT = ab.Camera(*scenes.front_camera())
D8 = 1 / 510  # half a step of unorm8
# How far each format moves red, green, blue and alpha, as a part of 1, and how many codes a depth has (None: all of float32).
FORMATS = {
    "float32": ((0, 0, 0, 0), None),
    "rgba8_depth32": ((D8, D8, D8, D8), None),
    "rgba8_depth24_coverage8": ((D8, D8, D8, D8), 2**24),
    "rgb565_depth16": ((1 / 62, 1 / 126, 1 / 62, D8), 2**16),
    "rgb9e5_alpha8_depth24": ((0, 0, 0, D8), 2**24),
}
SMALL = [name for name in FORMATS if name != "float32"]
CLAMPING = ("rgba8_depth32", "rgba8_depth24_coverage8", "rgb565_depth16")
FORMAT = pytest.mark.parametrize("node_format", SMALL)
# Codes are computed in float32, where c times up to 511 and the half that is added each round by 2^-16: 2^-14 of half a step.
ROUND = 1 + 2.0**-13


def colour_steps(node_format, color):
    """(F, 3): how far storing moves straight colours (F, 4)."""
    if node_format == "rgb9e5_alpha8_depth24":
        # 9 bits below the largest channel's power of two; where that rounds up to the next, 512 / 511.5 of it. The smallest
        # exponent is -15, so that steps end at 2^-24.
        largest = color[:, :3].max(axis=1, keepdims=True)
        return np.broadcast_to(np.maximum(2.0**-9 * largest * 512 / 511.5, 2.0**-25), (len(color), 3)) * ROUND
    return np.broadcast_to(np.array(FORMATS[node_format][0][:3]), (len(color), 3)) * ROUND


def weights(frags, alpha):
    """(F,): what the fragments in front of each let through, and (P,) what all do."""
    through, running = np.ones(len(frags)), np.ones(len(frags.offsets) - 1)
    counts = np.diff(frags.offsets)
    for k in range(counts.max(initial=0)):
        pixels = np.flatnonzero(counts > k)
        i = frags.offsets[pixels] + k
        through[i] = running[pixels]
        running[pixels] *= 1 - alpha[i]
    return through, running


def per_pixel(frags, values, of=np.add, start=0.0):
    result = np.full((len(frags.offsets) - 1, *values.shape[1:]), start)
    of.at(result, frags.pixel, values)
    return result


def rounding_bound(frags, node_format, behind):
    """(P, 4) by which `over` of the lists may be off; `behind` (P, 4) straight. And the rounded alphas (F,)."""
    color = frags.color.astype(np.float64)
    steps = colour_steps(node_format, color)
    step = FORMATS[node_format][0][3] * ROUND
    alpha = np.round(color[:, 3] * 255) / 255 if step else color[:, 3]
    through, _ = weights(frags, alpha)
    values = np.concatenate([color[:, :3], np.ones((len(color), 1))], axis=1)  # alpha is a channel of ones
    back = np.concatenate([behind[:, :3] * behind[:, 3:], behind[:, 3:]], axis=1)
    ends = [np.maximum(per_pixel(frags, values, np.maximum, -np.inf), back)]
    ends.append(np.minimum(per_pixel(frags, values, np.minimum, np.inf), back))
    spread = np.where(np.isfinite(ends[0] - ends[1]), ends[0] - ends[1], 0)
    own = np.concatenate([(through * alpha)[:, None] * steps, np.zeros((len(color), 1))], axis=1)
    return per_pixel(frags, own) + step * spread * per_pixel(frags, through)[:, None], alpha


def places(scene, perspective=True):
    """Of all vertices of a scene seen by FRONT or from the same place: what depth codes count, and increases to the front."""
    depth = 3 - ab.Scene(scene).triangles()[..., 2].astype(np.float64)
    return 1 / depth if perspective else -depth


def swap_bound(frags, node_format, alpha, scene, perspective=True):
    """(P, 4) by which another order of fragments within a step of depth may move the result.

    Codes count 1/w under a perspective, depth otherwise, and span no more than all vertices do. Only fragments of one code can
    change places: less than a step apart, and by the rounding of codes, of 1/w and of the lists' depths up to 3 of 2^-24 more.
    """
    codes = FORMATS[node_format][1]
    bound = np.zeros((len(frags.offsets) - 1, 4))
    if codes is None:
        return bound
    depth = frags.depth.astype(np.float64)
    place = 1 / depth if perspective else -depth
    all_over = places(scene, perspective)
    step = np.ptp(all_over) / (codes - 1) + 3 * 2.0**-24 * np.abs(all_over).max()
    through, _ = weights(frags, alpha)
    color = frags.color.astype(np.float64)
    for apart in range(1, int(np.diff(frags.offsets).max(initial=1))):
        front = np.flatnonzero(frags.pixel[:-apart] == frags.pixel[apart:])
        front = front[np.abs(place[front] - place[front + apart]) <= step]
        if not len(front):
            break
        # What is certainly in front of both: all before the first fragment within a step of the nearer one.
        first = front.copy()
        while True:
            more = (first > frags.offsets[frags.pixel[front]]) & (np.abs(place[first - 1] - place[front]) <= step)
            if not more.any():
                break
            first[more] -= 1
        pair = through[first] * alpha[front] * alpha[front + apart]
        steps = np.pad(2 * colour_steps(node_format, frags.color)[front], ((0, 0), (0, 1)))
        apart_by = np.abs(color[front] - color[front + apart]) + steps
        apart_by[:, 3] = 0  # the alpha of a pair does not depend on its order
        np.add.at(bound, frags.pixel[front], pair[:, None] * apart_by)
    return bound


def assert_within_bound(exact, coarse, node_format, scene, *, perspective=True):
    """Asserts that an image of coarse nodes is as near that of float32 nodes, with lists, as its format promises.

    Returns the greatest error and the greatest share of the bound that an error takes.
    """
    frags = exact.fragments
    height, width = frags.shape
    behind = np.broadcast_to(frags.background, (height, width, 4)).reshape(-1, 4).astype(np.float64)
    bound, alpha = rounding_bound(frags, node_format, behind)
    n = np.diff(frags.offsets)[:, None]
    result = exact.image.reshape(-1, 4).astype(np.float64)
    # Both images have the forward error of n layers.
    arithmetic = 2 * (2 * (n + 1)) * U * (result + bound)
    bound = bound + swap_bound(frags, node_format, alpha, scene, perspective)
    off = np.abs(coarse.image.reshape(-1, 4) - result)
    assert np.isfinite(coarse.image).all()
    ratio = off / np.maximum(bound + arithmetic, 1e-300)
    assert ratio.max() <= 1, f"{node_format} is off by {ratio.max():.4g} times its bound"
    return float(off.max()), float(ratio.max())


def both(pipeline, scene, node_format, camera=FRONT, **kw):
    """The frame of float32 nodes, with lists, and that of another format."""
    options = {"width": 48, "height": 48, "background": (0.2, 0.9, 0.1, 1.0)} | kw
    exact = pipeline.render(scene, camera, fragments=True, **options)
    return exact, pipeline.render(scene, camera, node_format=node_format, **options)


# ---- exact ----


@EVERY
def test_float32_nodes_lose_nothing(pipeline):
    triangles, colors = scenes.random_triangles(80, 0.6, seed=81)
    exact, named = both(pipeline, ab.Mesh(triangles, colors=colors), "float32")
    np.testing.assert_array_equal(named.image, exact.image)
    flat = ab.Mesh(scenes.covering()[0], colors=(0.1, 0.7, 1e-6, 0.3))
    frags = pipeline.render(flat, FRONT, width=2, height=2, fragments=True, node_format="float32").fragments
    np.testing.assert_array_equal(frags.color, np.tile(np.float32([0.1, 0.7, 1e-6, 0.3]), (4, 1)))


@EVERY
@FORMAT
def test_colours_that_a_format_has_are_stored_exactly(pipeline, node_format):
    """0 and 1 in every channel, one layer: no rounding at all but that of a division by 255."""
    for color in ((0, 0, 0, 0), (1, 1, 1, 1), (0, 1, 0, 1), (1, 0, 1, 0)):
        scene = ab.Mesh(scenes.covering()[0], colors=color)
        exact, coarse = both(pipeline, scene, node_format)
        np.testing.assert_allclose(coarse.image, exact.image, rtol=4 * U)


@EVERY
@FORMAT
def test_one_layer_is_off_by_half_a_step_at_most(pipeline, node_format):
    """All alphas and colours at once, against the steps themselves: no sum, no weights."""
    rng = np.random.default_rng(0)
    cells = 24 * 24
    colors = rng.uniform(0, 1, (cells, 4)).astype(np.float32)
    colors[: cells // 2, 3] = 1
    y, x = np.divmod(np.arange(cells), 24)
    corners = np.stack([x, y, 0 * x], axis=-1)[:, None] + np.array([(-0.4, -0.4, 0), (1.6, 0.4, 0), (0.4, 1.6, 0)])
    camera = ab.Camera.orthographic((12, 12, 3), (12, 12, 0), height=24)
    scene = ab.Mesh(corners + 0.01, colors=colors, color_mode="face")
    image = pipeline.render(
        scene, camera, width=24, height=24, background=(0, 0, 0, 1), node_format=node_format, fragments=True
    )
    found = image.fragments
    assert len(found) > cells / 2
    step = colour_steps(node_format, colors[found.primitive])
    assert (np.abs(found.color[:, :3] - colors[found.primitive, :3]) <= step).all()
    assert (np.abs(found.color[:, 3] - colors[found.primitive, 3]) <= D8 * ROUND).all()


@EVERY
@FORMAT
def test_the_lists_of_a_coarse_format_are_what_its_image_is_made_of(pipeline, node_format):
    triangles, colors = scenes.random_triangles(60, 0.6, seed=82)
    frame = pipeline.render(
        ab.Mesh(triangles, colors=colors), FRONT, width=40, height=40, fragments=True, node_format=node_format
    )
    wanted = frame.fragments.composite()
    n = frame.fragments.counts[..., None]
    assert (np.abs(frame.image - wanted) <= 2 * (n + 1) * U * wanted).all()
    assert (np.diff(frame.fragments.key.astype(np.int64))[np.diff(frame.fragments.pixel) == 0] >= 0).all()


# ---- bounds ----


@EVERY
@FORMAT
@pytest.mark.parametrize("seed", range(4))
def test_random_scenes_stay_within_the_bound(pipeline, node_format, seed):
    """From few opaque layers to many faint ones."""
    n, low, high = ((60, 0, 1), (150, 0, 0.1), (300, 0, 0.01), (60, 0.9, 1))[seed]
    triangles, colors = scenes.random_triangles(n, 0.7, seed=83 + seed)
    colors[..., 3] = low + (high - low) * colors[..., 3]
    scene = ab.Mesh(triangles, colors=colors)
    exact, coarse = both(pipeline, scene, node_format)
    assert exact.counts.max() >= 10
    largest, share = assert_within_bound(exact, coarse, node_format, scene)
    print(f"{node_format}: off by {255 * largest:.3g}/255 at most, {share:.2f} of the bound")


@EVERY
@FORMAT
def test_an_orthographic_scene_stays_within_the_bound(pipeline, node_format):
    triangles, colors = scenes.random_triangles(80, 0.7, seed=87)
    camera = ab.Camera(*scenes.orthographic(scenes.EYE, (0, 0, 0), height=2.2))
    scene = ab.Mesh(triangles, colors=colors)
    exact, coarse = both(pipeline, scene, node_format, camera)
    assert_within_bound(exact, coarse, node_format, scene, perspective=False)


@EVERY
@FORMAT
def test_faint_layers_on_the_wrong_side_of_half_a_step_come_near_the_bound(pipeline, node_format):
    """255 layers of alpha a little under half of 1/255 vanish; a little over they count double."""
    shares = []
    for factor in (1 - 1e-3, 1 + 1e-3):
        triangles, colors = scenes.layers(255, 0.5 / 255 * factor)
        colors[..., :3] = 1
        scene = ab.Mesh(triangles, colors=colors)
        exact, coarse = both(pipeline, scene, node_format, background=(0, 0, 0, 1), width=4, height=4)
        largest, share = assert_within_bound(exact, coarse, node_format, scene)
        assert largest > 0.2
        shares.append(share)
    assert min(shares) > 0.3
    assert max(shares) > 0.7


@EVERY
@FORMAT
def test_a_colour_half_way_between_two_steps_comes_near_the_bound(pipeline, node_format):
    rgb = {"rgb565_depth16": (0.5 / 31, 0.5 / 63, 30.5 / 31), "rgb9e5_alpha8_depth24": (1.0, 1.5 / 256, 255.5 / 256)}
    color = np.float32([*rgb.get(node_format, (0.5 / 255, 127.5 / 255, 254.5 / 255)), 1])
    scene = ab.Mesh(scenes.covering()[0], colors=color)
    exact, coarse = both(pipeline, scene, node_format, background=(0, 0, 0, 0))
    off = np.abs(coarse.image - exact.image)[..., :3].reshape(-1, 3)
    steps = colour_steps(node_format, color[None])
    assert (off <= steps * ROUND).all()
    worst = (off / steps).max(axis=0)
    assert (worst[1:] > 0.9).all()  # the largest of three with one exponent is exact


@pytest.mark.parametrize("change", ["a channel", "alphas", "the order"])
def test_twice_the_bound_would_be_seen(change, needs_gpu):
    triangles, colors = scenes.random_triangles(60, 0.7, seed=88)
    node_format = "rgba8_depth32"
    scene = ab.Mesh(triangles, colors=colors)
    exact, coarse = both(GPU, scene, node_format)
    assert_within_bound(exact, coarse, node_format, scene)
    off = colors.copy()
    if change == "a channel":
        off[..., 1] *= 1 - 1 / 50
    elif change == "alphas":
        off[..., 3] *= 1 - 1 / 50
    else:
        triangles = triangles.copy()
        triangles[..., 2] *= -1
    _, other = both(GPU, ab.Mesh(triangles, colors=off), node_format)
    with pytest.raises(AssertionError, match="off by"):
        assert_within_bound(exact, other, node_format, scene)


# ---- depth codes ----


def crowded(n=24, seed=89):
    """Full-screen layers whose depths all lie within a thousandth, between a near and a far one that set the range."""
    rng = np.random.default_rng(seed)
    z = np.concatenate([[2.0, -30.0], rng.uniform(-0.0005, 0.0005, n)])
    triangles = np.concatenate([scenes.covering(value)[0] for value in z])
    colors = rng.uniform(0, 1, (n + 2, 4)).astype(np.float32)
    colors[:, 3] = 0.2 + 0.6 * colors[:, 3]
    return triangles, colors


@EVERY
@FORMAT
def test_depths_that_round_to_one_code_may_come_in_any_order_and_no_others(pipeline, node_format):
    triangles, colors = crowded()
    scene = ab.Mesh(triangles, colors=colors, color_mode="face")
    exact, coarse = both(pipeline, scene, node_format, width=4, height=4)
    assert (exact.counts == 26).all()
    frags = exact.fragments
    _, alpha = rounding_bound(frags, node_format, np.zeros((16, 4)))
    swaps = swap_bound(frags, node_format, alpha, scene)
    # 16 bits have about 65,000 codes from depth 1 to 33 and 2 to 3 of them for a thousandth around 3; 24 bits have 256 times
    # as many, so that of 24 depths few share one.
    if node_format == "rgb565_depth16":
        assert swaps.max() > 0.01
    elif "24" not in node_format:
        assert (swaps == 0).all()
    assert_within_bound(exact, coarse, node_format, scene)


@EVERY
@FORMAT
def test_two_depths_of_one_code_give_one_order_or_the_other(pipeline, node_format):
    """White over black or black over white, alike at every pixel of a code: the exchange is T alpha² (c_a - c_b)."""
    for white_last in (False, True):
        z = (0.0001, 0.0) if white_last else (0.0, 0.0001)
        pair = [ab.Mesh(scenes.covering(z[i])[0], colors=(i, i, i, 0.6)) for i in (0, 1)]
        scene = [
            *pair,
            ab.Mesh(scenes.covering(2)[0], colors=(0, 0, 0, 0)),
            ab.Mesh(scenes.covering(-900)[0], colors=(0, 0, 0, 0)),
        ]
        exact, coarse = both(pipeline, scene, node_format, background=(0, 0, 0, 1), width=4, height=4)
        # (1, 0.6) in front of (0, 0.6), or behind it; 0.6 is 153/255.
        possible = np.abs(coarse.image[..., :1] - (0.6, 0.24)) <= 8 * U
        assert possible.any(axis=-1).all()
        if "16" not in node_format:  # 24 bits tell them apart
            np.testing.assert_allclose(coarse.image, exact.image, rtol=8 * U)


@EVERY
@FORMAT
def test_well_separated_layers_keep_their_order(pipeline, node_format):
    """Steps of 2e-4 of the depth are over 20 codes of 16 bits, since codes span the frame's own range."""
    triangles, colors = scenes.layers(2000, 0.01)
    scene = ab.Mesh(triangles, colors=colors)
    exact, coarse = both(pipeline, scene, node_format, width=4, height=4)
    assert_within_bound(exact, coarse, node_format, scene)
    frame = pipeline.render(scene, FRONT, width=4, height=4, fragments=True, node_format=node_format)
    np.testing.assert_array_equal(frame.fragments.primitive, exact.fragments.primitive)


@EVERY
@FORMAT
def test_the_range_of_depth_codes_is_the_frames_own(pipeline, node_format):
    """Two layers a 16,000th apart are told apart by 16 bits also where near and far are 1e-3 and 1e6."""
    camera = ab.Camera.look_at((0, 0, 3), (0, 0, 0), near=1e-3, far=1e6)
    scene = [ab.Mesh(scenes.covering(z)[0], colors=c) for z, c in ((0, (0, 0, 0, 0.6)), (1 / 4096, (1, 1, 1, 0.6)))]
    image = pipeline.render(scene, camera, width=4, height=4, node_format=node_format, background=(0, 0, 0, 1)).image
    np.testing.assert_allclose(image[..., 0], 0.6, atol=1e-6)


@EVERY
@FORMAT
@pytest.mark.parametrize("perspective", [True, False])
def test_one_depth_all_over_is_no_range_at_all(pipeline, node_format, perspective):
    camera = FRONT if perspective else ab.Camera.orthographic((0, 0, 3), (0, 0, 0), height=2)
    scene = ab.Mesh(scenes.covering()[0], colors=(0.2, 0.4, 0.6, 1))
    frame = pipeline.render(scene, camera, width=4, height=4, node_format=node_format, fragments=True)
    assert (frame.fragments.counts == 1).all()
    steps = colour_steps(node_format, np.array([[0.2, 0.4, 0.6, 1]]))
    assert (np.abs(frame.image[..., :3] - (0.2, 0.4, 0.6)).reshape(-1, 3) <= steps).all()


# ---- bright colours ----


def bright(seed=90, most=50.0):
    triangles, colors = scenes.random_triangles(60, 0.7, seed=seed)
    colors[..., :3] *= most
    return triangles, colors


@EVERY
def test_shared_exponents_hold_colours_over_1(pipeline):
    triangles, colors = bright()
    scene = ab.Mesh(triangles, colors=colors)
    exact, coarse = both(pipeline, scene, "rgb9e5_alpha8_depth24")
    assert exact.image.max() > 20
    _, share = assert_within_bound(exact, coarse, "rgb9e5_alpha8_depth24", scene)
    assert share > 0.01


@EVERY
@pytest.mark.parametrize("node_format", CLAMPING)
def test_fixed_point_clamps_colours_over_1_and_says_so(pipeline, node_format):
    triangles, colors = bright(most=3.0)
    scene = ab.Mesh(triangles, colors=colors)
    with pytest.warns(UserWarning, match=r"(?i)node_format.*clamp|clamp.*node_format"):
        coarse = pipeline.render(scene, FRONT, width=48, height=48, node_format=node_format)
    assert coarse.image[..., :3].max() <= 1 + 100 * U
    clamped = np.minimum(colors, 1)
    flat = colors.copy()
    flat[:] = flat[:, :1]  # one colour a face, so that to clamp corners and to clamp fragments is the same
    clamped = np.minimum(flat, 1)
    with pytest.warns(UserWarning, match="clamp"):
        coarse = pipeline.render(ab.Mesh(triangles, colors=flat), FRONT, width=48, height=48, node_format=node_format)
    exact = pipeline.render(ab.Mesh(triangles, colors=clamped), FRONT, width=48, height=48, fragments=True)
    assert_within_bound(exact, coarse, node_format, scene)


@EVERY
def test_nothing_warns_where_nothing_is_clamped(pipeline):
    triangles, colors = bright()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for node_format in ("float32", "rgb9e5_alpha8_depth24"):
            pipeline.render(ab.Mesh(triangles, colors=colors), FRONT, width=8, height=8, node_format=node_format)
        for node_format in CLAMPING:
            pipeline.render(ab.Mesh(triangles, colors=colors / 50), FRONT, width=8, height=8, node_format=node_format)


# ---- with samples, modes and opaque surfaces ----


@EVERY
@FORMAT
def test_samples_with_any_format_stay_within_the_bound(pipeline, node_format):
    """At one alpha and colour a face: the mean of bounds is the bound of the mean."""
    triangles, colors = scenes.random_triangles(40, 0.7, seed=91, flat=True)
    scene = ab.Mesh(triangles, colors=colors)
    exact, coarse = both(pipeline, scene, node_format, samples=4)
    frags = exact.fragments
    assert (frags.coverage != 15).any()
    total = np.zeros((48 * 48, 4))
    behind = np.broadcast_to(np.array([0.2, 0.9, 0.1, 1.0]), (48 * 48, 4))
    for s in range(4):
        on = frags.coverage >> np.uint32(s) & 1 == 1
        counts = np.bincount(frags.pixel[on], minlength=48 * 48)
        one = ab.Fragments(
            frags.shape, np.concatenate([[0], np.cumsum(counts)]), frags.depth[on], frags.color[on], frags.key[on],
            frags.primitive[on],
        )  # fmt: skip
        bound, alpha = rounding_bound(one, node_format, behind)
        total += (bound + swap_bound(one, node_format, alpha, scene)) / 4
    n = frags.counts.reshape(-1, 1)
    result = exact.image.reshape(-1, 4)
    arithmetic = 2 * (2 * (n + 1) + 4) * U * (result + total)
    assert (np.abs(coarse.image.reshape(-1, 4) - result) <= total + arithmetic).all()
    lists = pipeline.render(
        ab.Mesh(triangles, colors=colors),
        FRONT,
        width=48,
        height=48,
        samples=4,
        fragments=True,
        node_format=node_format,
    ).fragments
    by = [np.lexsort((f.primitive, f.pixel)) for f in (frags, lists)]
    np.testing.assert_array_equal(lists.coverage[by[1]], frags.coverage[by[0]])


@EVERY
@FORMAT
def test_modes_ride_with_any_format(pipeline, node_format):
    triangles, colors = scenes.random_triangles(40, 0.7, seed=92)
    scene = [
        ab.Mesh(t, colors=c, blend=list(MODES)[i % 5]) for i, (t, c) in enumerate(zip(triangles, colors, strict=True))
    ]
    frame = pipeline.render(scene, FRONT, width=40, height=40, fragments=True, node_format=node_format)
    frags = frame.fragments
    names = np.array(ab.BLENDS)[frags.blend]
    np.testing.assert_array_equal(names, np.array(list(MODES))[frags.primitive % 5])
    wanted = blend_lists(frags.offsets, frags.color, np.zeros((1600, 4)), names).reshape(40, 40, 4)
    bound = blend_bound(frags.offsets, frags.color, np.zeros((1600, 4)), names).reshape(40, 40, 4)
    assert (np.abs(frame.image - wanted) <= bound).all()


@EVERY
@FORMAT
def test_opaque_surfaces_hide_with_any_format_what_they_hide_with_float32(pipeline, node_format):
    triangles, colors = scenes.random_triangles(80, 0.7, seed=93)
    wall = ab.Mesh(scenes.random_triangles(4, 0.9, seed=94)[0], colors=(0.3, 0.6, 0.2), opaque=True)
    scene = [wall, ab.Mesh(triangles, colors=colors)]
    exact, coarse = both(pipeline, scene, node_format)
    assert_within_bound(exact, coarse, node_format, scene)
    assert coarse.stats.fragments == exact.stats.fragments


@EVERY
@FORMAT
def test_small_nodes_take_fewer_bytes(pipeline, node_format):
    triangles, colors = scenes.layers(40, 0.05)
    scene = ab.Mesh(triangles, colors=colors)
    exact, coarse = both(pipeline, scene, node_format)
    assert coarse.stats.bytes["nodes"] <= exact.stats.bytes["nodes"] * 16 / 28


@pytest.mark.slow
@EVERY
def test_more_nodes_than_links_of_24_bits_tell_apart_are_rendered_in_bands(pipeline):
    triangles, colors = scenes.layers(40, 0.05)
    colors[..., :3] = (1, 0, 1)
    frame = pipeline.render(
        ab.Mesh(triangles, colors=colors), FRONT, width=700, height=700, node_format="rgb565_depth16", memory="4GiB"
    )
    assert frame.stats.fragments == 40 * 700**2 > 2**24
    assert frame.stats.bands > 1 or pipeline is GPU_PREFIX  # which has no links
    alpha = 1 - (1 - 13 / 255) ** 40  # 0.05 is 13 steps of 255
    np.testing.assert_allclose(frame.image, np.broadcast_to([alpha, 0, alpha, alpha], (700, 700, 4)), rtol=82 * U)


@pytest.mark.parametrize("pipeline", ["tiles", "auto"])
def test_a_pipeline_without_nodes_refuses_a_node_format(pipeline):
    with pytest.raises(ab.ParameterError, match="node_format"):
        ab.render(
            ab.Mesh(scenes.covering()[0]),
            FRONT,
            width=4,
            height=4,
            pipeline=pipeline,
            device="cpu",
            node_format="float32",
        )


@EVERY
def test_an_unknown_format_lists_the_known_ones(pipeline):
    with pytest.raises(ab.ParameterError) as caught:
        pipeline.render(ab.Mesh(scenes.covering()[0]), FRONT, width=4, height=4, node_format="rgba8")
    assert all(name in str(caught.value) for name in FORMATS)
