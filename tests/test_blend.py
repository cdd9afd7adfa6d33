"""Blend modes, and blends of a user's own."""

import copy
import pickle
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import abuffer as ab
import scenes
from abuffer import tables

WIDTH, HEIGHT = 32, 24
CAMERA = ab.Camera.look_at((0, 0, 3), (0, 0, 0))
TRIANGLES, COLORS = scenes.random_triangles(60, 0.5, seed=11)
CORNERS = [(-1, -1, 0), (1, -1, 0), (0, 1, 0)]


def defined(mode, d, c, alpha):
    """What a mode makes of a channel d behind a straight colour c."""
    return {
        "over": d * (1 - alpha) + alpha * c,
        "additive": d + alpha * c,
        "multiply": d * (1 - alpha + alpha * c),
        "screen": 1 - (1 - d) * (1 - alpha * c),
        "premultiplied": d * (1 - alpha) + c,
    }[mode]


def defined_alpha(mode, a, alpha):
    return a * (1 - alpha) + alpha if mode in ("over", "premultiplied") else a


def keep(dst, src, depth):
    return dst


def lighten(dst, src, depth):
    return np.maximum(dst, src[:, :3])


def own(mode):
    """The mode as a Blend. It leaves alpha, so that both agree where alpha behind is 1."""
    return ab.Blend(numpy=lambda dst, src, depth: defined(mode, dst, src[:, :3], src[:, 3:]), name=f"own {mode}")


def rendered(*items, **options):
    return ab.render(list(items), CAMERA, **{"width": WIDTH, "height": HEIGHT, "device": "cpu"} | options)


def one_pixel(colors, modes, background=(0, 0, 0, 0), blends=(), depth=None, **options):
    """The composite of one pixel's list, front to back."""
    depth = np.arange(1.0, len(colors) + 1) if depth is None else depth
    frags = ab.Fragments(
        (1, 1),
        [0, len(colors)],
        depth,
        colors,
        blend=[_id(mode) for mode in modes],
        blends=blends,
        background=background,
    )
    return frags.composite(**options)[0, 0]


def _id(mode):
    return ab.BLENDS.index(mode) if isinstance(mode, str) else 5 + mode


# ---- the modes ----


def test_the_modes():
    assert ab.BLENDS == ("over", "additive", "multiply", "screen", "premultiplied")


rgba = st.tuples(*[st.floats(0, 1)] * 4)


@pytest.mark.parametrize("order", ["front_to_back", "back_to_front"])
@pytest.mark.parametrize("mode", ab.BLENDS)
@settings(derandomize=True, deadline=None)
@given(color=rgba, background=rgba)
def test_a_mode_is_what_its_formula_says(mode, order, color, background):
    image = one_pixel([color], [mode], background, blend_order=order)
    *rgb, a = background
    expected = [defined(mode, d * a, c, color[3]) for d, c in zip(rgb, color, strict=False)]
    # A few roundings of numbers up to 2.
    np.testing.assert_allclose(image, [*expected, defined_alpha(mode, a, color[3])], rtol=0, atol=1e-15)


def test_no_two_modes_are_the_same():
    color, background = (0.3, 0.6, 0.9, 0.25), (0.2, 0.5, 0.8, 0.5)
    images = [one_pixel([color], [mode], background) for mode in ab.BLENDS]
    for i, image in enumerate(images):
        for other in images[:i]:
            assert np.abs(image - other).max() > 0.01


@pytest.mark.parametrize("mode", ab.BLENDS)
def test_only_over_and_premultiplied_raise_alpha(mode):
    raised = one_pixel([(0.5, 0.5, 0.5, 0.5)], [mode])[3]
    assert raised == (0.5 if mode in ("over", "premultiplied") else 0)


COMMUTE = {"additive", "multiply", "screen"}


