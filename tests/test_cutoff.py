"""The option cutoff: compositing stops early, and no channel changes by more than was said."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import abuffer as ab
import scenes
from comparison import CPU32, CPU64, GPU, GPU_PREFIX, GPU_TILES, U

ALL = [CPU32, CPU64, GPU, GPU_PREFIX, GPU_TILES]
EVERY = pytest.mark.parametrize("pipeline", ALL, ids=str)
FRONT = ab.Camera(*scenes.front_camera())
# Sorts that are asked for go one entry at a time everywhere, so that each pixel stops at the very fragment.
EACH = {"sort": "insertion"}
DEEP = 100  # longer than all lists that a resolve has registers for


def layers(n, color, *, darker=1.0, wall=None):
    """n equal layers over the whole view, and an opaque wall behind them.

    darker: what RGB of two of the three corners is multiplied by. Under 1, colours are interpolated.
    """
    triangles = np.concatenate([scenes.covering(1 - k / 64)[0] for k in range(n)])
    colors = np.tile(np.float32(color), (n, 3, 1))
    colors[:, 1:, :3] *= darker
    meshes = [ab.Mesh(triangles, colors=colors[0, 0] if darker == 1 else colors)]
    return meshes if wall is None else [*meshes, ab.Mesh(scenes.covering(-9)[0], colors=np.float32(wall), opaque=True)]


def draw(pipeline, scene, **kw):
    return pipeline.render(scene, FRONT, **({"width": 19, "height": 19} | kw))


def rounding(pipeline, counts, size):
    """Of a list of `counts` fragments composited to `size`: 2(n + 1)u of it, all terms being positive, and its colours'.

    Image and transmittance have it; what the latter stops at is off by as much of `cutoff`.
    """
    u = 2.0**-53 if pipeline is CPU64 else U
    return (2 * (counts + 1) + 2 * pipeline.interpolation_ulps) * u * size


@st.composite
def random_scenes(draw):
    n = draw(st.integers(1, 60))
    triangles, colors = scenes.random_triangles(n, draw(st.sampled_from([0.5, 3.0])), draw(st.integers(0, 10**6)))
    if draw(st.booleans()):
        colors = colors[:, 0]
    brightest = draw(st.sampled_from([0.25, 1.0, 30.0]))
    colors[..., :3] *= brightest
    meshes = [ab.Mesh(triangles, colors=colors)]
    if draw(st.booleans()):
        meshes.append(ab.Mesh(scenes.covering(-2)[0], colors=(brightest, 0.5, 0.25, 1), opaque=True))
    background = tuple(draw(st.floats(0, 2, width=32)) for _ in range(3)) + (draw(st.floats(0, 1, width=32)),)
    return meshes, background


@EVERY
@settings(max_examples=20, derandomize=True, deadline=None)
@given(
    random_scenes(),
    st.floats(1e-4, 1.0),
    st.sampled_from([{}, EACH, {"samples": 4}, {"samples": 4, "msaa_resolve": "none"}]),
)
def test_no_channel_is_off_by_more_than_the_cutoff(pipeline, scene, cutoff, options):
    meshes, background = scene
    look = options | {"background": background}
    frame = draw(pipeline, meshes, cutoff=cutoff, **look)
    lists = draw(pipeline, meshes, fragments=True, **look).fragments
    wanted = lists.composite(msaa_resolve=options.get("msaa_resolve", "per_pixel"))
    counts = lists.counts.reshape(lists.counts.shape + (1,) * (wanted.ndim - 2))
    bound = cutoff + rounding(pipeline, counts, wanted + 2 * cutoff)
    assert frame.stats.error_bound == cutoff
    assert (np.abs(frame.image - wanted) <= bound).all()


@EVERY
def test_equal_layers_are_off_by_what_the_geometric_series_says(pipeline):
    # Of alpha 1/2: ten layers let 2⁻¹⁰ through, which the other ninety would have made 2⁻¹⁰ − 2⁻¹⁰⁰ of.
    scene = layers(DEEP, (1, 0.5, 0, 0.5))
    frame = draw(pipeline, scene, cutoff=2**-10, **EACH)
    error = draw(pipeline, scene, **EACH).image - frame.image
    np.testing.assert_array_equal(error, np.broadcast_to(2**-10 * np.array([1, 0.5, 0, 1]), error.shape))


@EVERY
def test_an_eleventh_layer_is_composited_where_ten_let_too_much_through(pipeline):
    image = draw(pipeline, layers(DEEP, (1, 0.5, 0, 0.5)), cutoff=0.999 * 2**-10, **EACH).image
    assert (image[..., 3] == 1 - 2**-11).all()


@EVERY
@pytest.mark.parametrize("brighter", ["the layers", "the background", "the wall"])
def test_the_largest_colour_counts_wherever_it_is(pipeline, brighter):
    # Where 32 is the largest, 2⁻¹⁵ of it is 2⁻¹⁰.
    color = (32 if brighter == "the layers" else 1, 0.5, 0, 0.5)
    behind = (32.0, 0, 0, 1) if brighter == "the background" else (0, 0, 0, 0)
    scene = layers(DEEP, color, wall=(32, 0, 0) if brighter == "the wall" else None)
    whole, frame = (draw(pipeline, scene, background=behind, cutoff=cutoff, **EACH) for cutoff in (0, 2**-10))
    error = np.abs(whole.image - frame.image).max(axis=(0, 1))
    assert error.max() <= 2**-10
    # Fifteen layers are composited, and no more: green is wholly the layers' own.
    assert error[1] == 2**-15 * 0.5 if brighter != "the wall" else error[1] <= 2**-15 * 0.5


@pytest.mark.parametrize("pipeline", [GPU, GPU_PREFIX], ids=str)
def test_colours_that_a_format_rounds_up_keep_the_bound(pipeline):
    bright = 511.5 / 16  # rounds up to 32
    look = EACH | {"node_format": "rgb9e5_alpha8_depth24"}
    scene = layers(DEEP, (bright, 0, 0, 51 / 255))
    # Three layers let just too much through, where without the rounding they would not.
    cutoff = 1.0001 * 0.8**3 * bright
    whole, frame = (draw(pipeline, scene, cutoff=c, **look).image for c in (0, cutoff))
    assert whole.max() > bright
    assert 0 < np.abs(whole - frame).max() <= cutoff + 32 * 2 * (DEEP + 1) * U


@EVERY
def test_counts_and_lists_stay_whole(pipeline):
    triangles, colors = scenes.random_triangles(60, 3.0, 5)
    scene = [ab.Mesh(triangles, colors=colors)]
    whole, frame = (draw(pipeline, scene, fragments=True, cutoff=cutoff) for cutoff in (0, 0.75))
    for name in ("offsets", "key", "depth", "primitive", "color"):
        np.testing.assert_array_equal(getattr(frame.fragments, name), getattr(whole.fragments, name))
    np.testing.assert_array_equal(draw(pipeline, scene, fragments="count", cutoff=0.75).counts, whole.counts)
    for name in ("fragments", "max_depth_complexity", "dropped_fragments"):
        assert getattr(frame.stats, name) == getattr(whole.stats, name)


@EVERY
@pytest.mark.parametrize("samples", [1, 4])
def test_a_cutoff_of_0_changes_no_bit(pipeline, samples):
    triangles, colors = scenes.random_triangles(60, 3.0, 6)
    scene = [ab.Mesh(triangles, colors=colors), *layers(40, (0.5, 0.25, 1, 0.96875))]
    whole, frame = (draw(pipeline, scene, samples=samples, **kw) for kw in ({}, {"cutoff": 0}))
    np.testing.assert_array_equal(frame.image.view(np.uint8), whole.image.view(np.uint8))
    assert frame.stats.error_bound == whole.stats.error_bound == 0


@EVERY
@pytest.mark.parametrize("n", [4, 30, DEEP])
def test_what_a_layer_of_alpha_1_hides_leaves_no_bit(pipeline, n):
    window = ab.Mesh(scenes.covering(1.5)[0], colors=(0.3, 0.6, 0.9, 0.7))
    sheet = ab.Mesh(scenes.covering(1.25)[0], colors=(0.7, 0.1, 0.2, 1))
    behind = {"background": (0.5, 0.6, 0.7, 0.8)}
    image = draw(pipeline, [*layers(n, (1, 0.5, 0.3, 0.5), darker=0.5), sheet, window], **behind).image
    np.testing.assert_array_equal(image, draw(pipeline, [sheet, window], **behind).image)


@EVERY
def test_long_lists_are_left_early_by_default(pipeline):
    """The comparisons above would pass without any stop: here one that allows for roundings alone must fail."""
    scene = layers(DEEP, (1, 0.5, 0, 0.125), darker=0.5)
    whole, frame = (draw(pipeline, scene, cutoff=cutoff) for cutoff in (0, 0.25))
    error = np.abs(frame.image - whole.image)[..., 0]
    assert (error > 2 * rounding(pipeline, DEEP, 1)).all()
    assert (error <= 0.25).all()


# What resolves a tile on a GPU without lists: a shader a class.
WHITE = np.float32([1, 1, 1, 0.5])


def many_small(n):
    """n layers of triangles of 8 pixels each, under an orthographic camera of a world unit a pixel."""
    x, y = (v.ravel() for v in np.meshgrid(np.arange(0, 32, 4.0), np.arange(0, 32, 4.0)))
    corners = np.array([[(0, 0), (4, 0), (0, 4)], [(4, 0), (4, 4), (0, 4)]])
    flat = (corners[None] + np.stack([x, y], 1)[:, None, None]).reshape(-1, 3, 2)
    return [ab.Mesh(np.concatenate([flat, np.full((*flat.shape[:2], 1), -k)], 2), colors=WHITE) for k in range(n)]


def few_large(n):
    """n layers that cover the view, of colours that are interpolated, though they are equal."""
    corners = np.array([(-99, -99), (200, -99), (-99, 200)])
    positions = [np.c_[corners, np.full(3, -k)] for k in range(n)]
    return [ab.Mesh(p, colors=np.tile(WHITE, (3, 1)), color_mode="vertex") for p in positions]


@pytest.mark.parametrize(("scene", "named"), [(many_small, ("triangles", "staged")), (few_large, ("masks",))])
def test_what_is_sorted_in_registers_is_composited_whole(needs_gpu, scene, named):
    """Which no bound forbids: to look whether something shows through takes longer than it saves."""
    camera = ab.Camera.orthographic((16, 16, 3), (16, 16, 0), height=32)
    frame = GPU_TILES.render(scene(8), camera, width=32, height=32, cutoff=2**-4)
    assert frame.plan["lists"] == "none"
    assert any(name in frame.plan["tile classes"] for name in named)
    assert (frame.image == 1 - 2**-8).all()


def test_what_the_frame_says(tmp_path):
    frame = draw(CPU32, layers(3, (4, 0, 0, 0.5)), cutoff=0.125)
    assert frame.stats.error_bound == 0.125
    assert frame.plan["cutoff"] == "0.125"
    assert "at most 0.0312 is let through" in str(frame.plan)
    frame.save(tmp_path / "frame.npz")
    assert ab.Frame.load(tmp_path / "frame.npz").stats.error_bound == 0.125
    assert "cutoff" not in str(draw(CPU32, layers(3, (4, 0, 0, 0.5))).plan)


@EVERY
def test_a_cutoff_over_all_colours_is_no_error(pipeline):
    assert draw(pipeline, layers(3, (1, 0.5, 0.25, 0.5)), cutoff=1e30).stats.error_bound == 1e30


# Lists of one's own.
def test_composite_stops_at_the_same_fragment():
    lists = draw(CPU64, layers(DEEP, (1, 0.5, 0, 0.5)), fragments=True).fragments
    error = lists.composite() - lists.composite(cutoff=2**-10)
    assert (error[..., 3] == 2**-10 * (1 - 2.0**-90)).all() or (error[..., 3] == 2**-10).all()
    np.testing.assert_array_equal(lists.composite(cutoff=0), lists.composite())


def test_a_background_that_composite_is_given_counts_too():
    lists = draw(CPU64, layers(DEEP, (1, 0.5, 0, 0.5)), fragments=True).fragments
    error = np.abs(lists.composite(background=(32.0, 0, 0)) - lists.composite(background=(32.0, 0, 0), cutoff=2**-10))
    assert 0 < error.max() <= 2**-10


# What is refused.
ADD = {"blend": "additive"}
OWN = {"blend": ab.Blend(numpy=lambda dst, src, depth: dst)}


@pytest.mark.parametrize("value", [-1e-9, float("nan"), float("inf"), "1/255", None, True, [0.1]])
def test_values_that_are_refused(value):
    with pytest.raises(ab.ParameterError, match="cutoff must be"):
        draw(CPU32, layers(1, (1, 1, 1, 0.5)), cutoff=value)
    lists = draw(CPU32, layers(1, (1, 1, 1, 0.5)), fragments=True).fragments
    with pytest.raises(ab.ParameterError, match="cutoff must be"):
        lists.composite(cutoff=value)


@pytest.mark.parametrize(
    ("mesh", "options", "message"),
    [
        (ADD, {}, "cutoff is for blend=\"over\" alone, and there is 'additive'"),
        (OWN, {}, 'cutoff is for blend="over" alone, and there is '),
        ({}, {"blend_order": "back_to_front"}, 'blend_order is "back_to_front": leave one of them out'),
        ({}, {"msaa_resolve": "hdr", "samples": 4}, 'with msaa_resolve="hdr" their mean may change by more'),
    ],
)
def test_what_has_no_bound_is_refused(mesh, options, message):
    scene = ab.Mesh(scenes.covering()[0], colors=(1, 1, 1, 0.5), **mesh)
    with pytest.raises(ab.ParameterError, match=message):
        draw(CPU32, scene, cutoff=0.1, **options)
    draw(CPU32, scene, cutoff=0, **options)
    sampled = {"samples": options.pop("samples", 1)}
    lists = draw(CPU32, scene, fragments=True, **sampled).fragments
    with pytest.raises(ab.ParameterError, match=message):
        lists.composite(cutoff=0.1, **options)
    lists.composite(cutoff=0, **options)


def test_the_mean_for_bright_samples_may_indeed_change_by_more():
    """Why msaa_resolve="hdr" is refused: three samples of 1000 leave a black one nearly all the weight."""
    weight = [1 / (1 + 1000.0)] * 3

    def mean(dark):
        weights = np.array([*weight, 1 / (1 + dark)])
        return (weights * [1000, 1000, 1000, dark]).sum() / weights.sum()

    assert mean(0.01) - mean(0) > 3 * 0.01


def test_one_sample_has_no_mean_to_weigh():
    draw(CPU32, layers(1, (1, 1, 1, 0.5)), cutoff=0.1, msaa_resolve="hdr")
