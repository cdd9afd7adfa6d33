"""Blend modes, one a mesh, mixed freely in one scene."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import abuffer as ab
import scenes
from comparison import CPU32, CPU64, GPU, GPU_PREFIX, GPU_TILES, U
from oracle_msaa import MODES, blend_bound, blend_lists

PIPELINES = [CPU32, CPU64, GPU, GPU_PREFIX, GPU_TILES]
EVERY = pytest.mark.parametrize("pipeline", PIPELINES, ids=str)
MODE = pytest.mark.parametrize("mode", MODES)
FRONT = ab.Camera(*scenes.front_camera())
ORDERS = ("front_to_back", "back_to_front")
# Commuting pairs of modes; every other pair, also of one mode with itself, depends on the order.
COMMUTE = {("additive", "additive"), ("multiply", "multiply"), ("screen", "screen")}


def layer(z, color, blend="over", **kw):
    """One triangle that covers the view of FRONT at eye depth 3 - z."""
    return ab.Mesh(scenes.covering(z)[0], colors=color, blend=blend, **kw)


def draw(pipeline, scene, size=4, **kw):
    return pipeline.render(scene, FRONT, width=size, height=size, **kw)


def names_of(frags):
    """The mode of each fragment of lists that mix them."""
    return np.array(ab.BLENDS)[frags.blend]


def mixed_scene(n=80, seed=61, modes=tuple(MODES)):
    """A mesh a triangle, all modes in turn, and alphas from 0.1 to 0.9."""
    triangles, colors = scenes.random_triangles(n, 0.7, seed=seed)
    return [ab.Mesh(triangles[i], colors=colors[i], blend=modes[i % len(modes)]) for i in range(n)]


def unit_of(precision):
    """The bound of a precision in that of float32. In float64 the reference rounds as well."""
    return 1.0 if precision.precision == "float32" else 2 * 2.0**-53 / U


def assert_image_is_the_composite_of_its_lists(frame, precision):
    """Of one sample a pixel, whatever the modes."""
    frags, (height, width) = frame.fragments, frame.fragments.shape
    behind = np.broadcast_to(frags.background, (height, width, 4)).reshape(-1, 4)
    modes = names_of(frags)
    wanted = blend_lists(frags.offsets, frags.color, behind, modes)
    unit = unit_of(precision)
    off = np.abs(frame.image.reshape(-1, 4) - wanted)
    worst = off / np.maximum(unit * blend_bound(frags.offsets, frags.color, behind, modes), 1e-300)
    assert worst.max() <= 1, f"off by {worst.max():.3g} bounds"


# ---- one fragment ----

COLOR, BEHIND = (0.9, 0.4, 0.1, 0.6), (0.2, 0.5, 0.8)


@EVERY
@MODE
@pytest.mark.parametrize("opacity", [1.0, 0.5, 0.0])
def test_one_fragment_is_what_its_mode_says(pipeline, mode, opacity):
    *c, a = COLOR
    d = opacity * np.array(BEHIND)
    c = np.array(c)
    wanted = {
        "over": d * (1 - a) + a * c,
        "additive": d + a * c,
        "multiply": d * (1 - a + a * c),
        "screen": 1 - (1 - d) * (1 - a * c),
        "premultiplied": d * (1 - a) + c,
    }[mode]
    alpha = opacity * (1 - a) + a if mode in ("over", "premultiplied") else opacity
    image = draw(pipeline, layer(0, COLOR, mode), background=(*BEHIND, opacity)).image
    # Five operations on numbers that are not negative, and three numbers rounded to float32.
    np.testing.assert_allclose(image, np.broadcast_to([*wanted, alpha], (4, 4, 4)), rtol=8 * U, atol=0)


@EVERY
@MODE
@pytest.mark.parametrize("order", ORDERS)
def test_alpha_0_changes_nothing_but_premultiplied_colour(pipeline, mode, order):
    background = np.float32((*BEHIND, 1))
    image = draw(pipeline, layer(0, (0.9, 0.4, 0.1, 0), mode), background=background, blend_order=order).image
    if mode == "premultiplied":  # light without cover
        np.testing.assert_allclose(image[0, 0], background + np.float32((0.9, 0.4, 0.1, 0)), rtol=4 * U)
    else:
        np.testing.assert_array_equal(image, np.broadcast_to(background, (4, 4, 4)))


@EVERY
@pytest.mark.parametrize("mode", ["over", "additive", "premultiplied"])
def test_colours_over_1_are_kept_where_a_mode_has_a_use_for_them(pipeline, mode):
    image = draw(pipeline, layer(0, (300.0, 2.0, 0.5, 0.5), mode), background=(1, 1, 1, 1)).image
    scale = 1 if mode == "premultiplied" else 0.5
    through = 1 if mode == "additive" else 0.5
    np.testing.assert_array_equal(image[0, 0, :3], through + scale * np.array([300.0, 2.0, 0.5]))


@pytest.mark.parametrize("mode", ["multiply", "screen"])
def test_multiply_and_screen_take_no_colour_over_1(mode):
    colors = np.full((3, 3, 4), 0.5, np.float32)
    colors[1, 2, 0] = 1.25
    triangles = np.repeat(scenes.covering()[0], 3, axis=0)
    with pytest.raises(ab.SceneError, match=rf"(?s)colors.*1\.25|1\.25.*{mode}"):
        ab.Mesh(triangles, colors=colors, color_mode="corner", blend=mode)
    ab.Mesh(triangles, colors=np.minimum(colors, 1), color_mode="corner", blend=mode)


def test_an_unknown_mode_lists_the_known_ones():
    with pytest.raises(ab.ParameterError) as caught:
        layer(0, COLOR, "overlay")
    assert all(mode in str(caught.value) for mode in MODES)
    assert set(MODES) <= set(ab.BLENDS)
    assert ab.BLENDS[0] == "over"


# ---- several ----


@EVERY
@pytest.mark.parametrize("order", ORDERS)
def test_an_image_of_mixed_modes_is_its_lists_blended_back_to_front(pipeline, order):
    frame = draw(pipeline, mixed_scene(), 48, fragments=True, blend_order=order, background=(0.3, 0.6, 0.1, 0.8))
    assert frame.counts.max() >= 12
    assert set(names_of(frame.fragments)) == set(MODES)
    assert_image_is_the_composite_of_its_lists(frame, pipeline)
    background = (0.3, 0.6, 0.1, 0.8)
    for order in ORDERS:
        again = frame.fragments.composite(blend_order=order)
        wanted = blend_lists(
            frame.fragments.offsets, frame.fragments.color, np.tile(background, (48 * 48, 1)), names_of(frame.fragments)
        )
        # Two float64 composites; the background came as float32.
        np.testing.assert_allclose(again.reshape(-1, 4), wanted, rtol=4 * U)


@pytest.mark.parametrize("change", ["a mode", "the order", "a colour", "all over"])
def test_the_comparison_with_the_lists_sees_each_way_of_being_wrong(change):
    frame = draw(CPU32, mixed_scene(), 32, fragments=True, background=(0.3, 0.6, 0.1, 0.8))
    frags = frame.fragments
    first = int(frags.offsets[np.flatnonzero(frags.counts.ravel() >= 4)[0]])
    fields = {"color": frags.color.copy(), "blend": frags.blend.copy()}
    if change == "a mode":
        fields["blend"][first] = (fields["blend"][first] + 1) % 5
    elif change == "all over":
        fields["blend"][:] = 0
    elif change == "a colour":
        fields["color"][first, :3] *= 1 + 1e-3
    else:
        for values in fields.values():
            values[[first, first + 1]] = values[[first + 1, first]]
    changed = object.__new__(ab.Fragments)
    changed.__dict__.update(frags.__dict__ | fields)
    other = object.__new__(ab.Frame)
    other.__dict__.update(frame.__dict__ | {"fragments": changed})
    assert_image_is_the_composite_of_its_lists(frame, CPU32)
    with pytest.raises(AssertionError, match="off by"):
        assert_image_is_the_composite_of_its_lists(other, CPU32)


@EVERY
def test_both_directions_give_the_same_image_up_to_rounding(pipeline):
    scene = mixed_scene(seed=62)
    one, other = (draw(pipeline, scene, 40, fragments=True, blend_order=order) for order in ORDERS)
    np.testing.assert_array_equal(one.fragments.primitive, other.fragments.primitive)
    frags = one.fragments
    most = blend_bound(frags.offsets, frags.color, np.zeros((1600, 4)), names_of(frags))
    unit = unit_of(pipeline)
    assert (np.abs(one.image - other.image).reshape(-1, 4) <= 2 * unit * most).all()
    assert np.isfinite(one.image).all()


@EVERY
def test_both_directions_agree_where_all_is_over(pipeline):
    triangles, colors = scenes.layers(40, 0.1)
    one, other = (
        draw(pipeline, ab.Mesh(triangles, colors=colors), blend_order=order, background=(0.5, 0.6, 0.7, 1)).image
        for order in ORDERS
    )
    # 2 (n + 1) u front to back, 3 n + 2 back to front.
    np.testing.assert_allclose(one, other, rtol=(2 * 41 + 122) * U)


@settings(max_examples=60, derandomize=True, deadline=None)
@given(
    layers=st.lists(
        st.tuples(st.sampled_from(list(MODES)), st.tuples(*[st.integers(0, 64)] * 4)), min_size=1, max_size=8
    ),
    behind=st.tuples(*[st.integers(0, 64)] * 4),
    order=st.sampled_from(ORDERS),
    double=st.booleans(),
)
def test_any_stack_of_modes_is_the_float64_composite(layers, behind, order, double):
    pipeline = CPU64 if double else CPU32
    color = np.array([c for _, c in layers]) / 64
    modes = np.array([mode for mode, _ in layers])
    background = np.array(behind) / 64
    # Submitted in an order of their own; layer 0 is the nearest.
    given_order = np.argsort([hash(c) for _, c in layers], kind="stable")
    scene = [layer(1 - 0.25 * i, color[i], modes[i]) for i in given_order]
    image = draw(pipeline, scene, 1, background=tuple(background), blend_order=order).image
    offsets = np.array([0, len(layers)])
    wanted = blend_lists(offsets, color, background[None], modes)
    unit = unit_of(pipeline)
    off = np.abs(image.reshape(1, 4) - wanted)
    assert (off <= unit * blend_bound(offsets, color, background[None], modes)).all()


@EVERY
@pytest.mark.parametrize(
    ("first", "second"), [(a, b) for i, a in enumerate(MODES) for b in list(MODES)[i:]], ids=lambda mode: mode
)
def test_which_modes_commute(pipeline, first, second):
    """Two layers at exchanged depths."""
    colors = {"first": (0.9, 0.4, 0.1, 0.6), "second": (0.3, 0.6, 0.9, 0.25)}
    images = [
        draw(
            pipeline,
            [layer(z, colors["first"], first), layer(-z, colors["second"], second)],
            background=(0.2, 0.5, 0.8, 0.75),
        ).image
        for z in (0.5, -0.5)
    ]
    if (first, second) in COMMUTE:
        # (6 n + 2) u of numbers at most 2, on either side, and screen's absolute u.
        np.testing.assert_allclose(images[0], images[1], rtol=0, atol=2 * (14 * 2 + 2) * U)
    else:
        assert np.abs(images[0] - images[1]).max() > 0.01


@EVERY
def test_black_that_multiplies_hides_colour_but_not_alpha(pipeline):
    """All four transmittances must be 0 before what is behind may be left out."""
    scene = [layer(1, (0, 0, 0, 1), "multiply"), layer(0, (0.9, 0.4, 0.1, 0.5))]
    np.testing.assert_array_equal(draw(pipeline, scene).image, np.broadcast_to([0, 0, 0, 0.5], (4, 4, 4)))
    red = [layer(1, (1, 0, 0, 1), "multiply"), layer(0, (0.75, 0.5, 0.25, 0.5))]
    np.testing.assert_array_equal(draw(pipeline, red).image, np.broadcast_to([0.375, 0, 0, 0.5], (4, 4, 4)))


@EVERY
@pytest.mark.parametrize("mode", ["over", "premultiplied"])
def test_what_lies_behind_full_cover_changes_no_bit(pipeline, mode):
    front = [layer(1, (0.25, 0.5, 0.75, 1), mode), layer(1.5, (0.3, 0.1, 0.2, 0.4), "screen")]
    alone = draw(pipeline, front).image
    behind = [layer(-0.1 * i, (0.9, 0.9, 0.9, 0.5), m) for i, m in enumerate(MODES)]
    np.testing.assert_array_equal(draw(pipeline, behind + front, background=(1, 1, 1, 1)).image, alone)


@EVERY
def test_additive_layers_add_up_to_their_sum(pipeline):
    n = 100
    rng = np.random.default_rng(0)
    color = rng.uniform(0, 1, (n, 4)).astype(np.float32)
    z = rng.permutation(n) / n
    frame = draw(pipeline, [layer(z[i], color[i], "additive") for i in range(n)], fragments="count")
    assert (frame.counts == n).all()
    values = color.astype(np.float64)
    wanted = [*(values[:, :3] * values[:, 3:]).sum(axis=0), 0]
    np.testing.assert_allclose(frame.image, np.broadcast_to(wanted, (4, 4, 4)), rtol=(n + 1) * U)


# ---- lists ----


@EVERY
def test_lists_of_over_alone_name_no_modes(pipeline):
    frags = draw(pipeline, [layer(0, COLOR), layer(1, COLOR)], fragments=True).fragments
    assert frags.blend is None


@EVERY
def test_lists_name_the_mode_of_each_fragments_mesh(pipeline):
    scene = mixed_scene(seed=63)
    frags = draw(pipeline, scene, 32, fragments=True).fragments
    assert frags.blend.dtype == np.uint8
    assert frags.blend.shape == (len(frags),)
    meshes = ab.Scene(scene).locate(frags.primitive)[0]
    np.testing.assert_array_equal(names_of(frags), np.array(list(MODES))[meshes % 5])


@EVERY
@pytest.mark.parametrize("mode", ["additive", "multiply", "screen", "premultiplied"])
def test_one_mesh_of_another_mode_is_enough_to_name_them(pipeline, mode):
    frags = draw(pipeline, layer(0, COLOR, mode), fragments=True).fragments
    assert (names_of(frags) == mode).all()


@EVERY
def test_permuting_meshes_of_all_modes_changes_no_bit(pipeline):
    scene = mixed_scene(seed=64)
    first = draw(pipeline, scene, 40, fragments=True)
    tied = (np.diff(first.fragments.pixel) == 0) & (np.diff(first.fragments.key.astype(np.int64)) == 0)
    assert not tied.any()
    for seed in range(2):
        order = np.random.default_rng(seed).permutation(len(scene))
        again = draw(pipeline, [scene[i] for i in order], 40, fragments=True)
        np.testing.assert_array_equal(again.image, first.image)
        np.testing.assert_array_equal(again.fragments.blend, first.fragments.blend)
        np.testing.assert_array_equal(order[again.fragments.primitive], first.fragments.primitive)


@EVERY
def test_of_equal_depths_the_later_mesh_is_in_front_whatever_its_mode(pipeline):
    for modes in (("multiply", "over"), ("over", "multiply")):
        scene = [layer(0, (0.5, 0.25, 0.75, 0.5), mode) for mode in modes]
        frags = draw(pipeline, scene, fragments=True, background=(1, 1, 1, 1)).fragments
        assert (frags.primitive.reshape(-1, 2) == [1, 0]).all()
        assert (names_of(frags).reshape(-1, 2) == modes[::-1]).all()


@EVERY
def test_without_the_lists_the_image_is_the_same(pipeline):
    scene = mixed_scene(seed=65)
    images = [draw(pipeline, scene, 40, fragments=fragments).image for fragments in (False, "count", True)]
    np.testing.assert_array_equal(images[1], images[0])
    np.testing.assert_array_equal(images[2], images[0])


# ---- with opaque surfaces, and with samples ----


@EVERY
def test_an_opaque_surface_is_the_destination(pipeline):
    wall = layer(0, (0.2, 0.5, 0.75), opaque=True)
    for mode, (rgb, alpha) in MODES.items():
        scene = [layer(1, COLOR, mode), wall, layer(-1, COLOR, mode)]  # the last is hidden
        frame = draw(pipeline, scene, fragments=True, background=(0.3, 0.3, 0.3, 0.3))
        assert (frame.fragments.counts == 1).all()
        c = np.array(COLOR[:3])
        wanted = [*rgb(np.array([0.2, 0.5, 0.75]), c, 0.6), alpha(1.0, 0.6)]
        np.testing.assert_allclose(frame.image[0, 0], wanted, rtol=10 * U)


@EVERY
def test_fragments_all_lists_opaque_surfaces_as_over(pipeline):
    scene = [layer(1, COLOR, "screen"), layer(0, (0.2, 0.5, 0.75), opaque=True), layer(-1, COLOR, "additive")]
    frame = draw(pipeline, scene, fragments="all")
    assert names_of(frame.fragments)[:3].tolist() == ["screen", "over", "additive"]
    np.testing.assert_array_equal(frame.image, draw(pipeline, scene).image)
    assert_image_is_the_composite_of_its_lists(frame, pipeline)


@EVERY
def test_mixed_modes_blend_in_each_sample_over_what_is_behind_it(pipeline):
    samples, size = 4, 32
    wall = ab.Mesh(scenes.random_triangles(4, 0.8, seed=66)[0], colors=(0.3, 0.4, 0.2), opaque=True)
    scene = [wall, *mixed_scene(40, seed=67)]
    options = {"samples": samples, "fragments": True, "background": (0.3, 0.6, 0.1, 0.8)}
    frame = draw(pipeline, scene, size, **options)
    each = draw(pipeline, scene, size, msaa_resolve="none", **options).image
    frags, modes = frame.fragments, names_of(frame.fragments)
    behind = np.broadcast_to(frags.background, (size, size, samples, 4)).reshape(-1, samples, 4)
    assert (frags.coverage != 15).sum() > 300
    unit = unit_of(pipeline)
    mean, most = np.zeros((size * size, 4)), np.zeros((size * size, 4))
    for s in range(samples):
        covers = frags.coverage >> np.uint32(s) & 1 == 1
        counts = np.bincount(frags.pixel[covers], minlength=size * size)
        lists = np.concatenate([[0], np.cumsum(counts)]), frags.color[covers], behind[:, s], modes[covers]
        wanted, own = blend_lists(*lists), unit * blend_bound(*lists)
        assert (np.abs(each[:, :, s].reshape(-1, 4) - wanted) <= own).all()
        mean += wanted / samples
        most += own / samples
    # The mean adds a rounding a sample.
    assert (np.abs(frame.image.reshape(-1, 4) - mean) <= most + unit * samples * U * mean).all()


@EVERY
@pytest.mark.parametrize("order", ORDERS)
def test_mixed_modes_of_long_lists_are_exact(pipeline, order):
    """Longer than any array that a pixel could be sorted in."""
    n = 200
    rng = np.random.default_rng(1)
    color = rng.uniform(0, 1, (n, 4)).astype(np.float32)
    color[:, 3] *= 0.05
    modes = np.array(list(MODES))[rng.integers(0, 5, n)]
    place = rng.permutation(n)  # 0 is the nearest
    scene = [layer(1 - place[i] / 128, color[i], modes[i]) for i in range(n)]
    frame = draw(pipeline, scene, 2, fragments=True, blend_order=order, background=(0.3, 0.6, 0.1, 0.8))
    assert (frame.fragments.counts == n).all()
    np.testing.assert_array_equal(names_of(frame.fragments)[:n], modes[np.argsort(place)])
    assert_image_is_the_composite_of_its_lists(frame, pipeline)