@pytest.mark.parametrize("front", ab.BLENDS)
@pytest.mark.parametrize("back", ab.BLENDS)
def test_what_commutes(front, back):
    """Equal modes that only add, multiply or screen do; nothing does with over; and no two different ones here."""
    colors, background = [(0.9, 0.4, 0.1, 0.6), (0.3, 0.6, 0.9, 0.25)], (0.2, 0.5, 0.8, 1)
    one = one_pixel(colors, [front, back], background)
    other = one_pixel(colors[::-1], [back, front], background)
    changes = np.abs(one - other).max()
    if front == back and front in COMMUTE:
        assert changes < 1e-15
    else:
        assert changes > 1e-3


@pytest.mark.parametrize("mode", ab.BLENDS)
def test_a_mesh_is_rendered_by_its_mode(mode):
    layer = ab.Mesh(scenes.covering(0)[0], colors=(0.9, 0.4, 0.1, 0.6), blend=mode)
    image = rendered(layer, background=(0.2, 0.5, 0.8, 0.5), precision="float64").image
    expected = [defined(mode, d * 0.5, c, 0.6) for d, c in zip((0.2, 0.5, 0.8), (0.9, 0.4, 0.1), strict=True)]
    expected = np.broadcast_to([*expected, defined_alpha(mode, 0.5, 0.6)], image.shape)
    np.testing.assert_allclose(image, expected, rtol=0, atol=1e-15)


# ---- what a Blend is ----


def test_a_blend_keeps_what_it_is_given():
    blend = ab.Blend("max(dst, src.rgb)", lighten, "lighten")
    assert (blend.wgsl, blend.numpy, blend.name) == ("max(dst, src.rgb)", lighten, "lighten")
    assert ab.Blend("dst").numpy is None
    assert ab.Blend(numpy=keep).wgsl is None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, r"needs wgsl \(for GPUs\), numpy \(for the CPU\) or both"),
        ({"name": "nothing"}, "needs wgsl"),
        ({"wgsl": ""}, "wgsl must be the text of a WGSL expression or function body, got ''"),
        ({"wgsl": " \n"}, "wgsl must be the text"),
        ({"wgsl": b"dst"}, "wgsl must be the text .* got b'dst'"),
        ({"wgsl": keep}, "wgsl must be the text .* give a callable as numpy="),
        ({"numpy": "dst"}, r"numpy must be a callable of \(dst, src, depth\), got 'dst'"),
        ({"wgsl": "dst", "numpy": 3}, "numpy must be a callable"),
        ({"wgsl": "dst", "name": 3}, "name must be text, got 3"),
    ],
)
def test_blends_that_are_refused(arguments, message):
    with pytest.raises(ab.ParameterError, match=message):
        ab.Blend(**arguments)


def test_a_blend_is_read_only():
    blend = ab.Blend("dst")
    with pytest.raises(AttributeError, match="a Blend is read-only: make another with another wgsl"):
        blend.wgsl = "src.rgb"
    with pytest.raises(AttributeError, match="a Blend is read-only"):
        del blend.name
    with pytest.raises(AttributeError):
        blend.anything = 1


def test_blends_of_the_same_text_and_callable_are_equal_whatever_their_name():
    blend = ab.Blend("dst", keep, "a")
    assert blend == ab.Blend("dst", keep, "b")
    assert hash(blend) == hash(ab.Blend("dst", keep, "b"))
    for other in (ab.Blend("dst"), ab.Blend(numpy=keep), ab.Blend("dst ", keep), ab.Blend("dst", lighten), "over"):
        assert blend != other


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda blend: pickle.loads(pickle.dumps(blend))])
def test_copies_of_a_blend_are_equal(copied):
    blend = ab.Blend("dst", keep, "a")
    assert copied(blend) == blend
    assert copied(blend).name == "a"


def test_repr_tells_what_a_blend_is():
    assert repr(ab.Blend("dst")) == "Blend(wgsl='dst')"
    assert repr(ab.Blend("dst", keep, "nothing")) == "Blend('nothing', wgsl='dst', numpy=keep)"
    assert repr(ab.Blend(numpy=np.add)) == "Blend(numpy=add)"
    body = ab.Blend("".join(f"let a{i} = src.a;\n" for i in range(20)) + "return dst;")
    assert repr(body).endswith("…')") and "\n" not in repr(body) and len(repr(body)) < 80


