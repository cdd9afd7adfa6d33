"""Peelings are `exact`, ties included; unsorted blending is where fragments come back to front, and off by a known
amount where not."""

import re

import numpy as np
import pytest

import abuffer as ab
import methods
import scenes
from abuffer import UnsupportedError

U64 = 2.0**-53
FRONT = ab.Camera(*scenes.front_camera())
PEELINGS = ["depth_peeling", "dual_depth_peeling"]
BEHIND = (0.2, 0.6, 0.4, 0.5)


def tied_stacks(n, seed=0):
    """Random lists of which about half tie with another."""
    depths, colors, order = methods.random_stacks(n, seed=seed)
    return np.ceil(depths * n / 10), colors, order


@pytest.mark.parametrize("stacks", [methods.random_stacks, tied_stacks], ids=["apart", "tied"])
@pytest.mark.parametrize("method", PEELINGS)
def test_peelings_are_exact(method, stacks):
    """But for the order of roundings: front to back γ_{2n+2} C, from both ends γ_{3n+2} C at most."""
    for n in (1, 2, 3, 4, 5, 12, 40):
        frags = methods.lists_of(*stacks(n), background=BEHIND)
        np.testing.assert_allclose(frags.composite(method), frags.composite(), rtol=(5 * n + 4) * U64, atol=0)


@pytest.mark.parametrize("method", PEELINGS)
def test_a_swapped_pair_would_not_pass_for_exact(method):
    depths, colors, order = methods.random_stacks(12)
    wanted = methods.lists_of(depths, colors, order).composite()
    depths[:, [3, 7]] = depths[:, [7, 3]]
    got = methods.lists_of(depths, colors, order).composite(method)
    assert np.abs(got - wanted).max() > 1e-2


def peeled_by_depth(depths, colors):
    """Everitt's peeling of one pixel, which compares depths alone; over black."""
    rgba, transmittance, last = np.zeros(4), 1.0, -np.inf
    while (depths > last).any():
        last = depths[depths > last].min()
        color = colors[np.flatnonzero(depths == last)[0]]  # whichever the depth test lets through
        rgba += transmittance * color[3] * np.append(color[:3], 1)
        transmittance *= 1 - color[3]
    return rgba


def pair(colors):
    """The same triangle twice, in front of another."""
    triangle = scenes.covering(0.0)[0]
    meshes = [ab.Mesh(triangle, colors=color) for color in colors]
    return [*meshes, ab.Mesh(scenes.covering(-0.5)[0], colors=(0, 0, 1, 0.5))]


@pytest.mark.parametrize("device", ["cpu", "gpu"])
@pytest.mark.parametrize("method", PEELINGS)
def test_a_triangle_that_is_drawn_twice_is_peeled_twice(method, device, needs_gpu):
    """The later in front, where depth alone would lose one."""
    red, green = (1, 0, 0, 0.5), (0, 1, 0, 0.25)
    for colors, wanted in (((red, green), (0.375, 0.25, 0.1875, 0.8125)), ((green, red), (0.5, 0.125, 0.1875, 0.8125))):
        frame = ab.render(
            pair(colors), FRONT, width=4, height=4, method=method, device=device, pipeline="tiles", fragments=True
        )
        np.testing.assert_array_equal(frame.image, np.broadcast_to(np.float32(wanted), (4, 4, 4)))
        assert frame.stats.dropped_fragments == 0
        here = frame.fragments[0, 0]
        lossy = peeled_by_depth(here.depth.astype(float), here.color.astype(float))
        assert np.abs(lossy - wanted).max() > 0.05


def test_peeling_by_depth_alone_is_exact_without_ties():
    """So that what it loses above is the tie."""
    depths, colors, order = methods.random_stacks(9)
    wanted = methods.lists_of(depths, colors, order).composite()[0]
    got = [peeled_by_depth(*stack) for stack in zip(depths, colors, strict=True)]
    np.testing.assert_allclose(got, wanted, rtol=(5 * 9 + 4) * U64)


def front_to_back(depths, values):
    return np.take_along_axis(values, np.argsort(depths, axis=1)[..., None], axis=1)


@pytest.mark.parametrize("layers", [1, 2, 5])
def test_layers_behind_a_limit_are_dropped_within_their_bound(layers):
    """|ΔC| ≤ T_{P+1} R: what P layers let through of the range of all colours. Nearly reached, never exceeded."""
    worst = 0.0
    for n in (layers + 1, 8, 16):
        depths, colors, order = methods.random_stacks(n, pixels=1500, seed=7)
        colors[::2] = np.where(np.arange(4) < 3, colors[::2].round(), colors[::2])  # the extremes of the range
        colors[::3, :, 3] **= 0.25
        frags = methods.lists_of(depths, colors, order, background=(0.0, 1.0, 0.5))
        off = np.abs(frags.composite("depth_peeling", layers=layers) - frags.composite())[0, :, :3]
        let_through = np.prod(1 - front_to_back(depths, colors)[:, :layers, 3], axis=1)
        behind = np.broadcast_to([0.0, 1.0, 0.5], (len(colors), 1, 3))
        range_of = np.ptp(np.concatenate([colors[..., :3], behind], axis=1), axis=1)
        bound = let_through[:, None] * range_of
        assert (off <= bound + 100 * U64).all()
        above = bound > 1e-3
        worst = max(worst, (off[above] / bound[above]).max())
        if layers < n - 1:
            # One layer more lets less through, and would not bound it.
            tighter = np.prod(1 - front_to_back(depths, colors)[:, : layers + 1, 3], axis=1)[:, None] * range_of
            assert (off > tighter + 1e-3).any()
    assert worst > 0.95


