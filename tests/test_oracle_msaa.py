"""The reference with samples against closed forms; nothing of the package is needed."""

import numpy as np
import pytest

import oracle
import scenes
from oracle import OracleCamera
from oracle_msaa import (
    PATTERNS,
    blend_lists,
    colour_bound,
    composite,
    composite_samples,
    edge_distance,
    hull,
    per_sample_hits,
    popcount,
    positions,
    trace_msaa,
)

ROUNDING = 1e-12  # float64 (1e-16) times the condition of these scenes' planes, with room
EVERY = pytest.mark.parametrize("samples", [2, 4, 8, 16])
SIZE = 8
# One world unit is one pixel, the image's lower left corner is the origin, and depth is 3 - z.
PIXELS = OracleCamera(*scenes.orthographic((SIZE / 2, SIZE / 2, 3), (SIZE / 2, SIZE / 2, 0), height=SIZE))


def front(aspect=1.0):
    return OracleCamera(*scenes.front_camera(aspect))


def at(*corners, z=0.0):
    """A triangle with corners in pixels, y down, at eye depth 3 - z."""
    return np.array([[(x, SIZE - y, z) for x, y in corners]], np.float64)


def left_of(x, z=0.0):
    """A triangle that covers the image where a pixel coordinate is less than x."""
    return at((x, -99), (x, 99), (-99, 0), z=z)


def flat(*colors):
    return np.repeat(np.array(colors, np.float64)[:, None], 3, axis=1)


GLASS = (1, 1, 1, 0.5)


@pytest.mark.parametrize("samples", [1, 2, 4, 8, 16])
def test_no_two_samples_lie_in_one_row_or_column(samples):
    offsets = np.array(PATTERNS[samples])
    assert offsets.shape == (samples, 2)
    assert all(len(set(offsets[:, axis])) == samples for axis in (0, 1))
    assert (np.abs(offsets) <= 8).all()


@pytest.mark.parametrize("samples", [2, 4, 8])
def test_patterns_are_centred(samples):
    """Where all are; the 16 are on the corners of a 16×16 grid of cells, half a cell up and left of it."""
    np.testing.assert_array_equal(positions(samples).mean(axis=0), 0)
    np.testing.assert_array_equal(positions(16).mean(axis=0), -1 / 32)


@pytest.mark.parametrize("scene", [scenes.random_triangles(60, 0.5, seed=1), scenes.near_crossing()])
def test_at_no_offset_the_hits_are_those_of_the_centres(scene):
    centre = oracle.trace(*scene, front(1.5), 30, 20)
    zero = per_sample_hits(*scene, front(1.5), 30, 20, (0, 0))
    for field in ("offsets", "depth", "primitive", "color"):
        np.testing.assert_array_equal(getattr(zero, field), getattr(centre, field))


@pytest.mark.parametrize("camera", [front(), PIXELS], ids=["perspective", "orthographic"])
def test_at_an_offset_of_pixels_the_hits_are_the_neighbours(camera):
    if camera is PIXELS:
        triangles, colors = at((1.3, 0.2), (7.1, 3.3), (2.2, 7.7)), flat(GLASS)
    else:
        triangles, colors = scenes.random_triangles(60, 0.5, seed=2)
    centre = oracle.trace(triangles, colors, camera, SIZE, SIZE)
    moved = per_sample_hits(triangles, colors, camera, SIZE, SIZE, (2, -1))  # two to the right, one up
    np.testing.assert_array_equal(moved.counts[1:, :-2], centre.counts[:-1, 2:])
    assert centre.counts.max() > 0
    wanted = oracle.composite(centre)[:-1, 2:]
    np.testing.assert_allclose(oracle.composite(moved)[1:, :-2], wanted, atol=ROUNDING)


def test_one_sample_is_the_plain_reference_with_opaque_surfaces_too():
    triangles, colors = scenes.random_triangles(80, 0.6, seed=3)
    opaque = np.arange(80) % 9 == 4
    plain = oracle.trace(triangles, colors, front(), 32, 32, opaque=opaque)
    one = trace_msaa(triangles, colors, front(), 32, 32, 1, opaque=opaque)
    for field in ("offsets", "depth", "primitive", "color", "gradient", "depth_gradient"):
        np.testing.assert_array_equal(getattr(one, field), getattr(plain, field))
    assert (one.coverage == 1).all()
    background = (0.2, 0.3, 0.4, 0.5)
    np.testing.assert_array_equal(composite(one, background), oracle.composite(plain, background))
    np.testing.assert_array_equal(one.opaque_depths[..., 0], plain.opaque_depth)