# ---- what it is given, and what it may give ----


def test_a_blend_gets_float64_arrays_of_one_layer_after_another_from_the_farthest():
    seen = []

    def note(dst, src, depth):
        seen.append((dst.copy(), src.copy(), depth.copy()))
        return dst + src[:, :3] * src[:, 3:]

    blend = ab.Blend(numpy=note)
    frags = ab.Fragments(
        (1, 3),
        [0, 2, 2, 3],
        np.array([1, 2, 3], np.float32),
        np.array([(0.5, 0, 0, 0.5), (0, 1, 0, 0.5), (0, 0, 1, 1)], np.float32),
        blend=[5, 5, 5],
        blends=(blend,),
        background=(0.5, 0.5, 0.5, 0.5),
    )
    image = frags.composite()
    assert all(array.dtype == np.float64 for call in seen for array in call)
    (far_dst, far_src, far_depth), (near_dst, near_src, near_depth) = seen
    np.testing.assert_array_equal(far_dst, np.full((2, 3), 0.25))  # premultiplied
    np.testing.assert_array_equal(far_src, [(0, 1, 0, 0.5), (0, 0, 1, 1)])  # straight
    np.testing.assert_array_equal(far_depth, [2, 3])
    np.testing.assert_array_equal(near_dst, [(0.25, 0.75, 0.25)])
    np.testing.assert_array_equal(near_src, [(0.5, 0, 0, 0.5)])
    np.testing.assert_array_equal(near_depth, [1])
    expected = [(0.5, 0.75, 0.25, 0.5), (0.25, 0.25, 0.25, 0.5), (0.25, 0.25, 1.25, 0.5)]
    np.testing.assert_array_equal(image, [expected])


def test_three_channels_leave_alpha_and_four_replace_it():
    three = ab.Blend(numpy=lambda dst, src, depth: src[:, :3])
    four = ab.Blend(numpy=lambda dst, src, depth: src * 0.5)
    color, background = [(0.2, 0.4, 0.6, 0.5)], (1, 1, 1, 0.75)
    np.testing.assert_array_equal(one_pixel(color, [0], background, (three,)), (0.2, 0.4, 0.6, 0.75))
    np.testing.assert_array_equal(one_pixel(color, [0], background, (four,)), (0.1, 0.2, 0.3, 0.25))


def test_a_blend_may_write_to_what_it_gets():
    def in_place(dst, src, depth):
        dst += src[:, :3]
        src[:], depth[:] = 7, 7
        return dst

    colors = np.array([(0.25, 0, 0, 1), (0, 0.5, 0, 1)])
    image = one_pixel(colors, [0, 0], blends=(ab.Blend(numpy=in_place),))
    np.testing.assert_array_equal(image, (0.25, 0.5, 0, 0))
    assert colors.max() == 1


@pytest.mark.parametrize(
    ("result", "message"),
    [
        (lambda dst: dst[:, :2], r"must be of shape \(n, 3\) or \(n, 4\), here with n = 1, got \(1, 2\)"),
        (lambda dst: dst[0], r"got \(3,\)"),
        (lambda dst: np.concatenate([dst, dst]), r"got \(2, 3\)"),
        (lambda dst: 0.5, r"got \(\)"),
        (lambda dst: None, "must be numbers, got dtype object"),
        (lambda dst: dst > 0, "must be numbers, got dtype bool"),
        (lambda dst: "red", "must be numbers, got dtype <U3"),
        (lambda dst: dst * np.nan, r"returns\[0, 0\] is nan \(3 such values\): colours must be finite"),
        (lambda dst: dst + (0, np.inf, 0), r"returns\[0, 1\] is inf"),
    ],
)
def test_what_a_blend_may_not_give(result, message):
    blend = ab.Blend(numpy=lambda dst, src, depth: result(dst), name="wrong")
    with pytest.raises(ab.ParameterError, match=f"what numpy of Blend.'wrong'.*{message}"):
        one_pixel([(1, 1, 1, 1)], [0], blends=(blend,))


