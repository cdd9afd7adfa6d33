"""How a pixel's list is sorted, and what is left out where only so many fragments are sorted."""

import numpy as np
import pytest

import abuffer as ab
import scenes
from comparison import CPU32, CPU64, GPU, GPU_PREFIX, GPU_TILES, U
from oracle_msaa import MODES, blend_lists

EVERY = pytest.mark.parametrize("pipeline", [CPU32, CPU64, GPU, GPU_PREFIX, GPU_TILES], ids=str)
ON_GPU = pytest.mark.parametrize("pipeline", [GPU, GPU_PREFIX], ids=str)
SORTS = ("auto", "insertion", "selection", "bitonic", "merge", "heap")
LONGEST = 200
WIDTH, HEIGHT = LONGEST + 1, 2
# One world unit is one pixel, the image's lower left corner is the origin, and depth is 3 - z.
STAIRS = ab.Camera.orthographic((WIDTH / 2, HEIGHT / 2, 3), (WIDTH / 2, HEIGHT / 2, 0), height=HEIGHT)
BEHIND = (0.2, 0.4, 0.1, 1.0)


def stairs(seed=0, *, modes=("over",), ties=True):
    """Layers 0 to 199 of random depth, layer k right of x = k + 1: column x has a list of x fragments.

    With `ties` every fifth layer has the depth of the layer before it.
    """
    rng = np.random.default_rng(seed)
    z = rng.permutation(LONGEST) / LONGEST
    if ties:
        z[4::5] = z[3::5]
    colors = rng.uniform(0, 1, (LONGEST, 4)).astype(np.float32)
    colors[:, 3] = 0.01 + 0.09 * colors[:, 3]  # so that the 200th layer is seen
    edge = [np.array([(k + 1, -400, z[k]), (k + 1, 400, z[k]), (k + 900, 1, z[k])]) for k in range(LONGEST)]
    if modes == ("over",):
        return [ab.Mesh(np.array(edge), colors=colors, color_mode="face")]
    return [ab.Mesh(edge[k], colors=colors[k], blend=modes[k % len(modes)]) for k in range(LONGEST)]


def draw(pipeline, scene, **kw):
    options = {"width": WIDTH, "height": HEIGHT, "background": BEHIND, "fragments": True}
    return pipeline.render(scene, STAIRS, **(options | kw))


def few_classes(pipeline):
    """Two resolve classes instead of five: a GPU compiles a shader for each, with each sort and limit."""
    return {"resolve_classes": (8, 32)} if pipeline in (GPU, GPU_PREFIX) else {}


def permuted(scene, order):
    """The same faces in another order: order[i] is drawn as the i-th."""
    (mesh,) = scene
    return [ab.Mesh(mesh.triangles()[order], colors=mesh.colors[order], color_mode="face")]


def assert_same_bits(frame, other):
    np.testing.assert_array_equal(frame.image, other.image)
    for name in ("offsets", "key", "depth", "primitive", "color", "coverage", "blend"):
        np.testing.assert_array_equal(getattr(frame.fragments, name), getattr(other.fragments, name))


# What the resolve has to carry beside colour and depth.
KINDS = {
    "plain": {},
    "samples and modes": {"samples": 4, "modes": tuple(MODES)},
}


@EVERY
@pytest.mark.parametrize("kind", KINDS)
def test_every_sort_gives_the_same_bits(pipeline, kind):
    options = dict(KINDS[kind]) | (few_classes(pipeline) if kind != "plain" else {})
    scene = stairs(modes=options.pop("modes", ("over",)))
    default = draw(pipeline, scene, **options)
    # Column x holds x fragments; with samples an edge at its border covers it wholly or not at all.
    assert (default.fragments.counts == np.arange(WIDTH)).all()
    tied = (np.diff(default.fragments.pixel) == 0) & (np.diff(default.fragments.key.astype(np.int64)) == 0)
    assert tied.sum() > 5000
    assert (np.diff(default.fragments.primitive)[tied] < 0).all()
    for sort in SORTS:
        assert_same_bits(draw(pipeline, scene, sort=sort, **options), default)


