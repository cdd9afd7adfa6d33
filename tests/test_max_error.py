"""`max_error`: what is chosen, that the choice is proven, and that the proof holds."""

import numpy as np
import pytest

import abuffer as ab
from abuffer import ParameterError
from comparison import CPU32, GPU, GPU_TILES

CAMERA = ab.Camera.look_at((0, 0, 4), (0, 0, 0))
SIZE = {"width": 16, "height": 12}


def random_scene(rng):
    """Up to 90 triangles, thin or dense, dark or HDR, perhaps before a wall."""
    n = rng.integers(0, 91) if rng.random() < 0.5 else rng.integers(0, 6)
    triangles = rng.uniform(-1.2, 1.2, (n, 1, 3)) + rng.uniform(-2.5, 2.5, (n, 3, 3))
    colors = rng.uniform(0, rng.choice([0.1, 1, 20]), (n, 4))
    colors[:, 3] = rng.uniform(0, 1, n) ** rng.integers(1, 4) * rng.choice([1e-3, 0.05, 0.3, 1])
    if rng.random() < 0.2:
        colors[:, :3] = colors[:1, :3]
    meshes = [ab.Mesh(triangles, colors=colors)] if n else []
    if rng.random() < 0.2:
        meshes.append(ab.Mesh([[[-3, -3, -1], [3, -3, -1], [0, 3, -1]]], colors=rng.uniform(0, 1, 3), opaque=True))
    return meshes, (*rng.uniform(0, 1, 3), rng.choice([0, 0.5, 1]))


def ratios(seeds, precision, samples=1):
    """Of random scenes: what was chosen, and the worst error of each in its pixel's bound."""
    chosen, worst = [], []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        scene, background = random_scene(rng)
        max_error = float(rng.choice([1e-4, 1 / 255, 0.02, 0.1]))
        asked = {"background": background, "samples": samples}
        frame = precision.render(scene, CAMERA, **SIZE, **asked, max_error=max_error)
        exact = precision.render(scene, CAMERA, **SIZE, **asked, fragments=True).fragments.composite()
        assert frame.error_bound.shape == frame.image.shape[:2]
        method = frame.plan["method"]
        assert method == "exact" or frame.error_bound.max() <= max_error
        assert frame.stats.error_bound == frame.error_bound.max()
        off = np.abs(frame.image - exact).max(axis=-1)
        assert (off <= frame.error_bound).all(), (seed, method, (off / frame.error_bound).max())
        chosen.append(method.split(",")[0])
        worst.append((off / frame.error_bound).max())
    return chosen, np.array(worst)


def test_no_error_is_over_its_bound_in_two_thousand_random_scenes():
    chosen, worst = ratios(range(2000), CPU32)
    share = {name: chosen.count(name) / len(chosen) for name in set(chosen)}
    assert min(share.get(name, 0) for name in ("wboit", "k_buffer", "exact")) > 0.02, share
    # And the bounds are no wild guesses: half of one would have been exceeded.
    assert worst.max() > 0.5


@pytest.mark.parametrize("precision", [GPU_TILES, GPU], ids=str)
def test_no_error_is_over_its_bound_on_a_gpu(precision):
    """Pipeline linked_list takes nodes of 8 bits, and tiles what the CPU takes."""
    chosen, _ = ratios(range(150), precision)
    assert set(chosen) == ({"wboit", "k_buffer", "exact"} if precision is GPU_TILES else {"exact"})


def test_samples_keep_their_bounds():
    ratios(range(60), CPU32, samples=4)


def stack(colors, depths=None):
    """Layers before the whole image."""
    colors = np.atleast_2d(colors)
    z = np.linspace(1, -1, len(colors)) if depths is None else depths
    triangles = np.array([[[-9, -9, 0], [9, -9, 0], [0, 18, 0]]] * len(colors), float)
    triangles[..., 2] = z[:, None]
    return ab.Mesh(triangles, colors=colors)


def chosen(scene, max_error, **kw):
    frame = ab.render(scene, CAMERA, **SIZE, device="cpu", max_error=max_error, **kw)
    return frame.plan["method"], next(why for what, _, why in frame.plan if what == "method")