def test_what_a_blend_raises_comes_through():
    def fail(dst, src, depth):
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        rendered(ab.Mesh(TRIANGLES, blend=ab.Blend(numpy=fail)))


def test_colours_may_leave_the_unit_range():
    blend = ab.Blend(numpy=lambda dst, src, depth: dst - 2 * src[:, :3])
    np.testing.assert_array_equal(one_pixel([(1, 0, 0, 1)], [0], (1, 1, 1, 1), (blend,)), (-1, 1, 1, 1))


# ---- the same as the core, where a user's blend is a named mode ----


WALL = ab.Mesh(scenes.covering(-0.1)[0] * (0.2, 0.2, 1), colors=(0.1, 0.7, 0.3), opaque=True)


def mixed(blends):
    """Meshes of a fifth of the triangles each, with these blends."""
    return [ab.Mesh(TRIANGLES[i::5], colors=COLORS[i::5], blend=blend) for i, blend in enumerate(blends)]


NAMED, OWN = mixed(ab.BLENDS), mixed([own(mode) for mode in ab.BLENDS])
HALF = mixed([own(mode) if i % 2 else mode for i, mode in enumerate(ab.BLENDS)])


def assert_same_image(frame, other):
    """Up to 12 layers of numbers up to 12: some roundings of float64, in another order of operations."""
    assert (frame.image.shape, frame.image.dtype) == (other.image.shape, other.image.dtype)
    np.testing.assert_allclose(frame.image, other.image, rtol=0, atol=1e-12)


def test_the_comparison_would_see_one_mode_taken_for_another():
    named = rendered(*NAMED, background=0.5, precision="float64")
    other = rendered(*mixed([*ab.BLENDS[:3], "over", "premultiplied"]), background=0.5, precision="float64")
    with pytest.raises(AssertionError):
        assert_same_image(named, other)


@pytest.mark.parametrize("items", [OWN, HALF], ids=["own", "half"])
@pytest.mark.parametrize(
    "options",
    [
        {},
        {"fragments": "count"},
        {"fragments": "all"},
        {"samples": 4},
        {"samples": 8, "msaa_resolve": "per_sample"},
        {"samples": 2, "msaa_resolve": "hdr"},
        {"samples": 4, "msaa_resolve": "none"},
        {"msaa_resolve": "none"},
        {"msaa_resolve": "hdr"},
        {"max_sorted_fragments": 2},
        {"max_sorted_fragments": 2, "limit_policy": "last_submitted"},
        {"max_sorted_fragments": 3, "samples": 4, "limit_policy": "last_submitted", "fragments": "all"},
        {"blend_order": "back_to_front", "fragments": True},
    ],
    ids=lambda options: "-".join(map(str, options.values())) or "plain",
)
def test_own_blends_that_do_what_the_modes_do_give_their_image(items, options):
    image = np.random.default_rng(5).random((HEIGHT, WIDTH, 3))
    options = {"background": image, "precision": "float64"} | options
    named, ours = rendered(WALL, *NAMED, **options), rendered(WALL, *items, **options)
    assert_same_image(ours, named)
    for what in ("fragments", "dropped_fragments", "rejected_triangles"):
        assert getattr(ours.stats, what) == getattr(named.stats, what)
    assert (named.stats.dropped_fragments > 0) == ("max_sorted_fragments" in options)


@pytest.mark.parametrize("fragments", [False, "count", True, "all"])
def test_counts_and_lists_come_when_asked_for_with_blends_too(fragments):
    named, ours = (rendered(WALL, *items, fragments=fragments, samples=2) for items in (NAMED, OWN))
    assert (ours.counts is None) == (named.counts is None) == (fragments is False)
    assert (ours.fragments is None) == (named.fragments is None) == (fragments in (False, "count"))
    if ours.counts is not None:
        np.testing.assert_array_equal(ours.counts, named.counts)
    if ours.fragments is not None:
        for field in ("offsets", "depth", "key", "color", "primitive", "coverage", "background"):
            np.testing.assert_array_equal(getattr(ours.fragments, field), getattr(named.fragments, field))
        assert ours.fragments.blends == tuple(mesh.blend for mesh in OWN)
        # Opaque surfaces are listed as over; the Blends' ids follow those of the modes, in the same order here.
        opaque = ours.fragments.primitive < WALL.face_count
        np.testing.assert_array_equal(ours.fragments.blend[~opaque], named.fragments.blend[~opaque] + 5)
        assert not ours.fragments.blend[opaque].any()