@EVERY
def test_every_sort_is_of_any_triangles(pipeline):
    triangles, colors = scenes.random_triangles(300, 0.7, seed=71)
    mesh, camera = ab.Mesh(triangles, colors=colors), ab.Camera(*scenes.front_camera())
    size = {"width": 40, "height": 40, "fragments": True}
    default = pipeline.render(mesh, camera, **size)
    assert default.counts.max() > 32
    for sort in SORTS:
        assert_same_bits(pipeline.render(mesh, camera, sort=sort, **size), default)


@pytest.mark.parametrize("pipeline", [GPU, GPU_PREFIX, GPU_TILES], ids=str)
def test_lists_of_about_so_many_parts_are_sorted_whole(pipeline):
    """A workgroup sorts 2,016 fragments, and merges join what is longer: column x has LENGTHS[x] of them."""
    lengths = np.array([65, 2015, 2016, 2017, 2048, 2049, 4032, 4033, 6100])
    count, width = lengths.max(), len(lengths)
    z = np.random.default_rng(5).permutation(count) / count
    z[4::5] = z[3::5]
    left = np.searchsorted(lengths, np.arange(count), side="right")  # of layer k: right of it lists are longer than k
    edge = [np.array([(x, -400, z[k]), (x, 400, z[k]), (x + 900, 1, z[k])]) for k, x in enumerate(left)]
    colors = np.random.default_rng(6).uniform(0, 1, (count, 4)) * (1, 1, 1, 1 / 1000)
    mesh = ab.Mesh(np.array(edge), colors=colors, color_mode="face")
    camera = ab.Camera.orthographic((width / 2, 0.5, 3), (width / 2, 0.5, 0), height=1)
    size = {"width": width, "height": 1}
    reference = CPU64.render(mesh, camera, fragments="count", **size)
    np.testing.assert_array_equal(reference.counts[0], lengths)
    bitonic, merge, auto = (pipeline.render(mesh, camera, sort=sort, **size) for sort in ("bitonic", "merge", "auto"))
    np.testing.assert_array_equal(bitonic.image, merge.image)
    np.testing.assert_array_equal(bitonic.image, auto.image)
    assert np.abs(bitonic.image - reference.image).max() < 2 * lengths.max() * U


def test_a_list_out_of_order_would_be_seen():
    default = draw(CPU32, stairs())
    other = draw(CPU32, stairs(seed=1))
    with pytest.raises(AssertionError):
        assert_same_bits(other, default)


@ON_GPU
@pytest.mark.parametrize("classes", [(1, 4, 8, 16, 32), (64,), (2,), (8, 32)], ids=str)
def test_any_resolve_classes_give_the_same_bits(pipeline, classes):
    scene = stairs()
    assert_same_bits(draw(pipeline, scene, resolve_classes=classes), draw(pipeline, scene))


@ON_GPU
@pytest.mark.parametrize("kind", KINDS)
def test_resolving_in_a_fragment_shader_gives_the_same_bits(pipeline, kind):
    options = dict(KINDS[kind])
    scene = stairs(modes=options.pop("modes", ("over",)))
    compute, fragment = (draw(pipeline, scene, resolve=resolve, **options) for resolve in ("compute", "fragment"))
    assert_same_bits(fragment, compute)


@ON_GPU
def test_an_empty_image_is_the_background_however_it_is_resolved(pipeline):
    aside = ab.Mesh(np.float32([[-9, 0, 0], [-8, 0, 0], [-9, 1, 0]]))
    for resolve in ("compute", "fragment"):
        frame = draw(pipeline, aside, resolve=resolve)
        np.testing.assert_array_equal(frame.image, np.broadcast_to(np.float32(BEHIND), (HEIGHT, WIDTH, 4)))


@EVERY
@pytest.mark.parametrize(
    "options",
    [
        {"sort": "quick"},
        {"max_sorted_fragments": 0},
        {"max_sorted_fragments": 2.5},
        {"limit_policy": "farthest", "max_sorted_fragments": 2},
    ],
    ids=str,
)
def test_options_that_say_nothing_are_refused(pipeline, options):
    with pytest.raises(ab.ParameterError, match=next(iter(options))):
        draw(pipeline, stairs(), **options)


@pytest.mark.parametrize("options", [{"resolve_classes": (8, 4)}, {"resolve_classes": ()}, {"resolve": "cpu"}], ids=str)
def test_resolve_options_that_say_nothing_are_refused(options, needs_gpu):
    with pytest.raises(ab.ParameterError, match=next(iter(options))):
        draw(GPU, stairs(), **options)


# ---- a limit ----