@pytest.mark.parametrize("layers", [1, 3, 12, 1024])
def test_a_limit_of_layers_composites_the_nearest(layers):
    frags = methods.lists_of(*tied_stacks(12), background=BEHIND)
    nearest = frags.to_padded(k=layers)
    kept = {"depth": nearest.depth, "color": nearest.color, "primitive": nearest.primitive}
    wanted = ab.Fragments.from_padded(**kept, background=BEHIND).composite()
    got = frags.composite("depth_peeling", layers=layers)
    np.testing.assert_allclose(got, wanted, rtol=(4 * 12 + 4) * U64)


@pytest.mark.parametrize("device", ["cpu", "gpu"])
@pytest.mark.parametrize("samples", [1, 4])
def test_dropped_fragments_are_counted(device, samples, needs_gpu):
    same = ab.Mesh(np.repeat(scenes.covering()[0], 7, axis=0), colors=(1, 0, 0, 0.2))
    options = {"method": "depth_peeling", "device": device, "pipeline": "tiles", "samples": samples}
    for layers, dropped in ((0, 0), (2, 5), (7, 0), (9, 0)):
        frame = ab.render(same, FRONT, width=4, height=4, layers=layers, **options)
        assert (frame.stats.dropped_fragments, frame.stats.merged_fragments) == (dropped * 16, 0)
        np.testing.assert_allclose(frame.image[..., 3], 1 - 0.8 ** (7 - dropped), rtol=20 * methods.U)


@pytest.mark.parametrize("method", PEELINGS)
def test_more_passes_than_a_software_driver_has_turns_for_are_refused(method, needs_gpu):
    """Mesa's llvmpipe would end the loops, and leave layers out in silence."""
    if not any(row["kind"] == "software" for row in ab.devices().values()):
        pytest.skip("there is no software driver")
    adapter = next(name for name, row in ab.devices().items() if row["kind"] == "software")
    deep = ab.Mesh(np.repeat(scenes.covering()[0], 100, axis=0), colors=(1, 0, 0, 0.01))
    given = {"width": 4, "height": 4, "device": adapter, "pipeline": "tiles"}
    with pytest.raises(UnsupportedError, match=r"takes up to .* in a tile of 100 triangles") as raised:
        ab.render(deep, FRONT, **given, method=method)
    # What it says instead is as many layers as there are turns for.
    [layers] = map(int, re.findall(r'method="depth_peeling", layers=(\d+)', str(raised.value)))
    image = ab.render(deep, FRONT, **given, method="depth_peeling", layers=layers).image
    np.testing.assert_allclose(image[..., 3], 1 - 0.99**layers, rtol=400 * methods.U)
    with pytest.raises(UnsupportedError):
        ab.render(deep, FRONT, **given, method="depth_peeling", layers=layers + 1)
    image = ab.render(deep, FRONT, width=4, height=4, method=method, device="cpu").image
    np.testing.assert_allclose(image[..., 3], 1 - 0.99**100, rtol=400 * methods.U)


def test_unsorted_is_exact_where_fragments_come_back_to_front():
    depths, colors, _ = methods.random_stacks(12)
    from_behind = np.argsort(np.argsort(-depths, axis=1), axis=1)
    frags = methods.lists_of(depths, colors, from_behind, background=BEHIND)
    np.testing.assert_allclose(frags.composite("unsorted"), frags.composite(), rtol=(5 * 12 + 4) * U64)
    reversed_ = methods.lists_of(depths, colors, 11 - from_behind, background=BEHIND)
    assert np.abs(reversed_.composite("unsorted") - frags.composite()).max() > 0.1


def test_one_adjacent_swap_is_off_by_the_swap_identity():
    """ΔC = T_a α_a α_b (c_a − c_b), a in front of b."""
    n, at = 9, 3
    depths, colors, _ = methods.random_stacks(n)
    colors = front_to_back(depths, colors)
    depths = np.sort(depths, axis=1)
    order = np.broadcast_to(np.arange(n)[::-1], depths.shape).copy()
    order[:, [at, at + 1]] = order[:, [at + 1, at]]
    frags = methods.lists_of(depths, colors, order, background=BEHIND)
    a, b = colors[:, at], colors[:, at + 1]
    let_through = np.prod(1 - colors[:, :at, 3], axis=1)
    wanted = (let_through * a[:, 3] * b[:, 3])[:, None] * (a - b)[:, :3]
    off = (frags.composite() - frags.composite("unsorted"))[0]
    # A difference of two sums below 1, each within γ_{3n+2}.
    np.testing.assert_allclose(off[:, :3], wanted, atol=2 * (3 * n + 2) * U64)
    np.testing.assert_allclose(off[:, 3], 0, atol=2 * (3 * n + 2) * U64)
    assert np.abs(wanted).max() > 0.1


def test_unsorted_takes_coincident_fragments_as_exact_does():
    """Of equal depths the later is in front: as if painted last."""
    depths, colors, order = methods.random_stacks(6)
    frags = methods.lists_of(np.ones_like(depths), colors, order, background=BEHIND)
    np.testing.assert_allclose(frags.composite("unsorted"), frags.composite(), rtol=(5 * 6 + 4) * U64)