@pytest.mark.parametrize("how", ["per_pixel", "hdr", "none"])
@pytest.mark.parametrize("samples", [1, 4])
def test_lists_with_blends_composite_to_the_image(samples, how):
    options = {"samples": samples, "msaa_resolve": how, "precision": "float64", "background": (0.5, 0.2, 0.1, 0.6)}
    frame = rendered(WALL, *HALF, fragments=True, **options)
    np.testing.assert_array_equal(frame.fragments.composite(msaa_resolve=how), frame.image)
    np.testing.assert_array_equal(frame.fragments[5:9, 3:].composite(msaa_resolve=how), frame.image[5:9, 3:])


def test_float32_renders_stay_float32():
    frame = rendered(*OWN, background=0.5)
    assert frame.image.dtype == np.float32
    # The same lists in float32: colours rounded to 2^-24, and the sum of up to 12 of them to float32 at the end.
    np.testing.assert_allclose(frame.image, rendered(*NAMED, background=0.5).image, rtol=0, atol=1e-5)


def test_an_image_beyond_float32_is_infinite_without_a_warning():
    blend = ab.Blend(numpy=lambda dst, src, depth: dst + 1e300)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert rendered(ab.Mesh(scenes.covering(0)[0], blend=blend)).image.max() == np.inf


def test_a_blend_of_a_mesh_that_is_out_of_view_is_no_trouble():
    blend = ab.Blend(numpy=keep)
    for positions in (np.array(CORNERS) + (0, 0, 9), np.zeros((0, 3))):
        frame = rendered(ab.Mesh(positions, blend=blend), background=0.5, fragments=True)
        np.testing.assert_array_equal(frame.image, np.broadcast_to((0.5, 0.5, 0.5, 1), frame.image.shape))


def test_the_plan_says_why_blends_go_back_to_front():
    plan = rendered(*OWN).plan
    assert "your own" in plan["blend"]
    assert plan["direction"] == "back to front"
    assert plan["compositing"].startswith("numpy")
    assert "your own" not in str(rendered(*NAMED[:1]).plan)
    assert rendered(*OWN).stats.ms["blend"] > 0


# ---- which fragments are left where their number is limited ----


@pytest.mark.parametrize(
    ("policy", "kept"), [("nearest", [0, 1]), ("last_submitted", [0, 3])], ids=["nearest", "last submitted"]
)
def test_a_limit_keeps_the_nearest_or_those_submitted_last(policy, kept):
    """Layers at z of 3, 2, 1, 0 halves, submitted in another order: each leaves its own digit."""
    order = [1, 2, 3, 0]  # the layer in front is the last one, the farthest the last but one
    layers = [
        ab.Mesh(scenes.covering(1 - layer / 2)[0], colors=(10.0**-layer, 0, 0, 1), blend=own("additive"))
        for layer in order
    ]
    frame = rendered(*layers, max_sorted_fragments=2, limit_policy=policy, precision="float64")
    np.testing.assert_allclose(frame.image[0, 0, 0], sum(10.0**-layer for layer in kept), rtol=1e-12)
    assert frame.stats.dropped_fragments == 2 * WIDTH * HEIGHT
    assert frame.stats.fragments == 4 * WIDTH * HEIGHT


# ---- what a device needs ----


def test_the_cpu_needs_numpy_of_every_blend():
    with pytest.raises(ab.ParameterError) as caught:
        rendered(*OWN, ab.Mesh(CORNERS, blend=ab.Blend("dst")))
    for part in ("the CPU needs numpy of every Blend", "Blend(wgsl='dst') has none", "numpy=f with f(dst (n, 3)"):
        assert part in str(caught.value)