def truncated(frags, n, policy):
    """(F,) bool: the fragments that a limit of n a pixel keeps."""
    if policy == "nearest":
        return frags.layer < n
    newest_first = np.lexsort((-frags.primitive.astype(np.int64), frags.pixel))
    rank = np.empty(len(frags), np.int64)
    rank[newest_first] = frags.layer  # lists of one pixel are as long in either order
    return rank < n


def assert_image_is_what_is_left(frame, kept, precision):
    frags = frame.fragments
    behind = frags.background.reshape(-1, 4)
    modes = None if frags.blend is None else np.array(ab.BLENDS)[frags.blend]
    wanted = blend_lists(frags.offsets, frags.color, behind, modes, kept=kept).reshape(HEIGHT, WIDTH, 4)
    n = np.bincount(frags.pixel[kept], minlength=WIDTH * HEIGHT).reshape(HEIGHT, WIDTH, 1)
    unit = U if precision.precision == "float32" else 2 * 2.0**-53  # of both, in float64
    off = np.abs(frame.image - wanted) / (2 * (n + 1) * unit * wanted)  # the forward error of n-layer over
    assert off.max() <= 1, f"off by {off.max():.3g} bounds"


LIMITS = (1, 18, 40, 1000)


@EVERY
@pytest.mark.parametrize("policy", ["nearest", "last_submitted"])
def test_a_limit_keeps_what_its_policy_says_and_counts_the_rest(pipeline, policy):
    scene = stairs()
    whole = draw(pipeline, scene)
    assert whole.stats.dropped_fragments == 0
    for n in LIMITS:
        frame = draw(pipeline, scene, max_sorted_fragments=n, limit_policy=policy, **few_classes(pipeline))
        kept = truncated(frame.fragments, n, policy)
        assert_image_is_what_is_left(frame, kept, pipeline)
        assert frame.stats.dropped_fragments == (~kept).sum() == np.maximum(whole.counts - n, 0).sum()
        assert frame.stats.fragments == whole.stats.fragments
        for name in ("offsets", "key", "primitive", "color"):  # lists stay whole
            np.testing.assert_array_equal(getattr(frame.fragments, name), getattr(whole.fragments, name))


@pytest.mark.parametrize("policy", ["nearest", "last_submitted"])
def test_one_more_or_one_less_than_the_limit_would_be_seen(policy):
    frame = draw(CPU32, stairs(), max_sorted_fragments=18, limit_policy=policy)
    for n in (17, 19):
        with pytest.raises(AssertionError, match="off by"):
            assert_image_is_what_is_left(frame, truncated(frame.fragments, n, policy), CPU32)


@EVERY
@pytest.mark.parametrize("policy", ["nearest", "last_submitted"])
def test_a_limit_over_the_longest_list_changes_nothing(pipeline, policy):
    scene = stairs(seed=2)
    frame = draw(pipeline, scene, max_sorted_fragments=1000, limit_policy=policy, **few_classes(pipeline))
    assert_same_bits(frame, draw(pipeline, scene))
    assert frame.stats.dropped_fragments == 0


@EVERY
@pytest.mark.parametrize("fragments", [False, "count"])
def test_what_a_limit_drops_is_counted_without_lists_too(pipeline, fragments):
    scene = stairs(seed=3)
    frame = draw(pipeline, scene, max_sorted_fragments=18, fragments=fragments)
    assert frame.stats.dropped_fragments == 2 * np.maximum(np.arange(WIDTH) - 18, 0).sum()
    np.testing.assert_array_equal(frame.image, draw(pipeline, scene, max_sorted_fragments=18).image)


@EVERY
def test_every_sort_keeps_the_same_under_a_limit(pipeline):
    scene = stairs(seed=4)
    for policy in ("nearest", "last_submitted"):
        options = {"max_sorted_fragments": 18, "limit_policy": policy} | few_classes(pipeline)
        default = draw(pipeline, scene, **options)
        for sort in SORTS:
            assert_same_bits(draw(pipeline, scene, sort=sort, **options), default)


@EVERY
def test_the_nearest_do_not_depend_on_the_order_of_submission(pipeline):
    scene = stairs(seed=5, ties=False)
    first = draw(pipeline, scene, max_sorted_fragments=18)
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(LONGEST)
        again = draw(pipeline, permuted(scene, order), max_sorted_fragments=18)
        np.testing.assert_array_equal(again.image, first.image)
        np.testing.assert_array_equal(again.fragments.key, first.fragments.key)
        assert again.stats.dropped_fragments == first.stats.dropped_fragments