@EVERY
@pytest.mark.parametrize("x", [3.0, 3.1, 3.33, 3.5, 3.52, 3.77, 3.99])
def test_a_vertical_edge_covers_the_samples_left_of_it(samples, x):
    hits = trace_msaa(left_of(x), flat(GLASS), PIXELS, SIZE, SIZE, samples)
    inside = np.floor(x) + 0.5 + positions(samples)[:, 0] < x
    mask = sum(1 << s for s in np.flatnonzero(inside))
    full = (1 << samples) - 1
    wanted = [full] * 3 + [mask] * bool(mask)
    assert hits.coverage.tolist() == wanted * SIZE
    np.testing.assert_allclose(composite(hits)[:, 3, 3], 0.5 * inside.mean(), rtol=ROUNDING)


@EVERY
def test_a_horizontal_edge_covers_the_samples_above_it(samples):
    hits = trace_msaa(at((-99, 3.27), (99, 3.27), (4, -99)), flat(GLASS), PIXELS, SIZE, SIZE, samples)
    inside = 3.5 + positions(samples)[:, 1] < 3.27
    assert 0 < inside.sum() < samples
    row = hits.coverage[hits.pixel // SIZE == 3]
    assert row.tolist() == [sum(1 << s for s in np.flatnonzero(inside))] * SIZE


@EVERY
@pytest.mark.parametrize("seed", range(4))
def test_the_mean_of_the_masks_is_the_area(seed, samples):
    """Each sample position counts a lattice in a convex figure: off its area by at most half its height and width, and 1
    (rows: each is cut off by a rounding of at most 1 px at its two ends together, columns likewise)."""
    corners = np.random.default_rng(seed).uniform(0.2, SIZE - 0.2, (3, 2))
    hits = trace_msaa(at(*corners), flat(GLASS), PIXELS, SIZE, SIZE, samples)
    (ax, ay), (bx, by) = corners[1] - corners[0], corners[2] - corners[0]
    area = abs(ax * by - ay * bx) / 2
    estimate = popcount(hits.coverage).sum() / samples
    width, height = np.ptp(corners, axis=0)
    assert abs(estimate - area) <= (width + height) / 2 + 1
    # Not a bound: what stratified samples make of it. A pattern of one point alone is off by more.
    assert abs(estimate - area) <= 4 * (width + height) / samples


def test_colour_and_depth_are_taken_at_the_centre_or_else_at_the_lowest_covered_sample():
    """A slope right of x = 3.6: pixel 3 has its samples 1 and 3 of 4 inside, not its centre. Sample 1 is at x = 3.875."""
    corners = np.array([(3.6, -90), (3.6, 90), (60, 0)], np.float64)
    triangle = np.array([[(x, SIZE - y, x / 64) for x, y in corners]])  # depth is 3 - x / 64
    colors = np.zeros((1, 3, 4))
    colors[0, :, 0], colors[0, :, 3] = corners[:, 0] / 64, 0.5  # red is x / 64
    hits = trace_msaa(triangle, colors, PIXELS, SIZE, SIZE, 4)
    column = hits.pixel % SIZE
    assert set(hits.coverage[column == 3]) == {0b1010}
    x = np.where(column == 3, 3.5 + 6 / 16, column + 0.5)
    np.testing.assert_allclose(hits.color[:, 0], x / 64, atol=ROUNDING)
    np.testing.assert_allclose(hits.depth, 3 - x / 64, rtol=ROUNDING)


def test_a_triangle_that_covers_a_centre_but_no_sample_is_no_fragment():
    tiny = at((3.45, 3.45), (3.55, 3.45), (3.5, 3.58))
    assert len(oracle.trace(tiny, flat(GLASS), PIXELS, SIZE, SIZE).depth) == 1
    assert len(trace_msaa(tiny, flat(GLASS), PIXELS, SIZE, SIZE, 4).depth) == 0


@EVERY
def test_an_opaque_edge_hides_samples_behind_it_and_none_in_front(samples):
    near, far, wall = left_of(99, z=1.0), left_of(99, z=-1.0), left_of(3.4)
    triangles = np.concatenate([near, far, wall])
    colors = flat((1, 0, 0, 0.5), (0, 1, 0, 0.5), (0, 0, 1, 0.25))
    hits = trace_msaa(triangles, colors, PIXELS, SIZE, SIZE, samples, opaque=[False, False, True])
    hidden = positions(samples)[:, 0] < -0.1
    pixel = slice(hits.offsets[3], hits.offsets[4])
    full = (1 << samples) - 1
    mask = sum(1 << s for s in np.flatnonzero(~hidden))
    assert hits.primitive[pixel].tolist() == [0, 1]
    assert hits.coverage[pixel].tolist() == [full, mask]
    assert hits.counts[:, :3].max() == 1
    h = hidden.mean()
    np.testing.assert_allclose(composite(hits)[0, 3], [0.5, 0.25 * (1 - h), 0.5 * h, 0.75 + 0.25 * h], rtol=ROUNDING)


@EVERY
def test_a_pane_that_cuts_an_opaque_wall_is_kept_at_the_samples_in_front_of_it(samples):
    """The pane's depth is 3 at x = 3.4 and falls to the right; the wall is at 3."""
    pane = np.array([[(-90, -90, -93.4 / 8), (90, -90, 86.6 / 8), (0, 90, -3.4 / 8)]])
    wall = left_of(99)
    hits = trace_msaa(
        np.concatenate([pane, wall]), flat(GLASS, GLASS), PIXELS, SIZE, SIZE, samples, opaque=[False, True]
    )
    inside = positions(samples)[:, 0] > -0.1
    column = hits.pixel % SIZE
    assert set(hits.coverage[column == 3]) == {sum(1 << s for s in np.flatnonzero(inside))}
    assert column.min() == 3
    assert set(hits.coverage[column > 3]) == {(1 << samples) - 1}
    # An orthographic gap is relative to the greatest depth: that of the pane at the centre of column 0.
    gap = abs(4.5 + positions(samples)[0, 0] - 3.4) / 8 / (3 + 2.9 / 8)
    np.testing.assert_allclose(hits.opaque_gaps[0, 4, 0], gap, rtol=1e-5)


def test_what_lies_exactly_on_an_opaque_surface_is_kept_at_every_sample():
    wall = np.array([[(-90, -90, 0.1), (90, -80, 0.7), (0, 90, -0.4)]])
    hits = trace_msaa(np.concatenate([wall, wall]), flat(GLASS, GLASS), PIXELS, SIZE, SIZE, 8, opaque=[True, False])
    assert (hits.coverage == 255).all()
    assert len(hits.depth) == SIZE * SIZE
    assert np.isinf(hits.opaque_gaps).all()


def test_alpha_cutoff_is_decided_once_for_a_pixel():
    """Alpha is x / 8 at the pixel's centre, whose samples lie on both sides of the cut."""
    corners = np.array([(-90, -90), (90, -90), (0, 90)], np.float64)
    triangle = np.array([[(x, SIZE - y, 0) for x, y in corners]])
    colors = np.ones((1, 3, 4))
    colors[0, :, 3] = corners[:, 0] / 8
    hits = trace_msaa(triangle, colors, PIXELS, SIZE, SIZE, 4, opaque=[True], cutoff=[3.4 / 8])
    np.testing.assert_array_equal(np.isfinite(hits.opaque_depths), np.tile(np.arange(8)[:, None] >= 3, (8, 1, 4)))


@EVERY
def test_two_halves_of_a_pixel_cover_it_as_one_layer_does(samples):
    """Not what alpha scaled by the covered share does: which lets p (1 - p) alpha² more through, a quarter of it at most."""
    halves = np.concatenate([left_of(3.5), at((3.5, -99), (99, 0), (3.5, 99))])
    hits = trace_msaa(halves, flat(GLASS, GLASS), PIXELS, SIZE, SIZE, samples)
    np.testing.assert_allclose(composite(hits)[..., 3], 0.5, rtol=ROUNDING)
    pair = slice(hits.offsets[3], hits.offsets[4])
    first, second = hits.coverage[pair]
    assert first & second == 0
    assert first | second == (1 << samples) - 1
    share = popcount(first) / samples
    scaled = 1 - (1 - 0.5 * share) * (1 - 0.5 * (1 - share))
    np.testing.assert_allclose(0.5 - scaled, share * (1 - share) * 0.25, rtol=ROUNDING)


@EVERY
def test_flat_colours_at_separate_depths_are_the_mean_of_plain_references(samples):
    triangles, colors = scenes.random_triangles(40, 0.6, seed=5, flat=True)
    triangles[..., 2] = (np.arange(40) / 40)[:, None]  # parallel to the image: no two depths overlap
    opaque = np.arange(40) % 7 == 3
    hits = trace_msaa(triangles, colors, front(), 24, 24, samples, opaque=opaque)
    behind = (0.1, 0.2, 0.3, 1)
    plain = [
        oracle.composite(per_sample_hits(triangles, colors, front(), 24, 24, offset, opaque=opaque), behind)
        for offset in positions(samples)
    ]
    np.testing.assert_allclose(composite_samples(hits, behind), np.stack(plain, axis=2), atol=ROUNDING)
    np.testing.assert_allclose(composite(hits, behind), np.mean(plain, axis=0), atol=ROUNDING)


def test_sloping_triangles_differ_from_the_mean_of_plain_references():
    """Colour and order are decided once for a pixel, so this is no identity: the difference must show."""
    triangles, colors = scenes.random_triangles(40, 0.6, seed=6)
    hits = trace_msaa(triangles, colors, front(), 24, 24, 4)
    plain = [oracle.composite(per_sample_hits(triangles, colors, front(), 24, 24, o)) for o in positions(4)]
    assert np.abs(composite(hits) - np.mean(plain, axis=0)).max() > 1e-3


def test_the_edge_distance_is_that_of_the_nearest_sample():
    distance = edge_distance(left_of(3.6), PIXELS, SIZE, SIZE, 4)
    x = np.array([0, -2, 6, -6, 2]) / 16 + 0.5
    for column in range(SIZE):
        np.testing.assert_allclose(distance[:, column], min(1, np.abs(column + x - 3.6).min()), atol=ROUNDING)


def test_lists_are_sorted_and_gradients_are_those_of_the_fragments():
    triangles, colors = scenes.random_triangles(60, 0.6, seed=7)
    hits = trace_msaa(triangles, colors, front(), 32, 32, 8)
    within = np.diff(hits.pixel) == 0
    assert (np.diff(hits.depth)[within] >= 0).all()
    assert hits.gradient.shape == (len(hits.depth), 4)
    assert (hits.depth_gradient > 0).all()
    assert len(np.unique(hits.pixel * 60 + hits.primitive)) == len(hits.depth)


def test_bound_and_hull_are_those_of_the_plain_reference_for_one_sample():
    triangles, colors = scenes.random_triangles(60, 0.6, seed=8)
    plain, one = oracle.trace(triangles, colors, front(), 16, 16), trace_msaa(triangles, colors, front(), 16, 16, 1)
    rounding = oracle.U * oracle.composite(plain)
    np.testing.assert_allclose(
        colour_bound(one, 16, 16, interpolation_ulps=4),
        oracle.colour_bound(plain, 16, 16, interpolation_ulps=4) + rounding,
        rtol=1e-12,
    )
    for ours, theirs in zip(hull(one), oracle.hull(plain), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_lists_blend_back_to_front_mode_by_mode():
    """One pixel of two fragments over a grey, by hand, and one of none."""
    color = np.array([(0.5, 0.25, 1.0, 0.5), (0.2, 0.4, 0.6, 0.25)])  # front first
    behind = np.array([(0.8, 0.8, 0.8, 0.5), (0.6, 0.6, 0.6, 1.0)])
    offsets = np.array([0, 2, 2])
    over = blend_lists(offsets, color, behind)
    # 0.4 behind; then 0.3 + 0.25 c, then half of it and 0.5 c; alpha 0.5, 0.625, 0.8125
    np.testing.assert_allclose(over[0], (0.5 * 0.35 + 0.25, 0.5 * 0.4 + 0.125, 0.5 * 0.45 + 0.5, 0.8125), rtol=1e-15)
    np.testing.assert_allclose(over[1], (0.6, 0.6, 0.6, 1), rtol=1e-15)
    mixed = blend_lists(offsets, color, behind, np.array(["multiply", "additive"]))
    # 0.4 + 0.25 c, then times 0.5 + 0.5 c; alpha stays
    np.testing.assert_allclose(mixed[0], (0.45 * 0.75, 0.5 * 0.625, 0.55, 0.5), rtol=1e-15)
    mixed = blend_lists(offsets, color, behind, np.array(["premultiplied", "screen"]))
    # 1 - 0.6 (1 - 0.25 c), then half of it and c
    wanted = [0.5 * (1 - 0.6 * (1 - 0.25 * c)) + front for c, front in ((0.2, 0.5), (0.4, 0.25), (0.6, 1))]
    np.testing.assert_allclose(mixed[0], (*wanted, 0.75), rtol=1e-15)
    alone = blend_lists(offsets, color, behind, kept=np.array([False, True]))
    np.testing.assert_allclose(alone[0], (0.35, 0.4, 0.45, 0.625), rtol=1e-15)