def test_compositing_lists_needs_numpy_too():
    with pytest.raises(ab.ParameterError, match=r"compositing lists needs numpy .* Blend\(wgsl='dst'\) has none"):
        one_pixel([(1, 1, 1, 1)], [0], blends=(ab.Blend("dst"),))


class AskedError(Exception):
    """Carries what the core would have been given."""


@pytest.fixture
def gpu(monkeypatch):
    """A GPU that raises what it is asked."""
    adapter = {"name": "Voodoo 2", "kind": "discrete", "backend": "vulkan", "driver": "", "lacks": None}

    class Refusing:
        def __init__(self, adapter):
            pass

        def render(self, meshes, camera, request, background):
            raise AskedError([mesh["blend"] for mesh in meshes], request["blends"])

    monkeypatch.setattr("abuffer._core.adapters", lambda: [adapter])
    monkeypatch.setattr(tables, "_found", (None, []))
    monkeypatch.setattr("abuffer._core.Upload", Refusing)


def test_a_gpu_needs_wgsl_of_every_blend(gpu):
    with pytest.raises(ab.ParameterError) as caught:
        rendered(ab.Mesh(CORNERS, blend=ab.Blend("dst")), *OWN, device="gpu")
    for part in ("a GPU needs wgsl of every Blend", "Blend('own over', numpy=<lambda>) has none", "give wgsl="):
        assert part in str(caught.value)


def test_the_core_gets_ids_and_the_text_of_each_distinct_blend_in_the_order_of_first_use(gpu):
    a, b = ab.Blend("src.rgb", keep), ab.Blend("dst", keep, "b")
    blends = ["screen", b, a, "over", ab.Blend("dst", keep), a]
    meshes = [ab.Mesh(CORNERS, blend=blend) for blend in blends]
    with pytest.raises(AskedError) as caught:
        rendered(*meshes, device="gpu")
    assert caught.value.args == ([3, 5, 6, 0, 5, 6], [("b", "dst"), ("blend", "src.rgb")])


def test_a_scene_has_at_most_eleven_different_blends(gpu):
    blends = [ab.Blend(f"dst * {i}.0", keep) for i in range(12)]
    meshes = [ab.Mesh(CORNERS, blend=blend) for blend in blends]
    with pytest.raises(AskedError) as caught:
        rendered(*meshes[:11], *meshes[:11], device="gpu")
    assert caught.value.args[0] == [*range(5, 16), *range(5, 16)]
    for device in ("gpu", "cpu"):
        with pytest.raises(
            ab.ParameterError, match="at most 11 different Blends, got 12: give meshes that blend alike"
        ):
            rendered(*meshes, device=device)


# ---- files ----


def test_a_file_keeps_the_text_of_blends_but_no_callables(tmp_path):
    blends = (ab.Blend("max(dst, src.rgb)", lighten, "lighten"), ab.Blend(numpy=keep, name="keep"))
    meshes = [ab.Mesh(TRIANGLES[i::2], colors=COLORS[i::2], blend=blend) for i, blend in enumerate(blends)]
    frame = rendered(*meshes, fragments=True)
    frame.fragments.save(tmp_path / "lists.npz")
    frame.save(tmp_path / "frame.npz")
    for loaded in (ab.Fragments.load(tmp_path / "lists.npz"), ab.Frame.load(tmp_path / "frame.npz").fragments):
        assert [repr(blend) for blend in loaded.blends] == [
            "Blend('lighten', wgsl='max(dst, src.rgb)')",
            "Blend('keep')",
        ]
        np.testing.assert_array_equal(loaded.blend, frame.fragments.blend)
        with pytest.raises(ab.ParameterError, match="compositing lists needs numpy"):
            loaded.composite()
        with pytest.raises(ab.SceneError, match=r"blend\[\d+\] is 6 .*with 1 blends of your own ids run from 0 to 5"):
            loaded.blends = blends[:1]
            loaded.composite()
        loaded.blends = blends
        np.testing.assert_array_equal(loaded.composite(), frame.fragments.composite())