@EVERY
def test_the_last_submitted_do(pipeline):
    """What is wrong with it: the same scene looks otherwise, and what is in front of all may be missing."""
    white, black = (1, 1, 1, 0.5), (0, 0, 0, 0.5)
    everywhere = np.float32([[-400, -400, 0], [900, -400, 0], [0, 900, 0]])
    near = [ab.Mesh(everywhere + np.float32([0, 0, 1]), colors=white)]
    far = [ab.Mesh(everywhere - np.float32([0, 0, i / 8]), colors=black) for i in range(4)]
    images = {
        policy: [
            draw(
                pipeline,
                scene,
                max_sorted_fragments=4,
                limit_policy=policy,
                background=(0, 0, 0, 1),
                **few_classes(pipeline),
            ).image[0, 0, 0]
            for scene in (near + far, far + near)
        ]
        for policy in ("nearest", "last_submitted")
    }
    assert images == {"nearest": [0.5, 0.5], "last_submitted": [0.0, 0.5]}


@EVERY
def test_a_limit_counts_the_fragments_of_a_pixel_not_of_a_sample(pipeline):
    """Two halves of a pixel in front of a third fragment: of two that are kept none is the third."""
    x = 3.5
    halves = [np.array([[(x, -400, 1), (x, 400, 1), (x + side, 1, 1)]]) for side in (-900, 900)]
    behind = np.array([[(-400, -400, 0), (900, -400, 0), (0, 900, 0)]])
    scene = [ab.Mesh(np.concatenate(halves), colors=(1, 0, 0, 0.5)), ab.Mesh(behind, colors=(0, 1, 0, 0.5))]
    frame = draw(pipeline, scene, samples=4, max_sorted_fragments=2, background=(0, 0, 0, 0))
    assert frame.stats.dropped_fragments == HEIGHT
    np.testing.assert_array_equal(frame.image[0, 3], [0.5, 0, 0, 0.5])
    np.testing.assert_array_equal(frame.image[0, 5], [0.5, 0.25, 0, 0.75])


def crossing():
    """Triangles of any size, many cut by the eye's plane: with samples, pieces that share a pixel are one fragment."""
    triangles, colors = scenes.random_triangles(60, 1.5, seed=72)
    return ab.Mesh(triangles, colors=colors)


def assert_limit_holds_with_samples(pipeline, policy, **options):
    options |= {"width": 32, "height": 32, "fragments": True, "samples": 4, "background": BEHIND}
    unit = U if pipeline.precision == "float32" else 2 * 2.0**-53
    for n in (2, 5):
        frame = pipeline.render(
            crossing(), ab.Camera(*scenes.front_camera()), max_sorted_fragments=n, limit_policy=policy, **options
        )
        frags = frame.fragments
        assert frags.counts.max() > 8
        kept = truncated(frags, n, policy)
        behind = frags.background.reshape(32 * 32, -1, 4)[:, 0]
        masks = [kept & (frags.coverage >> np.uint32(s) & 1 == 1) for s in range(4)]
        wanted = np.mean([blend_lists(frags.offsets, frags.color, behind, kept=mask) for mask in masks], axis=0)
        # n layers in each sample, and the sum of four.
        off = np.abs(frame.image.reshape(-1, 4) - wanted) / ((2 * (n + 1) + 4) * unit * wanted)
        assert off.max() <= 1, f"off by {off.max():.3g} bounds"
        assert frame.stats.dropped_fragments == (~kept).sum()


@EVERY
@pytest.mark.parametrize("policy", ["nearest", "last_submitted"])
def test_a_limit_with_samples_composites_what_is_left_in_each(pipeline, policy):
    assert_limit_holds_with_samples(pipeline, policy, **few_classes(pipeline))


@ON_GPU
@pytest.mark.parametrize("policy", ["nearest", "last_submitted"])
@pytest.mark.parametrize(
    "options", [{"resolve": "fragment", "resolve_classes": (16,)}, {"resolve_classes": (2,)}], ids=str
)
def test_a_limit_with_samples_is_the_same_in_any_shader_and_class(pipeline, options, policy):
    assert_limit_holds_with_samples(pipeline, policy, **options)
