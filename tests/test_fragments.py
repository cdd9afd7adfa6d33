"""Fragment lists: what they hold, how they are cut, composited, padded, located and saved."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import abuffer as ab
import scenes

WIDTH, HEIGHT = 48, 36
PERSPECTIVE = ab.Camera.look_at((0.3, 0.4, 3), (0, 0, 0), fov_y=45)
ORTHOGRAPHIC = ab.Camera.orthographic((0.3, 0.4, 3), (0, 0, 0), height=2.4)
TRIANGLES, COLORS = scenes.random_triangles(60, 0.5, seed=6)


def rendered(camera=PERSPECTIVE, *, items=None, **options):
    mesh = ab.Mesh(TRIANGLES, colors=COLORS) if items is None else items
    return ab.render(mesh, camera, width=WIDTH, height=HEIGHT, device="cpu", **{"fragments": True} | options)


FRAME = rendered()


@st.composite
def lists(draw, ties=False, samples=1, modes=False):
    """Fragments of random lists, sorted; colours with alphas 0 and 1 among them.

    samples: a pixel, whose masks are any, 0 too. modes: all named blend modes are there, and RGB is at most 1.
    """
    height, width = draw(st.integers(0, 3)), draw(st.integers(0, 4))
    counts = draw(st.lists(st.integers(0, 5), min_size=height * width, max_size=height * width))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    offsets = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
    n = int(offsets[-1])
    depth = rng.integers(1, 4, n).astype(float) if ties else rng.uniform(0.1, 10, n)
    pixel = np.repeat(np.arange(height * width), counts)
    primitive = rng.permutation(n).astype(np.int32)
    order = np.lexsort((-primitive, depth, pixel))
    color = rng.uniform(0, 1, (n, 4))
    color[:, :3] *= 10 ** rng.uniform(-3, 3, (n, 1))
    color[rng.random(n) < 0.2, 3] = 0
    color[rng.random(n) < 0.1, 3] = 1
    if modes:
        color[:, :3] = np.minimum(color[:, :3], 1)
    return ab.Fragments(
        (height, width),
        offsets,
        depth[order],
        color,
        primitive=primitive[order],
        background=rng.uniform(0, 1, (height, width, *([samples] if samples > 1 else []), 4)),
        coverage=rng.integers(0, 1 << samples, n) if samples > 1 else None,
        samples=samples,
        blend=rng.integers(0, len(ab.BLENDS), n) if modes else None,
    )


FIELDS = ("offsets", "depth", "color", "primitive", "coverage", "blend", "background")


def assert_same_lists(frags, other, *, keys=True):
    assert (frags.shape, frags.samples, frags.blends) == (other.shape, other.samples, other.blends)
    for field in (*FIELDS, *(["key"] if keys else [])):
        ours, theirs = getattr(frags, field), getattr(other, field)
        assert (ours is None) == (theirs is None), field
        np.testing.assert_array_equal(ours, theirs, field)


def test_assert_same_lists_sees_one_changed_value():
    offsets, depth, color = [0, 2], [1.0, 2.0], np.full((2, 4), 0.5)
    arguments = {"offsets": offsets, "depth": depth, "color": color, "samples": 2, "blend": [0, 1]}
    frags = ab.Fragments((1, 1), **arguments)
    assert_same_lists(frags, ab.Fragments((1, 1), **arguments))
    for change in (
        {"depth": [1.0, 2.5]},
        {"color": np.full((2, 4), 0.25)},
        {"primitive": [0, 2]},
        {"background": 1},
        {"coverage": [3, 1]},
        {"blend": [0, 2]},
        {"blend": None},
        {"samples": 4},
        {"blends": (ab.Blend("dst"),)},
    ):
        with pytest.raises(AssertionError):
            assert_same_lists(frags, ab.Fragments((1, 1), **arguments | change))


# what a render gives


def test_types_and_shapes_of_a_render():
    frags = FRAME.fragments
    n = len(frags.depth)
    assert n == len(frags) == FRAME.stats.fragments > 500
    assert frags.shape == (HEIGHT, WIDTH)
    found = {
        name: (getattr(frags, name).shape, getattr(frags, name).dtype)
        for name in ("offsets", "depth", "key", "color", "primitive", "pixel", "counts")
    }
    assert found == {
        "offsets": ((HEIGHT * WIDTH + 1,), np.int64),
        "depth": ((n,), np.float32),
        "key": ((n,), np.uint32),
        "color": ((n, 4), np.float32),
        "primitive": ((n,), np.int32),
        "pixel": ((n,), np.int64),
        "counts": ((HEIGHT, WIDTH), np.int32),
    }
    assert (frags.coverage, frags.blend, frags.samples) == (None, None, 1)
    assert frags.background.shape == (HEIGHT, WIDTH, 4)
    np.testing.assert_array_equal(frags.counts, FRAME.counts)


@pytest.mark.parametrize("samples", [2, 4, 8, 16])
def test_lists_of_several_samples_have_masks_and_a_background_a_sample(samples):
    frame = rendered(samples=samples)
    frags = frame.fragments
    assert frags.samples == samples
    assert (frags.coverage.shape, frags.coverage.dtype) == (frags.depth.shape, np.uint32)
    assert 1 <= frags.coverage.min() < frags.coverage.max() == 2**samples - 1
    assert frags.background.shape == (HEIGHT, WIDTH, samples, 4)
    np.testing.assert_array_equal(frags.counts, frame.counts)


def test_an_image_behind_several_samples_is_behind_each():
    image = np.random.default_rng(1).random((HEIGHT, WIDTH, 4))
    background = rendered(background=image, samples=4).fragments.background
    np.testing.assert_array_equal(background, np.repeat(image[:, :, None], 4, axis=2))


def test_lists_have_modes_where_a_scene_has_others_than_over():
    over, additive = ab.Mesh(TRIANGLES[:30], colors=COLORS[:30]), ab.Mesh(TRIANGLES[30:], blend="additive")
    frags = rendered(items=[over, additive]).fragments
    assert frags.blend.dtype == np.uint8
    np.testing.assert_array_equal(frags.blend, np.where(frags.primitive < 30, 0, ab.BLENDS.index("additive")))
    assert rendered(items=over).fragments.blend is None


def test_float64_renders_give_float64_lists():
    frags = rendered(precision="float64").fragments
    assert (frags.depth.dtype, frags.color.dtype, frags.key.dtype) == (np.float64, np.float64, np.uint64)


def test_lists_are_sorted_by_key_and_equal_keys_by_later_primitive():
    triangles, colors = scenes.duplicates()
    frags = rendered(items=ab.Mesh(triangles, colors=colors)).fragments
    same = np.diff(frags.pixel) == 0
    key, primitive = frags.key.astype(np.int64), frags.primitive
    rising = key[1:] > key[:-1]
    tied = (key[1:] == key[:-1]) & (primitive[1:] < primitive[:-1])
    assert (rising | tied)[same].all()
    assert tied[same].any()


def test_primitives_count_over_meshes_opaque_ones_too():
    hidden, front = (ab.Mesh(scenes.covering(z)[0], opaque=z < 0) for z in (-1, 1))
    frame = rendered(items=[hidden, front])
    assert set(frame.fragments.primitive.tolist()) == {1}


def test_opaque_surfaces_are_the_lists_background():
    wall = ab.Mesh(scenes.covering(-1)[0], colors=(0.2, 0.4, 0.6, 0.3), opaque=True)
    glass = ab.Mesh(scenes.covering(1)[0], colors=(1, 0, 0, 0.5))
    frame = rendered(items=[wall, glass], background=(0, 0, 0, 0), precision="float64")
    np.testing.assert_array_equal(frame.fragments.background, np.broadcast_to((0.2, 0.4, 0.6, 1), (HEIGHT, WIDTH, 4)))
    # One product and one sum: exact to an ulp.
    np.testing.assert_allclose(frame.fragments.composite(), frame.image, rtol=1e-15)
    np.testing.assert_allclose(frame.image[0, 0], (0.6, 0.2, 0.3, 1), rtol=1e-15)


def test_a_renders_background_is_the_lists():
    image = np.random.default_rng(1).random((HEIGHT, WIDTH, 4))
    frame = rendered(background=image)
    np.testing.assert_array_equal(frame.fragments.background, image)


# compositing


def composited(frags):
    """The definition, pixel by pixel: C = Σ Tᵢ αᵢ cᵢ + T αb cb, A = Σ Tᵢ αᵢ + T αb."""
    image = np.zeros((*frags.shape, 4))
    for y in range(frags.shape[0]):
        for x in range(frags.shape[1]):
            transmittance = 1.0
            colors = frags[y, x].color.astype(np.float64)
            for *rgb, alpha in [*colors, frags.background[y, x]]:
                image[y, x] += transmittance * alpha * np.array([*rgb, 1])
                transmittance *= 1 - alpha
    return image


@settings(derandomize=True, deadline=None)
@given(lists())
def test_composite_is_the_definition(frags):
    image = frags.composite()
    assert image.dtype == np.float64
    # All terms are positive and there are at most 6: a few roundings each.
    np.testing.assert_allclose(image, composited(frags), rtol=1e-12)


@settings(derandomize=True, deadline=None)
@given(lists().filter(lambda f: (np.diff(f.offsets) > 1).any()))
def test_the_definition_notices_two_swapped_fragments(frags):
    pixel = np.flatnonzero(np.diff(frags.offsets) > 1)[0]
    first = frags.offsets[pixel]
    color = frags.color.copy()
    color[first], color[first + 1] = (1, 0, 0, 0.5), (0, 1, 0, 0.5)
    changed = color.copy()
    changed[[first, first + 1]] = changed[[first + 1, first]]
    a, b = (ab.Fragments(frags.shape, frags.offsets, frags.depth, c) for c in (color, changed))
    with pytest.raises(AssertionError):
        np.testing.assert_allclose(b.composite(), composited(a), rtol=1e-12)


def test_composite_gives_the_rendered_image():
    # The same products and sums in float64 instead of float32: at most 2 (n + 1) roundings of numbers up to 1.
    n = FRAME.stats.max_depth_complexity
    np.testing.assert_allclose(FRAME.fragments.composite(), FRAME.image, rtol=0, atol=2 * (n + 1) * 2**-24)
    double = rendered(precision="float64", background=(0.1, 0.2, 0.3, 0.4))
    np.testing.assert_allclose(double.fragments.composite(), double.image, rtol=0, atol=2 * (n + 1) * 2**-53)


@pytest.mark.parametrize(
    ("background", "straight"),
    [
        (0.5, (0.5, 0.5, 0.5, 1)),
        ((0.1, 0.2, 0.3), (0.1, 0.2, 0.3, 1)),
        ((0.1, 0.2, 0.3, 0.4), (0.1, 0.2, 0.3, 0.4)),
        (np.array([51, 0, 255, 102], np.uint8), (0.2, 0, 1, 0.4)),
        (np.full((1, 2, 3), 0.25), (0.25, 0.25, 0.25, 1)),
        (np.full((1, 2, 4), 0.25), (0.25, 0.25, 0.25, 0.25)),
    ],
)
def test_composite_over_another_background(background, straight):
    frags = ab.Fragments((1, 2), [0, 1, 1], [1.0], [(1, 0, 0, 0.5)], background=(1, 1, 1, 1))
    behind = np.array([*(np.array(straight[:3]) * straight[3]), straight[3]])
    expected = [[np.array((0.5, 0, 0, 0.5)) + 0.5 * behind, behind]]
    np.testing.assert_allclose(frags.composite(background=background), expected, rtol=1e-15)
    other = ab.Fragments((1, 2), [0, 1, 1], [1.0], [(1, 0, 0, 0.5)], background=background)
    np.testing.assert_allclose(other.composite(), expected, rtol=1e-15)


def resolved(samples, how):
    """The definitions: what becomes of premultiplied samples (H, W, S, 4)."""
    if how == "none":
        return samples
    weight = 1 / (1 + samples[..., :3].max(axis=-1, keepdims=True)) if how == "hdr" else 1 + 0 * samples[..., :1]
    return (weight * samples).sum(axis=2) / weight.sum(axis=2)


def sample_lists(frags, s):
    """The lists of one sample alone."""
    covers = (frags.coverage >> s & 1).astype(bool)
    columns = {field: getattr(frags, field)[covers] for field in ("depth", "color", "primitive")}
    offsets = np.concatenate([[0], np.cumsum(covers)])[frags.offsets]
    return ab.Fragments(frags.shape, offsets, **columns, background=frags.background[:, :, s])


RESOLVES = ("per_pixel", "per_sample", "hdr", "none")


@settings(derandomize=True, deadline=None)
@given(st.sampled_from([2, 4, 8, 16]).flatmap(lambda n: lists(samples=n)), st.sampled_from(RESOLVES))
def test_composite_of_samples_is_the_composite_of_each_sample(frags, how):
    samples = np.stack([composited(sample_lists(frags, s)) for s in range(frags.samples)], axis=2)
    image = frags.composite(msaa_resolve=how)
    assert image.shape == (samples.shape if how == "none" else samples[:, :, 0].shape)
    # All terms are positive, at most 6 layers and 16 samples: a few roundings each.
    np.testing.assert_allclose(image, resolved(samples, how), rtol=1e-12)


def test_the_definition_notices_a_flipped_bit_of_a_mask():
    arguments = ((1, 1), [0, 1], [1.0], [(1, 0, 0, 0.5)])
    a, b = (ab.Fragments(*arguments, samples=4, coverage=[mask]) for mask in (0b0111, 0b0101))
    samples = np.stack([composited(sample_lists(a, s)) for s in range(4)], axis=2)
    for how in RESOLVES:
        with pytest.raises(AssertionError):
            np.testing.assert_allclose(b.composite(msaa_resolve=how), resolved(samples, how), rtol=1e-12)


def test_each_way_to_resolve_samples_is_another():
    """Half a pixel bright and opaque, half black: the mean, and what weighs the bright half by 1/10."""
    color = [(9.0, 0, 0, 1)]
    frags = ab.Fragments((1, 1), [0, 1], [1.0], color, coverage=[0b01], samples=2, background=(0, 0, 0, 1))
    images = {how: frags.composite(msaa_resolve=how)[0, 0] for how in RESOLVES}
    np.testing.assert_allclose(images["per_pixel"], (4.5, 0, 0, 1), rtol=1e-15)
    np.testing.assert_array_equal(images["per_pixel"], images["per_sample"])
    np.testing.assert_allclose(images["hdr"], (0.9 / 1.1, 0, 0, 1), rtol=1e-15)
    np.testing.assert_array_equal(images["none"], [(9, 0, 0, 1), (0, 0, 0, 1)])


def test_a_seam_of_two_triangles_in_a_pixel_does_not_show():
    """Alpha times the share of samples that are covered would lose α²/4."""
    halves = [(1, 1, 1, 0.6)] * 2
    frags = ab.Fragments((1, 1), [0, 2], [1.0, 2.0], halves, coverage=[0b0011, 0b1100], samples=4)
    np.testing.assert_allclose(frags.composite()[0, 0], 0.6, rtol=1e-15)


@settings(derandomize=True, deadline=None)
@given(st.sampled_from([1, 4]).flatmap(lambda n: lists(samples=n, modes=True)))
def test_both_directions_of_blending_give_the_same_image(frags):
    """Affine maps compose, whatever their order of evaluation; numbers are at most 6: some roundings of them."""
    under, over = (frags.composite(blend_order=order) for order in ("front_to_back", "back_to_front"))
    np.testing.assert_allclose(under, over, rtol=0, atol=1e-13)


@pytest.mark.parametrize("how", RESOLVES)
@pytest.mark.parametrize("samples", [1, 4])
def test_composite_gives_the_rendered_samples(samples, how):
    wall = ab.Mesh(TRIANGLES[:2], opaque=True)
    glass = ab.Mesh(TRIANGLES[2:40], colors=COLORS[2:40])
    light = ab.Mesh(TRIANGLES[40:], colors=COLORS[40:], blend="screen")
    options = {"samples": samples, "msaa_resolve": how, "precision": "float64", "background": (0.1, 0.2, 0.3, 0.4)}
    frame = rendered(items=[wall, glass, light], **options)
    assert len(np.unique(frame.fragments.background.reshape(-1, 4), axis=0)) > 1
    np.testing.assert_allclose(frame.fragments.composite(msaa_resolve=how), frame.image, rtol=0, atol=1e-13)


@pytest.mark.parametrize("shape", [(4,), (1, 2, 4), (1, 2, 4, 4)])
def test_samples_over_another_background(shape):
    behind = np.random.default_rng(3).random(shape)
    frags = ab.Fragments((1, 2), [0, 0, 0], [], [], samples=4, background=1)
    samples = np.broadcast_to(behind[:, :, None] if len(shape) == 3 else behind, (1, 2, 4, 4))
    expected = np.concatenate([samples[..., :3] * samples[..., 3:], samples[..., 3:]], axis=-1)
    np.testing.assert_array_equal(frags.composite(background=behind, msaa_resolve="none"), expected)
    other = ab.Fragments((1, 2), [0, 0, 0], [], [], samples=4, background=behind)
    np.testing.assert_array_equal(other.background, samples)


def test_backgrounds_of_samples_are_for_lists_of_samples():
    one, four = (ab.Fragments((1, 2), [0, 0, 0], [], [], samples=n) for n in (1, 4))
    with pytest.raises(ab.ParameterError, match=r"\(H, W, 3\|4\) with H, W = \(1, 2\), got shape \(1, 2, 4, 4\)"):
        one.composite(background=np.zeros((1, 2, 4, 4)))
    with pytest.raises(ab.ParameterError, match=r"or \(H, W, 4, 3\|4\) with .* got shape \(1, 2, 2, 4\)"):
        four.composite(background=np.zeros((1, 2, 2, 4)))


def test_composite_refuses_what_it_does_not_know():
    frags = FRAME.fragments
    with pytest.raises(ab.ParameterError, match=r"msaa_resolve must be one of 'per_pixel'.* got 'per_pixl'; did you"):
        frags.composite(msaa_resolve="per_pixl")
    with pytest.raises(ab.ParameterError, match="blend_order must be one of 'front_to_back', 'back_to_front'"):
        frags.composite(blend_order=1)
    with pytest.raises(ab.ParameterError, match=r"did you mean 'msaa_resolve'.* options are msaa_resolve, blend_order"):
        frags.composite(msa_resolve="hdr")
    with pytest.raises(ab.ParameterError, match=r"method must be one of .*'exact'"):
        frags.composite("exat")
    with pytest.raises(
        ab.ParameterError, match=r"composite\(\) has no argument \'q\' .* arguments are method, background"
    ):
        frags.composite(q=4)
    with pytest.raises(ab.ParameterError, match=r"background must be grey.*got shape \(2, 2, 4\)"):
        frags.composite(background=np.zeros((2, 2, 4)))


# made from arrays


def test_fragments_without_keys_and_primitives():
    frags = ab.Fragments((1, 2), [0, 2, 3], [1, 2, 1], [(1, 0, 0)] * 3)
    assert frags.depth.dtype == np.float64
    np.testing.assert_array_equal(frags.primitive, [0, 1, 0])
    np.testing.assert_array_equal(frags.color[:, 3], 1)
    np.testing.assert_array_equal(frags.counts, [[2, 1]])
    np.testing.assert_array_equal(frags.pixel, [0, 0, 1])
    np.testing.assert_array_equal(frags.background, np.zeros((1, 2, 4)))


@settings(derandomize=True, deadline=None)
@given(st.lists(st.floats(allow_nan=False, allow_infinity=False, width=32), min_size=2), st.booleans())
def test_keys_made_from_depths_are_in_their_order(depths, single):
    depths = np.sort(np.array(depths, np.float32 if single else np.float64))
    key = ab.Fragments((1, 1), [0, len(depths)], depths, np.zeros((len(depths), 4))).key
    np.testing.assert_array_equal(np.diff(key.astype(object)) > 0, np.diff(depths.astype(np.float64)) > 0)


def test_fragments_may_be_none_at_all():
    for empty in ([], np.zeros((0, 4))):
        frags = ab.Fragments((2, 3), np.zeros(7, int), [], empty)
        assert len(frags) == 0
        np.testing.assert_array_equal(frags.composite(background=0.5)[..., 3], 1)
        assert frags.to_padded().depth.shape == (2, 3, 0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"shape": (1, 2, 3)}, r"shape must be \(H, W\), got \(1, 2, 3\)"),
        ({"shape": 2}, r"shape must be \(H, W\), got 2"),
        ({"offsets": [0, 3]}, r"offsets must be \(3,\) for shape \(1, 2\) and rise from 0"),
        ({"offsets": [0, 3, 2]}, "rise from 0"),
        ({"offsets": [1, 2, 3]}, "rise from 0"),
        ({"offsets": [0, 1, 2]}, r"offsets end at 2, but depth is \(3,\) and color \(3, 4\)"),
        ({"offsets": [0.0, 2.0, 3.0]}, "offsets must be integers"),
        ({"depth": [1.0, 2.0]}, r"depth is \(2,\)"),
        ({"depth": [2.0, 1.0, 1.0]}, r"list of pixel \[0, 0\] is not sorted front to back"),
        ({"depth": [1.0, np.nan, 1.0]}, r"depth\[1\] is nan: depths must be finite"),
        ({"depth": [1.0, 2.0, np.inf]}, r"depth\[2\] is inf"),
        ({"color": np.zeros((2, 4))}, r"color \(2, 4\)"),
        ({"color": np.full((3, 4), 2.0)}, r"color\[0, 3\] is 2.0"),
        ({"key": [3, 2, 1]}, "key must be integers, got dtype int64"),
        ({"key": np.array([2, 1, 1], np.uint32)}, r"pixel \[0, 0\] is not sorted"),
        ({"key": np.array([1, 2], np.uint32)}, "key and primitive must be"),
        ({"primitive": [0.0, 1, 2]}, "primitive must be integers"),
        ({"primitive": [0, 1]}, "key and primitive must be"),
        ({"primitive": [0, 1, 2**40]}, r"primitive\[2\] is 1099511627776: out of int32's range"),
        ({"coverage": [1, 1, 2]}, r"coverage\[2\] is 2: with samples=1 a mask is at most 0x1"),
        ({"coverage": [1, 0, 1]}, r"coverage\[1\] is 0: with samples=1 every mask is 1"),
        ({"coverage": [1, 16, 1], "samples": 4}, r"coverage\[1\] is 16: with samples=4 a mask is at most 0xf"),
        ({"coverage": [1, -1, 1], "samples": 4}, r"coverage\[1\] is -1: out of uint32's range"),
        ({"coverage": [1, 1], "samples": 4}, r"coverage must be \(3,\), got \(2,\)"),
        ({"coverage": [1.0, 1, 1], "samples": 4}, "coverage must be integers"),
        ({"blend": [0, 4, 5]}, r"blend\[2\] is 5: with 0 blends of your own ids run from 0 to 4"),
        ({"blend": [0, 7, 5], "blends": (ab.Blend("dst"),)}, r"blend\[1\] is 7: with 1 blends .* from 0 to 5"),
        ({"blend": [0, 300, 0]}, r"blend\[1\] is 300: out of uint8's range"),
        ({"blend": [0, 1]}, r"blend must be \(3,\), got \(2,\)"),
        ({"blend": ["over"] * 3}, "blend must be integers"),
        ({"blend": [0, 0, 3], "color": np.full((3, 3), 1.5)}, r"color\[2, 0\] is 1.5 .*multiply and screen take RGB"),
    ],
)
def test_fragments_that_are_refused(change, message):
    sound = {"shape": (1, 2), "offsets": [0, 2, 3], "depth": [1.0, 2.0, 1.0], "color": np.zeros((3, 4))}
    ab.Fragments(**sound)
    with pytest.raises(ab.SceneError, match=message):
        ab.Fragments(**sound | change)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"samples": 3}, "samples must be one of 1, 2, 4, 8, 16, got 3"),
        ({"blends": ("over",)}, r"blends must be abuffer.Blends, got \('over',\)"),
    ],
)
def test_options_of_lists_that_are_refused(change, message):
    with pytest.raises(ab.ParameterError, match=message):
        ab.Fragments((1, 1), [0, 0], [], [], **change)


def test_without_masks_every_sample_is_covered():
    arguments = ((1, 1), [0, 2], [1.0, 2.0], np.full((2, 4), 0.5))
    assert ab.Fragments(*arguments).coverage is None
    assert ab.Fragments(*arguments, coverage=[1, 1]).coverage is None
    np.testing.assert_array_equal(ab.Fragments(*arguments, samples=8).coverage, [255, 255])


# indexing


def test_a_pixel_is_a_record_array():
    frags = FRAME.fragments
    y, x = np.unravel_index(np.argmax(frags.counts), frags.shape)
    records = frags[y, x]
    part = slice(*frags.offsets[y * WIDTH + x : y * WIDTH + x + 2])
    assert len(records) == frags.counts.max()
    for field in ("depth", "color", "primitive", "key"):
        np.testing.assert_array_equal(records[field], getattr(frags, field)[part])
        np.testing.assert_array_equal(getattr(records, field), getattr(frags, field)[part])


def test_pixels_are_indexed_as_numpy_does():
    frags = FRAME.fragments
    np.testing.assert_array_equal(frags[-1, -2], frags[HEIGHT - 1, WIDTH - 2])
    for index in ((HEIGHT, 0), (0, -WIDTH - 1)):
        with pytest.raises(IndexError, match="out of range"):
            frags[index]
    with pytest.raises(TypeError):
        frags[0.5, 0]
    for index in (0, slice(0, 2), (0, 0, 0)):
        with pytest.raises(ab.ParameterError, match=r"index with \[y, x\] or \[y0:y1, x0:x1\]"):
            frags[index]
    with pytest.raises(ab.ParameterError, match="must have step 1, got 2"):
        frags[::2, :]


ends = st.none() | st.integers(-5, 5)


def test_a_pixel_has_masks_and_modes_where_the_lists_do():
    assert FRAME.fragments[0, 0].dtype.names == ("depth", "color", "primitive", "key")
    frags = rendered(items=ab.Mesh(TRIANGLES, colors=COLORS, blend="screen"), samples=4).fragments
    y, x = np.unravel_index(np.argmax(frags.counts), frags.shape)
    records = frags[y, x]
    assert records.dtype.names == ("depth", "color", "primitive", "key", "coverage", "blend")
    assert (records.coverage.dtype, records.blend.dtype) == (np.uint32, np.uint8)
    assert (records.blend == ab.BLENDS.index("screen")).all()
    part = slice(*frags.offsets[y * WIDTH + x : y * WIDTH + x + 2])
    np.testing.assert_array_equal(records.coverage, frags.coverage[part])


@settings(derandomize=True, deadline=None)
@given(lists(samples=4, modes=True), st.tuples(ends, ends), st.tuples(ends, ends))
def test_a_slice_keeps_samples_masks_and_modes(frags, rows, columns):
    ys, xs = slice(*rows), slice(*columns)
    crop = frags[ys, xs]
    assert crop.samples == 4
    np.testing.assert_array_equal(crop.background, frags.background[ys, xs])
    np.testing.assert_array_equal(crop.composite(msaa_resolve="none"), frags.composite(msaa_resolve="none")[ys, xs])


@settings(derandomize=True, deadline=None)
@given(lists(), st.tuples(ends, ends), st.tuples(ends, ends))
def test_a_slice_holds_the_lists_of_its_pixels(frags, rows, columns):
    ys, xs = slice(*rows), slice(*columns)
    crop = frags[ys, xs]
    pixels = np.arange(frags.shape[0] * frags.shape[1]).reshape(frags.shape)[ys, xs]
    assert crop.shape == pixels.shape
    np.testing.assert_array_equal(crop.background, frags.background[ys, xs])
    for y, row in enumerate(pixels):
        for x, pixel in enumerate(row):
            np.testing.assert_array_equal(crop[y, x], frags[divmod(int(pixel), frags.shape[1])])
    np.testing.assert_array_equal(crop.composite(), frags.composite()[ys, xs])


def test_a_row_and_a_column_are_slices_too():
    frags = FRAME.fragments
    assert_same_lists(frags[3, :], frags[3:4, :])
    assert_same_lists(frags[:, -1], frags[:, WIDTH - 1 :])


# padded


@settings(derandomize=True, deadline=None)
@given(lists(ties=True))
def test_padded_and_back(frags):
    padded = frags.to_padded()
    assert padded.dropped == 0
    back = ab.Fragments.from_padded(padded.depth, padded.color, primitive=padded.primitive, background=frags.background)
    assert_same_lists(back, frags)


@settings(derandomize=True, deadline=None)
@given(lists(ties=True, samples=4, modes=True))
def test_padded_and_back_with_masks_and_modes(frags):
    padded = frags.to_padded()
    assert (padded.coverage.dtype, padded.blend.dtype) == (np.uint32, np.uint8)
    empty = ~np.isfinite(padded.depth)
    assert not padded.coverage[empty].any() and not padded.blend[empty].any()
    arrays = {"primitive": padded.primitive, "coverage": padded.coverage, "blend": padded.blend}
    back = ab.Fragments.from_padded(
        padded.depth, padded.color, **arrays, background=frags.background, samples=frags.samples
    )
    assert_same_lists(back, frags)


def test_padded_and_back_of_a_render():
    frags = rendered(precision="float64").fragments
    padded = frags.to_padded()
    back = ab.Fragments.from_padded(padded.depth, padded.color, primitive=padded.primitive)
    assert_same_lists(back, frags, keys=False)  # a perspective's keys are of 1/w
    np.testing.assert_array_equal(back.composite(), frags.composite())


@settings(derandomize=True, deadline=None)
@given(lists(), st.integers(0, 6))
def test_padded_keeps_the_nearest_and_counts_the_rest(frags, k):
    padded = frags.to_padded(k)
    assert padded.depth.shape == (*frags.shape, k)
    assert padded.color.shape == (*frags.shape, k, 4)
    assert padded.dropped == np.maximum(frags.counts - k, 0).sum()
    assert padded.coverage is None and padded.blend is None
    for y in range(frags.shape[0]):
        for x in range(frags.shape[1]):
            records = frags[y, x][:k]
            n = len(records)
            np.testing.assert_array_equal(padded.depth[y, x], [*records.depth, *[np.inf] * (k - n)])
            np.testing.assert_array_equal(padded.primitive[y, x], [*records.primitive, *[-1] * (k - n)])
            np.testing.assert_array_equal(padded.color[y, x, :n], records.color)
            np.testing.assert_array_equal(padded.color[y, x, n:], 0)


def test_padded_keeps_the_types():
    padded = FRAME.fragments.to_padded(2)
    assert (padded.depth.dtype, padded.color.dtype, padded.primitive.dtype) == (np.float32, np.float32, np.int32)


@pytest.mark.parametrize("k", [-1, 1.5, True, "2"])
def test_the_padded_length_is_a_number_of_fragments(k):
    with pytest.raises(ab.ParameterError, match="k must be an integer, 0 or more"):
        FRAME.fragments.to_padded(k)


def test_from_padded_sorts_and_skips_what_is_not_finite():
    depth = [[[3.0, np.inf, 1.0, np.nan, -np.inf, 2.0]]]
    color = np.zeros((1, 1, 6, 3))
    color[0, 0, :, 0] = np.arange(6) / 10
    color[0, 0, 3] = np.nan  # nobody looks there
    frags = ab.Fragments.from_padded(depth, color)
    np.testing.assert_array_equal(frags.depth, [1, 2, 3])
    np.testing.assert_array_equal(frags.color[:, 0], [0.2, 0.5, 0])
    np.testing.assert_array_equal(frags.primitive, [2, 5, 0])


def test_columns_of_from_padded_are_submitted_as_they_are_given():
    """Whatever their depths: a method that streams sees what it would of a renderer, not its best case."""
    depth, color = np.array([[[1.0, 3.0, 2.0]]]), np.array([[[(1, 0, 0, 0.5), (0, 1, 0, 0.5), (0, 0, 1, 0.5)]]])
    # The last column over the second over the first.
    image = ab.Fragments.from_padded(depth, color).composite("unsorted")
    np.testing.assert_array_equal(image[0, 0], (0.125, 0.25, 0.5, 0.875))
    np.testing.assert_array_equal(ab.Fragments.from_padded(depth, color).composite()[0, 0], (0.5, 0.125, 0.25, 0.875))
    given = ab.Fragments.from_padded(depth, color, primitive=[[[2, 1, 0]]]).composite("unsorted")
    np.testing.assert_array_equal(given[0, 0], (0.5, 0.25, 0.125, 0.875))


def test_from_padded_puts_the_later_of_equal_depths_in_front():
    frags = ab.Fragments.from_padded(np.ones((1, 1, 2)), [[[(1, 0, 0, 1), (0, 1, 0, 1)]]])
    np.testing.assert_array_equal(frags.composite()[0, 0], (0, 1, 0, 1))
    given = ab.Fragments.from_padded(np.ones((1, 1, 2)), [[[(1, 0, 0, 1), (0, 1, 0, 1)]]], primitive=[[[8, 3]]])
    np.testing.assert_array_equal(given.composite()[0, 0], (1, 0, 0, 1))


@pytest.mark.parametrize(
    ("depth", "color", "options", "message"),
    [
        (np.ones((2, 2)), np.zeros((2, 2, 4)), {}, r"depth must be \(H, W, K\)"),
        (np.ones((2, 2, 1)), np.zeros((2, 2, 2, 4)), {}, r"got \(2, 2, 1\) and \(2, 2, 2, 4\)"),
        (np.ones((1, 1, 1)), np.full((1, 1, 1, 4), 2.0), {}, r"color\[0, 0, 0, 3\] is 2.0"),
        (np.ones((1, 1, 1)), np.zeros((1, 1, 1, 4)), {"primitive": [0]}, r"primitive must be \(1, 1, 1\)"),
        (np.ones((1, 1, 1)), np.zeros((1, 1, 1, 4)), {"coverage": [1]}, r"coverage must be \(1, 1, 1\)"),
        (np.ones((1, 1, 1)), np.zeros((1, 1, 1, 4)), {"blend": [[[5]]]}, r"blend\[0\] is 5"),
        (np.ones((1, 1, 1)), np.zeros((1, 1, 1, 4)), {"coverage": [[[3]]]}, r"coverage\[0\] is 3: with samples=1"),
    ],
)
def test_padded_arrays_that_are_refused(depth, color, options, message):
    with pytest.raises(ab.SceneError, match=message):
        ab.Fragments.from_padded(depth, color, **options)


# where fragments are

K = np.array([(50.0, 2.0, 20.0), (0, 45.0, 19.0), (0, 0, 1)])  # with skew, and off the image's middle
OFF_CENTER = ab.Camera.from_intrinsics(K, np.diag([1.0, -1, -1, 1]) @ PERSPECTIVE.view, width=WIDTH, height=HEIGHT)
CAMERAS = pytest.mark.parametrize(
    "camera", [PERSPECTIVE, ORTHOGRAPHIC, OFF_CENTER], ids=["perspective", "orthographic", "off-centre"]
)
MESH = ab.Mesh(TRIANGLES, colors=COLORS)


def centers(frags):
    y, x = np.divmod(frags.pixel, frags.shape[1])
    return np.column_stack([x, y]) + 0.5


@CAMERAS
def test_points_project_to_their_pixels_centres(camera):
    frags = rendered(camera, precision="float64").fragments
    xy, depth = camera.project(frags.points(camera), WIDTH, HEIGHT)
    # Float64 throughout: a few roundings of pixel coordinates up to 48.
    np.testing.assert_allclose(xy, centers(frags), rtol=0, atol=1e-11)
    np.testing.assert_allclose(depth, frags.depth, rtol=1e-13)


@CAMERAS
def test_barycentric_weights_the_corners_to_the_point(camera):
    frags = rendered(camera, precision="float64").fragments
    weights = frags.barycentric(MESH, camera)
    assert weights.shape == (len(frags), 3)
    np.testing.assert_allclose(weights.sum(axis=1), 1, rtol=1e-9)
    inside = (weights > 1e-3).all(axis=1)  # further out, depth is clamped to the corners' range
    assert inside.mean() > 0.9
    points = np.einsum("fi,fij->fj", weights, TRIANGLES[frags.primitive])
    error = np.abs(points - frags.points(camera))[inside].max(axis=1)
    # A triangle seen nearly edge-on moves along the ray by far more than it moves on the screen.
    assert np.quantile(error, 0.99) < 1e-11
    assert error.max() < 1e-7


@CAMERAS
def test_barycentric_weights_the_corners_to_the_colour(camera):
    frags = rendered(camera, precision="float64").fragments
    weights = frags.barycentric(MESH, camera)
    inside = (weights > 1e-3).all(axis=1)
    colors = np.einsum("fi,fij->fj", weights, COLORS[frags.primitive])
    error = np.abs(colors - frags.color)[inside]
    assert error.max() < 1e-8
    # Weights that are linear on the screen would not do under a perspective.
    wrong = np.einsum("fi,fij->fj", weights[:, [1, 2, 0]], COLORS[frags.primitive])
    assert np.abs(wrong - frags.color)[inside].max() > 0.1


def test_barycentric_is_perspective_correct():
    """A corner at depth 1 and two at depth 3: halfway on the screen is a quarter of the way in space."""
    triangle = np.array([(0, -1, -1), (-3, 3, -3), (3, 3, -3)], float)  # on the screen (0, -1), (-1, 1), (1, 1)
    camera = ab.Camera.look_at((0, 0, 0), (0, 0, -1), fov_y=90)
    frags = ab.render(
        ab.Mesh(triangle), camera, width=33, height=33, device="cpu", precision="float64", fragments=True
    ).fragments
    weights = frags.barycentric(ab.Mesh(triangle), camera)
    middle = weights[frags.pixel == 16 * 33 + 16]
    np.testing.assert_allclose(middle, [(0.75, 0.125, 0.125)], rtol=1e-12)


def test_barycentric_of_corners_behind_the_eye():
    triangles, colors = scenes.near_crossing()
    mesh = ab.Mesh(triangles, colors=colors)
    camera = ab.Camera.look_at(scenes.EYE, (0, 0, 0))
    frags = rendered(camera, items=mesh, precision="float64").fragments
    weights = frags.barycentric(mesh, camera)
    inside = (weights > 1e-3).all(axis=1)
    assert inside.mean() > 0.9
    interpolated = np.einsum("fi,fij->fj", weights, colors[frags.primitive])
    np.testing.assert_allclose(frags.color[inside], interpolated[inside], rtol=0, atol=1e-9)


def test_barycentric_of_a_triangle_without_area_is_finite():
    mesh = ab.Mesh([(-1, 0, 0), (1, 0, 0), (1, 0, 0)])
    frags = ab.Fragments((1, 1), [0, 1], [3.0], [(1, 1, 1, 1)])
    np.testing.assert_array_equal(frags.barycentric(mesh, PERSPECTIVE), [(1, 0, 0)])


@CAMERAS
def test_slices_keep_points_and_barycentric(camera):
    frags = rendered(camera).fragments
    crop = frags[5:30, 7:40][2:-3, 4:]
    y, x = np.divmod(frags.pixel, WIDTH)
    kept = (y >= 7) & (y < 27) & (x >= 11) & (x < 40)
    assert len(crop) == kept.sum() > 100
    np.testing.assert_array_equal(crop.points(camera), frags.points(camera)[kept])
    np.testing.assert_array_equal(crop.barycentric(MESH, camera), frags.barycentric(MESH, camera)[kept])


@CAMERAS
def test_points_of_samples_are_on_the_rays_through_centres_at_their_depth(camera):
    frags = rendered(camera, precision="float64", samples=4).fragments
    assert (frags.coverage < 15).any()  # some of which do not cover the centre
    xy, depth = camera.project(frags.points(camera), WIDTH, HEIGHT)
    np.testing.assert_allclose(xy, centers(frags), rtol=0, atol=1e-11)
    np.testing.assert_allclose(depth, frags.depth, rtol=1e-13)


def test_points_of_a_fitted_camera():
    frags = rendered(None).fragments
    camera = ab.Camera.fit(MESH)
    xy, _ = camera.project(frags.points(camera), WIDTH, HEIGHT)
    np.testing.assert_allclose(xy, centers(frags), rtol=0, atol=1e-10)


def test_barycentric_wants_the_scene_of_the_lists():
    frags = FRAME.fragments
    with pytest.raises(ab.ParameterError, match="the scene has 1: another scene"):
        frags.barycentric(ab.Mesh(TRIANGLES[:1]), PERSPECTIVE)
    unknown = ab.Fragments((1, 1), [0, 1], [1.0], [(1, 1, 1, 1)], primitive=[-1])
    with pytest.raises(ab.ParameterError, match="name primitives -1 to -1"):
        unknown.barycentric(MESH, PERSPECTIVE)


def test_no_fragments_have_no_points():
    frags = rendered(items=ab.Scene()).fragments
    assert frags.points(PERSPECTIVE).shape == (0, 3)
    assert frags.barycentric(ab.Scene(), PERSPECTIVE).shape == (0, 3)


# tables and files


def test_to_pandas_has_one_row_a_fragment():
    pytest.importorskip("pandas")
    frags = FRAME.fragments
    table = frags.to_pandas()
    assert list(table.columns) == ["y", "x", "layer", "depth", "r", "g", "b", "a", "primitive"]
    assert len(table) == len(frags)
    np.testing.assert_array_equal(table.y * WIDTH + table.x, frags.pixel)
    np.testing.assert_array_equal(table[["r", "g", "b", "a"]], frags.color)
    np.testing.assert_array_equal(table.groupby(["y", "x"]).layer.max() + 1, frags.counts[frags.counts > 0])


def test_to_pandas_has_masks_and_the_names_of_modes():
    pytest.importorskip("pandas")
    named, unnamed = ab.Blend("dst", name="nothing"), ab.Blend("src.rgb")
    frags = ab.Fragments(
        (1, 1),
        [0, 3],
        [1.0, 2, 3],
        np.ones((3, 4)),
        coverage=[1, 2, 3],
        samples=2,
        blend=[3, 5, 6],
        blends=(named, unnamed),
    )
    table = frags.to_pandas()
    assert table.coverage.tolist() == [1, 2, 3]
    assert table.blend.tolist() == ["screen", "nothing", "Blend(wgsl='src.rgb')"]


def test_to_pandas_of_a_slice_tells_where_in_the_whole_image():
    pytest.importorskip("pandas")
    frags = FRAME.fragments
    table, crop = frags.to_pandas(), frags[10:20, 15:40]
    inside = table[table.y.between(10, 19) & table.x.between(15, 39)]
    assert len(inside) > 50
    np.testing.assert_array_equal(crop.to_pandas(), inside)
    assert crop.pixel.max() < 10 * 25  # counted in the slice


def test_save_and_load(tmp_path):
    frags = rendered(background=np.random.default_rng(2).random((HEIGHT, WIDTH, 4))).fragments
    for path in (tmp_path / "lists.npz", str(tmp_path / "no ending")):
        frags.save(path)
        assert_same_lists(ab.Fragments.load(path), frags)


@settings(derandomize=True, deadline=None, max_examples=20)
@given(lists(samples=4, modes=True))
def test_save_and_load_with_masks_and_modes(tmp_path_factory, frags):
    path = tmp_path_factory.mktemp("lists") / "a.npz"
    frags.save(path)
    assert_same_lists(ab.Fragments.load(path), frags)


def test_a_file_of_version_1_loads(tmp_path):
    """As abuffer wrote it before there were samples and modes."""
    frags = rendered(background=(0.1, 0.2, 0.3, 0.4)).fragments
    arrays = {name: getattr(frags, name) for name in ("offsets", "depth", "key", "color", "primitive")}
    arrays |= {"shape": np.array(frags.shape), "window": np.array((0, 0, *frags.shape))}
    arrays |= {"background": np.array((0.1, 0.2, 0.3, 0.4))}
    arrays |= {"format": np.array('{"abuffer": "fragments", "version": 1}')}
    np.savez_compressed(tmp_path / "old.npz", **arrays)
    assert_same_lists(ab.Fragments.load(tmp_path / "old.npz"), frags)


def test_a_file_of_a_later_version_is_refused(tmp_path):
    FRAME.fragments.save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as arrays:
        later = dict(arrays) | {"format": np.array('{"abuffer": "fragments", "version": 3}')}
    np.savez(tmp_path / "b.npz", **later)
    with pytest.raises(ab.ParameterError, match=r"b.npz' is of a newer abuffer, format 3: this one reads 2"):
        ab.Fragments.load(tmp_path / "b.npz")


def test_a_saved_slice_keeps_its_place(tmp_path):
    crop = FRAME.fragments[5:20, 7:30]
    crop.save(tmp_path / "crop.npz")
    loaded = ab.Fragments.load(tmp_path / "crop.npz")
    assert_same_lists(loaded, crop)
    np.testing.assert_array_equal(loaded.points(PERSPECTIVE), crop.points(PERSPECTIVE))


def test_saved_lists_keep_their_types(tmp_path):
    for frags in (FRAME.fragments, rendered(precision="float64").fragments):
        frags.save(tmp_path / "lists.npz")
        loaded = ab.Fragments.load(tmp_path / "lists.npz")
        for field in ("depth", "key", "color", "primitive", "offsets"):
            assert getattr(loaded, field).dtype == getattr(frags, field).dtype


def test_load_says_what_is_missing(tmp_path):
    np.savez(tmp_path / "other.npz", depth=[1.0])
    with pytest.raises(ab.SceneError, match=r"other\.npz\' holds no fragment lists: background, color, .* missing"):
        ab.Fragments.load(tmp_path / "other.npz")


def test_fragments_pickle():
    assert_same_lists(pickle.loads(pickle.dumps(FRAME.fragments)), FRAME.fragments)


def test_repr_counts():
    assert repr(FRAME.fragments) == f"Fragments({HEIGHT}×{WIDTH} pixels, {len(FRAME.fragments)} fragments)"
    assert repr(ab.Fragments((1, 2), [0, 0, 0], [], [], samples=4)) == "Fragments(1×2 pixels of 4 samples, 0 fragments)"