def test_what_is_chosen_and_why():
    rng = np.random.default_rng(3)
    thick, thin = rng.uniform(0.5, 0.9, (40, 4)), rng.uniform(0, 1, (5, 4)) * (1, 1, 1, 1e-3)
    tiny = 1e-4
    assert chosen([], tiny) == ("wboit, weight='none'", "no fragment")
    assert chosen(stack((0.2, 0.5, 0.8, 0.5)), tiny) == ("wboit, weight='none'", "one layer at most")
    equal = thick.copy()
    equal[:, :3] = (0.2, 0.4, 0.6)
    assert chosen(stack(equal), tiny)[0] == "wboit, weight='none'"
    assert chosen(stack(thin), tiny) == ("wboit, weight='none'", "unsorted: R ((Σα)² − Σα²) / 2")
    name, why = chosen(stack(thick), 1 / 255)
    k = int(name.removeprefix("k_buffer, k=").split(",")[0])
    through = np.prod(1 - thick[:k, 3])
    assert through <= 1 / 255 < through / (1 - thick[k - 1, 3])  # the range is 1: that of alpha over nothing
    assert why == f"R T behind the {k} nearest"
    faint = thick * (1, 1, 1, 0.2)
    assert chosen(stack(faint), tiny) == ("exact", "no bound of another is as small")


def test_nodes_of_8_bits_are_taken_where_nodes_are_stored(needs_gpu):
    rng = np.random.default_rng(3)
    layers = stack(rng.uniform(0.3, 0.9, (6, 4)))
    arguments = {**SIZE, "device": "gpu", "pipeline": "linked_list", "max_error": 0.02}
    frame = ab.render(layers, CAMERA, **arguments)
    assert frame.plan["method"] == "exact, node_format='rgba8_depth32'"
    exact = ab.render(layers, CAMERA, **SIZE, device="cpu", precision="float64").image
    off = np.abs(frame.image - exact).max(axis=-1)
    assert (off <= frame.error_bound).all()
    assert off.max() > 0.02 * frame.error_bound.max()
    # Lists that are returned lose nothing, and what is brighter than 1 has no such format.
    assert ab.render(layers, CAMERA, **arguments, fragments=True).plan["method"] == "exact"
    bright = stack(rng.uniform(0.3, 0.9, (6, 4)) * (3, 3, 3, 1))
    assert ab.render(bright, CAMERA, **arguments).plan["method"] == "exact"


def test_the_bound_of_exact_is_what_roundings_come_to():
    layers = stack(np.random.default_rng(3).uniform(0.1, 0.3, (12, 4)))
    for precision, unit in (("float32", 2.0**-24), ("float64", 2.0**-53)):
        frame = ab.render(layers, CAMERA, **SIZE, device="cpu", precision=precision, max_error=0)
        np.testing.assert_array_equal(frame.error_bound, (4 * 12 + 16) * unit)
    assert ab.render(layers, CAMERA, **SIZE, device="cpu").error_bound is None


def test_lists_and_counts_come_beside_it():
    layers = stack(np.random.default_rng(3).uniform(0.5, 0.9, (12, 4)))
    frame = ab.render(layers, CAMERA, **SIZE, device="cpu", fragments=True, max_error=0.1)
    assert frame.plan["method"].startswith("k_buffer")
    assert (frame.counts == 12).all()
    assert frame.fragments.counts.sum() == 12 * 16 * 12


def test_a_renderer_takes_it_too():
    layers = stack(np.random.default_rng(3).uniform(0.5, 0.9, (12, 4)))
    renderer = ab.Renderer("cpu")
    uploaded = renderer.upload(layers)
    wanted = ab.render(layers, CAMERA, **SIZE, device="cpu", max_error=0.1)
    frames = [renderer.render(uploaded, CAMERA, **SIZE, max_error=0.1)]
    frames += renderer.render_many(uploaded, [CAMERA, CAMERA], **SIZE, max_error=0.1)
    for frame in frames:
        np.testing.assert_array_equal(frame.image, wanted.image)
        np.testing.assert_array_equal(frame.error_bound, wanted.error_bound)


@pytest.mark.parametrize(
    "arguments",
    [
        {"method": "wboit"},
        {"cutoff": 0.1},
        {"max_sorted_fragments": 4},
        {"fragments": "all"},
        {"msaa_resolve": "hdr", "samples": 4},
        {"max_error": -1},
        {"max_error": "small"},
    ],
    ids=str,
)
def test_what_leaves_no_choice_or_has_no_bound_is_refused(arguments):
    with pytest.raises(ParameterError, match="max_error"):
        ab.render(stack((1, 1, 1, 0.5)), CAMERA, **SIZE, device="cpu", **{"max_error": 0.1} | arguments)


def test_modes_have_no_bound():
    additive = ab.Mesh([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], colors=(1, 0, 0, 0.5), blend="additive")
    with pytest.raises(ParameterError, match="no bound is known for other modes"):
        ab.render(additive, CAMERA, **SIZE, device="cpu", max_error=0.1)


def test_colours_whose_sum_is_infinite_are_not_summed():
    bright = stack(np.tile([3e38, 3e38, 3e38, 0.9], (4, 1)))
    frame = ab.render(bright, CAMERA, **SIZE, device="cpu", max_error=1e36)
    assert np.isfinite(frame.image).all()
    assert not frame.plan["method"].startswith("wboit")
