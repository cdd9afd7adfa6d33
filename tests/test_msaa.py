"""Several samples a pixel: masks, what opaque surfaces hide of them, and how samples become an image."""

import dataclasses
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import abuffer as ab
import oracle
import oracle_msaa
import scenes
from comparison import CPU32, CPU64, EDGE, GPU, GPU_PREFIX, GPU_TILES, U, gradient_of_image
from oracle_msaa import PATTERNS, popcount, positions

PIPELINES = [CPU32, CPU64, GPU, GPU_PREFIX, GPU_TILES]
EVERY = pytest.mark.parametrize("pipeline", PIPELINES, ids=str)
ON_CPU = pytest.mark.parametrize("pipeline", [CPU32, CPU64], ids=str)
FRONT = ab.Camera(*scenes.front_camera())
RESOLVES = ("per_pixel", "per_sample", "hdr", "none")
SIZE = 8  # of the images whose pixels are world units: the lower left corner is the origin, and depth is 3 - z
PIXELS = ab.Camera.orthographic((SIZE / 2, SIZE / 2, 3), (SIZE / 2, SIZE / 2, 0), height=SIZE)


@cache
def sample_counts(precision):
    """The counts over 1 that a pipeline takes on this device."""
    found = []
    for samples in PATTERNS:
        try:
            precision.render(ab.Mesh(scenes.covering()[0]), FRONT, width=1, height=1, samples=samples)
        except ab.UnsupportedError:
            continue
        found.append(samples)
    assert found[0] == 1
    return found[1:]


def at(*corners, z=0.0):
    """A triangle with corners in pixels, y down, of the camera PIXELS."""
    return np.array([[(x, SIZE - y, z) for x, y in corners]], np.float64)


def left_of(x, z=0.0):
    return at((x, -24), (x, 40), (-60, 4), z=z)


def right_of(x, z=0.0):
    return at((x, -24), (x, 40), (60, 4), z=z)


def glass(triangles, color=(1, 1, 1, 0.5), **kw):
    return ab.Mesh(triangles, colors=color, **kw)


def bits(inside):
    """The mask of the samples for which `inside` is true."""
    return sum(1 << s for s in np.flatnonzero(inside))


def full(samples):
    return (1 << samples) - 1


def draw(pipeline, scene, **kw):
    return pipeline.render(scene, PIXELS, width=SIZE, height=SIZE, **kw)


# ---- against the reference ----


def assert_msaa_frame_matches(frame, hits, edges, precision, background=(0, 0, 0, 0)):
    """Asserts masks, lists and image of a frame against `trace_msaa`, as comparison.assert_frame_matches does.

    `edges`: of each pixel's centre and samples the least distance to a projected edge; pixels nearer than EDGE are left out.
    """
    double = precision.precision == "float64"
    inside = edges >= EDGE
    assert inside.mean() > 0.3, "the edge band must not swallow the test"
    frags = frame.fragments
    assert frags.samples == hits.samples
    near = oracle.near_tie_pixels(hits, precision.depth_relative)
    assert near[inside].mean() <= 0.01, f"{near[inside].mean():.2%} of the pixels have near ties"
    decided = inside & ~near
    np.testing.assert_array_equal(frags.counts[decided], hits.counts[decided], "counts outside the edge band")

    ours, theirs = (np.flatnonzero(decided.ravel()[lists.pixel]) for lists in (frags, hits))
    np.testing.assert_array_equal(frags.primitive[ours], hits.primitive[theirs], "primitives, front to back")
    np.testing.assert_array_equal(frags.coverage[ours], hits.coverage[theirs], "masks")
    height, width = frags.shape
    shift = 0 if double else 4 * U * max(width, height)  # what float32 vertices move by, in pixels
    depth, gradient = hits.depth[theirs], hits.depth_gradient[theirs]
    relative = 1e-9 if double else precision.depth_relative
    bound = relative * (np.abs(depth) + double * gradient) + shift * gradient
    off = np.abs(frags.depth[ours] - depth) / bound
    assert (off <= 1).all(), f"depth is off by {off.max():.3g} times its bound"
    color, gradient = hits.color[theirs], hits.gradient[theirs]
    # A flat colour is exact once rounded to float32. Else a vertex may move along x and along y, and the plane's own two
    # products and sums round beside its divisions. 1e-9 is float64's share of it all.
    ulps = 2 * precision.interpolation_ulps * U
    bound = (1e-9 * (1 + gradient)) if double else U * color + 2 * shift * gradient + ulps * color * (gradient > 0)
    off = np.abs(frags.color[ours] - color) / np.maximum(bound, 1e-300)
    assert (off <= 1).all(), f"a list's colour is off by {off.max():.3g} times its bound"

    if double:
        image_bound = 1e-9 * (1 + gradient_of_image(hits))
    else:
        options = {"background": background, "interpolation_ulps": precision.interpolation_ulps}
        image_bound = oracle_msaa.colour_bound(hits, width, height, **options)
    low, high = oracle_msaa.hull(hits, background, precision.depth_relative)
    assert np.isfinite(frame.image).all()
    outside = np.maximum(low - frame.image, frame.image - high)
    ratio = np.where(inside[..., None], outside / np.maximum(image_bound, 1e-300), 0)
    worst = np.unravel_index(np.argmax(ratio), ratio.shape)
    assert ratio.max() <= 1, f"pixel [{worst[0]}, {worst[1]}] channel {worst[2]} is off by {ratio.max():.3g} bounds"
    partial = frags.coverage[ours] != full(hits.samples)
    return {
        "pixels compared": float(inside.mean()),
        "partly covered": int(partial.sum()),
        "near ties": float(near[inside].mean()),
        "worst pixel, in bounds": float(ratio.max()),
    }


def perspective(aspect, near=None, far=None):
    return (*scenes.front_camera(aspect, near, far), near, far)


def orthographic(aspect):
    return (*scenes.orthographic(scenes.EYE, (0, 0, 0), height=2.2, aspect=aspect), None, None)


# name: triangles and colours, width, height, camera, every how many triangles one is opaque
SCENES = {
    "random": (scenes.random_triangles(24, 0.6, seed=41), 64, 48, perspective(4 / 3), None),
    "random_flat": (scenes.random_triangles(24, 0.5, seed=42, flat=True), 48, 48, perspective(1), None),
    "opaque": (scenes.random_triangles(24, 0.6, seed=43, flat=True), 64, 64, perspective(1), 5),
    "opaque_orthographic": (scenes.random_triangles(24, 0.6, seed=44, flat=True), 48, 48, orthographic(1), 4),
    "orthographic": (scenes.random_triangles(24, 0.6, seed=45), 48, 64, orthographic(48 / 64), None),
    "spheres": (scenes.nested_icospheres(2, 1), 96, 96, perspective(1), None),
    "cyclic_three": (scenes.cyclic_three(), 48, 48, perspective(1), None),
    "near_crossing": (scenes.near_crossing(), 64, 48, perspective(4 / 3), None),
    "near_far": (scenes.near_crossing(), 64, 48, perspective(4 / 3, 0.5, 3.1), None),
    "near_far_opaque": (
        (scenes.near_crossing()[0], scenes.random_triangles(5, seed=55, flat=True)[1]),
        96,
        72,
        perspective(4 / 3, 0.5, 3.1),
        5,
    ),
    "duplicates": (scenes.duplicates(6), 48, 48, perspective(1), None),
}


def opaque_of(name):
    (triangles, _), *_, every = SCENES[name]
    return np.arange(len(triangles)) % every == 1 if every else np.zeros(len(triangles), bool)


@cache
def truth(name, samples):
    (triangles, colors), width, height, camera, _ = SCENES[name]
    camera = oracle.OracleCamera(*camera)
    hits = oracle_msaa.trace_msaa(triangles, colors, camera, width, height, samples, opaque=opaque_of(name))
    return hits, oracle_msaa.edge_distance(triangles, camera, width, height, samples)


def meshes(triangles, colors, opaque=None):
    """A mesh a run of triangles that are all opaque or all not, so that primitives count as the triangles do."""
    if opaque is None:
        return [ab.Mesh(triangles, colors=colors)]
    cuts = [0, *(np.flatnonzero(np.diff(opaque)) + 1), len(triangles)]
    return [
        ab.Mesh(triangles[a:b], colors=colors[a:b], color_mode="corner", opaque=bool(opaque[a]))
        for a, b in pairwise(cuts)
    ]


BEHIND = (0.2, 0.4, 0.1, 1.0)


def rendered(precision, name, samples, **kw):
    (triangles, colors), width, height, camera, _ = SCENES[name]
    view, projection, near, far = camera
    if near is None:
        camera = ab.Camera(view, projection)
    else:
        camera = ab.Camera.look_at(scenes.EYE, (0, 0, 0), near=near, far=far)
    options = {"width": width, "height": height, "samples": samples, "background": BEHIND, "fragments": True}
    return precision.render(meshes(triangles, colors, opaque_of(name)), camera, **(options | kw))


@EVERY
@pytest.mark.parametrize("name", SCENES)
def test_masks_lists_and_image_match_the_reference(name, pipeline):
    for samples in sample_counts(pipeline):
        hits, edges = truth(name, samples)
        measured = assert_msaa_frame_matches(rendered(pipeline, name, samples), hits, edges, pipeline, BEHIND)
        print(f"{samples} samples:", ", ".join(f"{key} {value:.3g}" for key, value in measured.items()))
        assert measured["partly covered"] > 30


@EVERY
def test_flat_colours_at_separate_depths_are_the_mean_of_one_plain_reference_a_sample(pipeline):
    """No rule about where colour and depth are taken is needed to say what this image is."""
    triangles, colors = scenes.random_triangles(30, 0.6, seed=46, flat=True)
    triangles[..., 2] = (np.arange(30) / 32 - 0.5)[:, None]  # parallel to the image, steps of 1 % of the depth
    opaque, camera, size = np.arange(30) % 8 == 3, oracle.OracleCamera(*scenes.front_camera()), 48
    for samples in sample_counts(pipeline):
        plain = [
            oracle_msaa.per_sample_hits(triangles, colors, camera, size, size, offset, opaque=opaque)
            for offset in positions(samples)
        ]
        wanted = np.mean([oracle.composite(hits, BEHIND) for hits in plain], axis=0)
        n = np.max([hits.counts for hits in plain], axis=0)[..., None]
        inside = oracle_msaa.edge_distance(triangles, camera, size, size, samples) >= EDGE
        assert inside.mean() > 0.5
        image = pipeline.render(
            meshes(triangles, colors, opaque), FRONT, width=size, height=size, samples=samples, background=BEHIND
        ).image
        # n layers and a background, then S samples summed: all terms are positive, so errors are relative.
        bound = (2 * (n + 1) + samples) * U * wanted
        assert (np.abs(image - wanted) <= bound)[inside].all()


# Each way of being wrong fails the comparison.


@cache
def checked(precision):
    """A frame with lists that passes, and what it is compared with."""
    hits, edges = truth("random", 4)
    frame = rendered(precision, "random", 4)
    assert_msaa_frame_matches(frame, hits, edges, precision, BEHIND)
    return frame, hits, edges


def relisted(frame, **arrays):
    """The frame with other arrays in its lists, unchecked."""
    frags = frame.fragments
    changed = object.__new__(ab.Fragments)
    changed.__dict__.update(frags.__dict__)
    changed.__dict__.update(arrays)
    return dataclasses.replace(frame, fragments=changed)


def partly_covered(precision):
    """A fragment with a partial mask in a pixel that is compared and whose order is decided."""
    frame, hits, edges = checked(precision)
    clear = ((edges >= 2 * EDGE) & ~oracle.near_tie_pixels(hits, 1e-4)).ravel()
    return int(np.flatnonzero(clear[frame.fragments.pixel] & (frame.fragments.coverage != 15))[0])


@ON_CPU
def test_a_flipped_bit_of_a_mask_fails(pipeline):
    frame, hits, edges = checked(pipeline)
    coverage = frame.fragments.coverage.copy()
    coverage[partly_covered(pipeline)] ^= 4
    with pytest.raises(AssertionError, match="masks"):
        assert_msaa_frame_matches(relisted(frame, coverage=coverage), hits, edges, pipeline, BEHIND)


@ON_CPU
def test_masks_with_two_samples_exchanged_fail(pipeline):
    frame, hits, edges = checked(pipeline)
    masks = frame.fragments.coverage
    swapped = (masks & ~np.uint32(3)) | ((masks & 1) << 1) | ((masks >> 1) & 1)
    with pytest.raises(AssertionError, match="masks"):
        assert_msaa_frame_matches(relisted(frame, coverage=swapped), hits, edges, pipeline, BEHIND)


@ON_CPU
def test_a_partly_covered_pixel_a_little_off_fails(pipeline):
    frame, hits, edges = checked(pipeline)
    y, x = divmod(int(frame.fragments.pixel[partly_covered(pipeline)]), frame.fragments.shape[1])
    image = frame.image.copy()
    image[y, x, 2] += 1e-3
    with pytest.raises(AssertionError, match=rf"pixel \[{y}, {x}\] channel 2"):
        assert_msaa_frame_matches(dataclasses.replace(frame, image=image), hits, edges, pipeline, BEHIND)


@ON_CPU
def test_colours_taken_a_sixteenth_of_a_pixel_aside_fail(pipeline):
    frame, hits, edges = checked(pipeline)
    color = frame.fragments.color.copy()
    color[partly_covered(pipeline)] += hits.gradient.max() / 16
    with pytest.raises(AssertionError, match="a list's colour is off"):
        assert_msaa_frame_matches(relisted(frame, color=color), hits, edges, pipeline, BEHIND)


@ON_CPU
def test_an_image_of_one_sample_fails(pipeline):
    frame, hits, edges = checked(pipeline)
    image = rendered(pipeline, "random", 1).image
    with pytest.raises(AssertionError, match="is off by"):
        assert_msaa_frame_matches(dataclasses.replace(frame, image=image), hits, edges, pipeline, BEHIND)


# ---- closed forms ----


def test_the_cpu_has_all_five_counts():
    assert sample_counts(CPU32) == sample_counts(CPU64) == [2, 4, 8, 16]


@pytest.mark.parametrize("pipeline", [GPU, GPU_PREFIX, GPU_TILES], ids=str)
def test_a_gpu_has_at_least_4_samples_and_names_what_it_has(pipeline):
    counts = sample_counts(pipeline)
    assert 4 in counts
    for samples in set(PATTERNS) - {1, *counts}:
        with pytest.raises(ab.UnsupportedError, match=rf"\b{samples}\b") as caught:
            draw(pipeline, glass(left_of(4)), samples=samples)
        assert all(str(count) in str(caught.value) for count in (1, *counts))


@EVERY
@pytest.mark.parametrize("samples", [0, -4, 3, 5, 32, 4.5, True, "4", None])
def test_counts_that_nothing_has_are_refused(pipeline, samples):
    with pytest.raises((ab.ParameterError, ab.UnsupportedError), match="samples"):
        draw(pipeline, glass(left_of(4)), samples=samples)


@EVERY
@pytest.mark.parametrize("x", [3.1, 3.33, 3.5, 3.77])
def test_an_edge_covers_the_samples_on_its_side(pipeline, x):
    for samples in sample_counts(pipeline):
        frame = draw(pipeline, glass(left_of(x)), samples=samples, fragments=True)
        inside = 3.5 + positions(samples)[:, 0] < x
        wanted = [full(samples)] * 3 + [bits(inside)] * int(inside.any())
        assert frame.fragments.coverage.tolist() == wanted * SIZE
        np.testing.assert_array_equal(frame.image[:, 3, 3], 0.5 * inside.mean())  # powers of two: exact


@EVERY
def test_two_triangles_that_share_an_edge_give_exactly_one_layer(pipeline):
    """Along a diagonal through pixel centres and along x = 3.5, at alphas whose multiples are exact."""
    square = at((0, 0), (SIZE, 0), (0, SIZE)), at((SIZE, 0), (SIZE, SIZE), (0, SIZE))
    for samples in sample_counts(pipeline):
        for pair in (square, (left_of(3.5), right_of(3.5))):
            for alpha in (0.25, 0.5, 0.75, 1.0):
                frame = draw(pipeline, glass(np.concatenate(pair), (1, 1, 1, alpha)), samples=samples, fragments=True)
                assert (frame.image[..., 3] == alpha).all()
                assert (frame.fragments.counts == 2).any()


@EVERY
def test_alpha_times_the_covered_share_would_show_the_seam(pipeline):
    """What the last test would see of the wrong resolve: p (1 - p) alpha² too little, a quarter of alpha² at a half."""
    pair = np.concatenate([at((0, 0), (SIZE, 0), (0, SIZE)), at((SIZE, 0), (SIZE, SIZE), (0, SIZE))])
    for samples in sample_counts(pipeline):
        for alpha in (0.5, 1.0):
            frags = draw(pipeline, glass(pair, (1, 1, 1, alpha)), samples=samples, fragments=True).fragments
            share = popcount(frags.coverage) / samples
            through = np.ones(SIZE * SIZE)
            np.multiply.at(through, frags.pixel, 1 - alpha * share)
            seam = (frags.counts == 2).ravel()
            p = share[frags.offsets[:-1][seam]]
            np.testing.assert_allclose(alpha - (1 - through[seam]), alpha**2 * p * (1 - p), rtol=1e-12)
            np.testing.assert_allclose(1 - through[~seam], alpha, rtol=1e-12)
            assert np.abs(1 - through - alpha).max() > 0.2 * alpha**2


@EVERY
def test_colour_and_depth_are_taken_at_the_centre_or_else_at_the_lowest_covered_sample(pipeline):
    """A slope left or right of an edge, red and depth linear in x."""
    # The triangle spans 60 px in x: its values are off by 4 u of that at the most, and by their own roundings.
    tolerance = 1e-12 if pipeline is CPU64 else 60 * 4 * U
    for samples in sample_counts(pipeline):
        for x, corners in ((3.6, [(3.6, -24), (3.6, 40), (60, 8)]), (4.4, [(4.4, -24), (4.4, 40), (-60, 8)])):
            corners = np.array(corners, np.float64)
            triangle = np.array([[(x, SIZE - y, x / 64) for x, y in corners]])  # depth is 3 - x / 64
            colors = np.zeros((1, 3, 4))
            colors[0, :, 0], colors[0, :, 3] = 1 + corners[:, 0] / 64, 0.5
            frags = draw(pipeline, ab.Mesh(triangle, colors=colors), samples=samples, fragments=True).fragments
            column = frags.pixel % SIZE
            assert len(set(column)) == 5  # one of them without its centre
            edge = 3 if x == 3.6 else 4
            across = positions(samples)[:, 0] + edge + 0.5
            covered = across > x if x == 3.6 else across < x
            assert set(frags.coverage[column == edge]) == {bits(covered)}
            where = np.where(column == edge, across[np.argmax(covered)], column + 0.5)
            np.testing.assert_allclose(frags.color[:, 0], 1 + where / 64, atol=tolerance)
            np.testing.assert_allclose(frags.depth, 3 - where / 64, atol=tolerance)


@EVERY
def test_what_covers_no_sample_is_no_fragment_and_what_covers_one_is(pipeline):
    """Small triangles around the centre, which is no sample, and around sample 1 of a pixel."""
    for samples in sample_counts(pipeline):
        dx, dy = positions(samples)[1] + 3.5
        speck = np.array([(-0.03, -0.03), (0.03, -0.03), (0.0, 0.04)])
        frame = draw(pipeline, glass(at(*(speck + 3.5))), samples=samples, fragments=True)
        assert len(frame.fragments) == frame.stats.fragments == 0
        assert (frame.image == 0).all()
        frags = draw(pipeline, glass(at(*(speck + (dx, dy)))), samples=samples, fragments=True).fragments
        assert frags.coverage.tolist() == [2]
        assert frags.pixel.tolist() == [3 * SIZE + 3]


@EVERY
def test_a_fully_covered_pixel_is_what_one_sample_gives(pipeline):
    triangles, colors = scenes.layers(12, 0.3)
    size = {"width": 16, "height": 16, "background": BEHIND}
    one = pipeline.render(ab.Mesh(triangles, colors=colors), FRONT, **size).image
    for samples in sample_counts(pipeline):
        several = pipeline.render(ab.Mesh(triangles, colors=colors), FRONT, samples=samples, **size).image
        # S equal numbers: their sum and its division round S times at most.
        np.testing.assert_allclose(several, one, rtol=samples * (U if pipeline is not CPU64 else 2**-53))


@EVERY
def test_one_sample_has_no_masks(pipeline):
    triangles, colors = scenes.random_triangles(40, 0.6, seed=47)
    plain = pipeline.render(ab.Mesh(triangles, colors=colors), FRONT, width=32, height=32, fragments=True)
    assert plain.fragments.coverage is None
    assert plain.fragments.samples == 1
    assert plain.fragments.background.shape == (32, 32, 4)
    for resolve in ("per_pixel", "per_sample"):
        frame = pipeline.render(
            ab.Mesh(triangles, colors=colors), FRONT, width=32, height=32, samples=1, msaa_resolve=resolve
        )
        np.testing.assert_array_equal(frame.image, plain.image)


# ---- opaque surfaces ----


@EVERY
def test_an_opaque_edge_hides_the_samples_behind_it_and_none_in_front(pipeline):
    near, far = glass(left_of(20, z=1), (1, 0, 0, 0.5)), glass(left_of(20, z=-1), (0, 1, 0, 0.5))
    wall = glass(left_of(3.4), (0, 0, 1), opaque=True)
    for samples in sample_counts(pipeline):
        frame = draw(pipeline, [near, far, wall], samples=samples, fragments=True)
        frags, hidden = frame.fragments, positions(samples)[:, 0] < -0.1
        assert (frags.counts == [1, 1, 1, 2, 2, 2, 2, 2]).all()
        assert frags[4, 3].primitive.tolist() == [0, 1]
        assert frags.coverage[frags.offsets[3] : frags.offsets[4]].tolist() == [full(samples), bits(~hidden)]
        assert frags.background.shape == (SIZE, SIZE, samples, 4)
        wanted = np.where(hidden[:, None], [0, 0, 1, 1], [0, 0, 0, 0])
        np.testing.assert_array_equal(frags.background[4, 3], wanted)
        h = hidden.mean()
        wanted = [0.5, 0.25 * (1 - h), 0.5 * h, 0.75 + 0.25 * h]
        np.testing.assert_allclose(frame.image[4, 3], wanted, rtol=samples * U)  # sums of exact terms


@EVERY
def test_a_pane_that_cuts_an_opaque_wall_is_kept_at_the_samples_in_front_of_it(pipeline):
    """The pane is 1/8 nearer a pixel to the right, and as far as the wall at x = 3.4."""
    corners = [(-20, 20), (28, 20), (4, -40)]
    pane = np.array([[(x, y, (x - 3.4) / 8) for x, y in corners]])
    wall = glass(left_of(20), (0, 0, 1), opaque=True)
    for samples in sample_counts(pipeline):
        for scene in ([glass(pane), wall], [wall, glass(pane)]):
            frags = draw(pipeline, scene, samples=samples, fragments=True).fragments
            inside = positions(samples)[:, 0] > -0.1
            column = frags.pixel % SIZE
            assert column.min() == 3
            assert set(frags.coverage[column == 3]) == {bits(inside)}
            assert set(frags.coverage[column > 3]) == {full(samples)}
            assert len(frags) == 5 * SIZE


@EVERY
@pytest.mark.parametrize("translucent_first", [True, False])
@pytest.mark.parametrize("kind", ["flat", "same sloping face"])
def test_a_fragment_at_the_opaque_depth_is_kept_at_every_sample(pipeline, kind, translucent_first):
    wall = left_of(5.3) if kind == "flat" else np.array([[(-20, 20, 0.3), (5.3, -30, 0.7), (12, 30, -0.4)]])
    film = left_of(20) if kind == "flat" else wall
    scene = [glass(wall, (0, 0.5, 1), opaque=True), glass(film, (1, 0, 0, 0.5))]
    for samples in sample_counts(pipeline):
        alone = draw(pipeline, scene[1], samples=samples, fragments=True).fragments
        assert len(alone) > 30
        frags = draw(pipeline, scene[:: -1 if translucent_first else 1], samples=samples, fragments=True).fragments
        np.testing.assert_array_equal(frags.counts, alone.counts)
        np.testing.assert_array_equal(frags.coverage, alone.coverage)


@EVERY
def test_of_two_opaque_surfaces_at_one_depth_the_later_shows_at_every_sample(pipeline):
    scene = [glass(left_of(20), (1, 0, 0), opaque=True), glass(left_of(3.4), (0, 1, 0), opaque=True)]
    for samples in sample_counts(pipeline):
        share = (positions(samples)[:, 0] < -0.1).mean()
        image = draw(pipeline, scene, samples=samples).image
        np.testing.assert_array_equal(image[0, 3], [1 - share, share, 0, 1])
        np.testing.assert_array_equal(image[0, 2], [0, 1, 0, 1])


@EVERY
def test_an_opaque_colour_is_taken_where_a_fragments_is(pipeline):
    """Red is x / 64 on a wall right of x = 3.6, and the same all over a pixel."""
    tolerance = 1e-12 if pipeline is CPU64 else 60 * 4 * U  # as for translucent slopes
    corners = np.array([(3.6, -24), (3.6, 40), (60, 8)], np.float64)
    colors = np.zeros((1, 3, 4))
    colors[0, :, 0], colors[0, :, 3] = 1 + corners[:, 0] / 64, 1
    wall = ab.Mesh(at(*corners), colors=colors, opaque=True)
    for samples in sample_counts(pipeline):
        scene = [wall, glass(left_of(20, z=-1))]
        behind = draw(pipeline, scene, samples=samples, fragments=True).fragments.background
        across = positions(samples)[:, 0] + 3.5
        covered = across > 3.6
        np.testing.assert_allclose(behind[2, 3, covered, 0], 1 + across[np.argmax(covered)] / 64, atol=tolerance)
        assert (behind[2, 3, ~covered] == 0).all()
        np.testing.assert_allclose(behind[2, 5, :, 0], np.full(samples, 1 + 5.5 / 64), atol=tolerance)


@EVERY
def test_alpha_cutoff_is_decided_once_for_a_pixel_and_opens_all_its_samples(pipeline):
    corners = np.array([(-20, -20), (28, -20), (4, 40)], np.float64)
    colors = np.ones((1, 3, 4))
    colors[0, :, 3] = (corners[:, 0] + 20) / 48  # alpha is (x + 20) / 48
    cutoff = 23.35 / 48  # at x = 3.35: pixel 3 has its centre on the kept side, and samples on both
    leaf = ab.Mesh(at(*corners), colors=colors, opaque=True, alpha_cutoff=cutoff)
    behind = glass(left_of(20, z=-1), (0, 1, 0, 0.5))
    for samples in sample_counts(pipeline):
        frame = draw(pipeline, [leaf, behind], samples=samples, fragments=True)
        assert (frame.fragments.counts == [1, 1, 1, 0, 0, 0, 0, 0]).all()
        assert set(frame.fragments.coverage) == {full(samples)}
        np.testing.assert_array_equal(frame.image[:, 3:], 1)


@EVERY
def test_alpha_cutoff_matches_the_reference_on_any_triangle(pipeline):
    triangles, colors = scenes.random_triangles(30, 0.8, seed=48)
    cutoff = np.full(30, 0.5)
    camera, size = oracle.OracleCamera(*scenes.front_camera()), 48
    scene = ab.Mesh(triangles, colors=colors, color_mode="corner", opaque=True, alpha_cutoff=0.5)
    for samples in sample_counts(pipeline):
        hits = oracle_msaa.trace_msaa(
            triangles, colors, camera, size, size, samples, opaque=np.ones(30, bool), cutoff=cutoff
        )
        frame = pipeline.render(scene, FRONT, width=size, height=size, samples=samples)
        wanted = np.isfinite(hits.opaque_depths).mean(axis=2)
        inside = oracle_msaa.edge_distance(triangles, camera, size, size, samples) >= EDGE
        # Where alpha meets the cutoff within what rounding moves it, either is right: a curve, few pixels.
        off = np.abs(frame.image[..., 3] - wanted)[inside] > samples * U
        assert off.mean() <= 0.002
        assert 0.2 < wanted.mean() < 0.8


@EVERY
def test_fragments_all_lists_opaque_surfaces_with_their_masks_and_leaves_the_image(pipeline):
    scene = [
        glass(left_of(20, z=-1), (0, 1, 0, 0.5)),
        glass(left_of(3.4), (0, 0.5, 1), opaque=True),
        glass(right_of(2.6, z=1), (1, 0, 0, 0.5)),
    ]
    for samples in sample_counts(pipeline):
        every = draw(pipeline, scene, samples=samples, fragments="all")
        np.testing.assert_array_equal(every.image, draw(pipeline, scene, samples=samples).image)
        x = positions(samples)[:, 0]
        assert every.fragments[5, 3].primitive.tolist() == [2, 1, 0]
        pixel = every.fragments.offsets[3 : 3 + 2]
        assert every.fragments.coverage[slice(*pixel)].tolist() == [full(samples), bits(x < -0.1), full(samples)]
        n = 3
        wanted = every.fragments.composite()
        assert (np.abs(every.image - wanted) <= (2 * (n + 1) + samples) * U * wanted).all()


# ---- watertight ----


@EVERY
def test_masks_of_the_triangles_of_a_fan_are_disjoint_and_fill_each_pixel(pipeline):
    """Spokes through pixel centres, samples and between them, from one inner point to a border outside the image."""
    hub = (3.5, 4.0625)
    rim = np.array([(-9, -9), (3.5, -9), (20, -9), (20, 4.0625), (20, 20), (9, 20), (3.6875, 20), (-9, 20), (-9, 4)])
    fan = np.concatenate([at(hub, a, b) for a, b in zip(rim, np.roll(rim, -1, axis=0), strict=True)])
    for samples in sample_counts(pipeline):
        frame = draw(pipeline, glass(fan), samples=samples, fragments=True)
        frags = frame.fragments
        assert frags.counts.max() >= 2
        total, union = np.zeros(SIZE * SIZE, np.int64), np.zeros(SIZE * SIZE, np.uint32)
        np.add.at(total, frags.pixel, popcount(frags.coverage))
        np.bitwise_or.at(union, frags.pixel, frags.coverage)
        assert (union == full(samples)).all()
        assert (total == samples).all()
        np.testing.assert_array_equal(frame.image[..., 3], 0.5)


@settings(max_examples=300, derandomize=True, deadline=None)
@given(
    corners=st.lists(st.tuples(st.integers(-400, 500), st.integers(-400, 500)), min_size=4, max_size=4, unique=True),
    samples=st.sampled_from([2, 4, 8, 16]),
    double=st.booleans(),
)
def test_a_triangle_split_at_any_inner_point_keeps_its_masks(corners, samples, double):
    """Corners on sixteenths of a pixel, so that edges meet samples, up to 3 images away: some are clipped. The fourth point
    sets where the triangle of the others is split."""
    pipeline = CPU64 if double else CPU32
    a, b, c, d = (np.array(p) / 16 for p in corners)
    weights = np.abs(d) + 1
    inner = (a * weights[0] + b * weights[1] + c * 3) / (weights.sum() + 3)
    inner = np.round(inner * 16) / 16
    whole = draw(pipeline, glass(at(a, b, c)), samples=samples, fragments=True).fragments
    parts = draw(
        pipeline, glass(np.concatenate([at(a, b, inner), at(b, c, inner), at(c, a, inner)])), samples=samples,
        fragments=True,
    ).fragments  # fmt: skip
    (ux, uy), (vx, vy), (wx, wy) = b - a, c - a, inner - a
    turn = ux * vy - uy * vx
    u, v = (wx * vy - wy * vx, ux * wy - uy * wx) if turn > 0 else (wy * vx - wx * vy, uy * wx - ux * wy)
    assume(min(u, v, abs(turn) - u - v) >= 0)  # rounding to sixteenths puts the point outside some slivers
    union, total = np.zeros((2, SIZE * SIZE), np.uint32)
    np.bitwise_or.at(union, parts.pixel, parts.coverage)
    np.add.at(total, parts.pixel, popcount(parts.coverage).astype(np.uint32))
    wanted = np.zeros(SIZE * SIZE, np.uint32)
    wanted[whole.pixel] = whole.coverage
    np.testing.assert_array_equal(union, wanted)
    np.testing.assert_array_equal(total, popcount(wanted))


@EVERY
@pytest.mark.parametrize("near", [None, 0.5])
def test_pieces_of_a_clipped_triangle_are_one_fragment_of_a_pixel(pipeline, near):
    """One corner behind the eye, so that the rest is cut in two or more: their seams must not show in the lists."""
    ground = np.float64([[-9, -0.4, -4], [9, -0.4, -4], [0.1, -0.4, 7]])
    camera = ab.Camera.look_at((0, 0, 3), (0, 0, 0), near=near)
    for samples in sample_counts(pipeline):
        frame = pipeline.render(glass(ground), camera, width=48, height=48, samples=samples, fragments=True)
        assert frame.fragments.counts.max() == 1
        hits = oracle_msaa.trace_msaa(
            ground[None],
            np.ones((1, 3, 4)),
            oracle.OracleCamera(*scenes.front_camera(near=near), near),
            48,
            48,
            samples,
        )
        truth = oracle.OracleCamera(*scenes.front_camera(near=near), near)
        inside = oracle_msaa.edge_distance(ground[None], truth, 48, 48, samples) >= EDGE
        assert inside.mean() > 0.8
        np.testing.assert_array_equal(frame.fragments.counts[inside], hits.counts[inside])
        ours, theirs = (np.flatnonzero(inside.ravel()[lists.pixel]) for lists in (frame.fragments, hits))
        np.testing.assert_array_equal(frame.fragments.coverage[ours], hits.coverage[theirs])
        whole = inside & (hits.counts == 1)
        assert (frame.fragments.coverage[ours] == full(samples)).sum() > 300
        share = np.zeros(48 * 48)
        share[hits.pixel] = popcount(hits.coverage) / samples
        np.testing.assert_allclose(frame.image[whole][:, 3], 0.5 * share.reshape(48, 48)[whole], rtol=samples * U)


# ---- from samples to an image ----


def random_scene(n=60, seed=49):
    triangles, colors = scenes.random_triangles(n, 0.6, seed=seed)
    wall = ab.Mesh(scenes.random_triangles(6, 0.6, seed=seed + 1)[0], colors=(0.3, 0.4, 0.2), opaque=True)
    return [wall, ab.Mesh(triangles, colors=colors)]


WIDE = ab.Camera(*scenes.front_camera(40 / 32))
SHAPE = {"width": 40, "height": 32, "background": (0.1, 0.2, 0.3, 0.7)}


@EVERY
def test_per_sample_and_per_pixel_give_the_same_numbers(pipeline):
    for samples in sample_counts(pipeline):
        one, other = (
            pipeline.render(random_scene(), WIDE, samples=samples, msaa_resolve=resolve, fragments="count", **SHAPE)
            for resolve in ("per_pixel", "per_sample")
        )
        np.testing.assert_array_equal(one.counts, other.counts)
        if pipeline.device == "cpu":
            np.testing.assert_array_equal(one.image, other.image)
        else:  # two shaders: a compiler may fuse what it likes, so n roundings of a layer and S of the mean may differ
            bound = (2 * (one.counts[..., None] + 1) + samples) * U * one.image
            assert (np.abs(one.image - other.image) <= 2 * bound).all()


@EVERY
def test_none_returns_the_samples_whose_mean_is_the_image(pipeline):
    for samples in sample_counts(pipeline):
        frame, each = (
            pipeline.render(random_scene(), WIDE, samples=samples, msaa_resolve=resolve, fragments=True, **SHAPE)
            for resolve in ("per_pixel", "none")
        )
        assert each.image.shape == (32, 40, samples, 4)
        assert each.image.dtype == frame.image.dtype
        assert np.ptp(each.image, axis=2).max() > 0.1
        wanted = each.image.astype(np.float64).mean(axis=2)
        # Each sample has its own roundings in either shader, 2 (n + 1) of them; then S terms are summed.
        n = frame.fragments.counts[..., None]
        roundings = samples if pipeline.device == "cpu" else 4 * (n + 1) + samples
        assert (np.abs(frame.image - wanted) <= roundings * U * wanted).all()


@EVERY
def test_each_sample_is_the_composite_of_what_covers_it(pipeline):
    for samples in sample_counts(pipeline):
        each = pipeline.render(random_scene(), WIDE, samples=samples, msaa_resolve="none", fragments=True, **SHAPE)
        frags = each.fragments
        behind = np.broadcast_to(frags.background, (32, 40, samples, 4)).reshape(-1, samples, 4)
        for s in range(samples):
            covers = frags.coverage >> np.uint32(s) & 1 == 1
            wanted = oracle_msaa.blend_lists(frags.offsets, frags.color, behind[:, s], kept=covers)
            n = frags.counts.reshape(-1, 1)
            off = np.abs(each.image[:, :, s].reshape(-1, 4) - wanted)
            assert (off <= 2 * (n + 1) * U * wanted).all()


@EVERY
def test_hdr_weighs_each_sample_by_one_over_one_plus_its_largest_channel(pipeline):
    triangles, colors = scenes.random_triangles(40, 0.6, seed=50)
    colors[..., :3] *= 20
    size = {"width": 32, "height": 32, "background": (3.0, 0.1, 0.2, 1.0), "fragments": "count"}
    for samples in sample_counts(pipeline):
        options = {"samples": samples, **size}
        each = pipeline.render(ab.Mesh(triangles, colors=colors), FRONT, msaa_resolve="none", **options)
        frame = pipeline.render(ab.Mesh(triangles, colors=colors), FRONT, msaa_resolve="hdr", **options)
        values = each.image.astype(np.float64)
        weight = 1 / (1 + values[..., :3].max(axis=-1, keepdims=True))
        wanted = (weight * values).sum(axis=2) / weight.sum(axis=2)
        # Relative, for all is positive: a weight is a sum and a quotient (5 u on a GPU), products and sums of S terms above
        # and below, one more quotient; and the samples' own 2 (n + 1) on either side, which weights carry on once more.
        n = frame.counts[..., None]
        roundings = 2 * samples + 16 + (0 if pipeline.device == "cpu" else 8 * (n + 1))
        assert (np.abs(frame.image - wanted) <= roundings * U * wanted).all()
        plain = pipeline.render(ab.Mesh(triangles, colors=colors), FRONT, **options)
        assert (plain.image - frame.image).max() > 0.5  # bright samples count less


@EVERY
def test_lists_composite_to_the_image_for_every_resolve(pipeline):
    for samples in sample_counts(pipeline):
        for resolve in RESOLVES:
            frame = pipeline.render(
                random_scene(), WIDE, samples=samples, msaa_resolve=resolve, fragments=True, **SHAPE
            )
            wanted = frame.fragments.composite(msaa_resolve=resolve)
            assert wanted.shape == frame.image.shape
            assert wanted.dtype == np.float64
            # As in the tests of these resolves; hdr has twice the rest and 16 more.
            n = frame.fragments.counts[..., None]
            roundings = 2 * (n + 1) + samples
            roundings = {"none": (2 * (n + 1))[..., None], "hdr": 2 * roundings + 2 * (n + 1) + 16}.get(
                resolve, roundings
            )
            assert (np.abs(frame.image - wanted) <= roundings * U * wanted).all(), resolve


@EVERY
def test_an_image_background_is_behind_every_sample(pipeline):
    behind = np.random.default_rng(0).uniform(0, 1, (SIZE, SIZE, 4)).astype(np.float32)
    behind[..., 3] = 1
    for samples in sample_counts(pipeline):
        image = draw(pipeline, glass(left_of(3.4), (1, 0, 0, 0.5)), samples=samples, background=behind).image
        share = (positions(samples)[:, 0] < -0.1).mean()
        np.testing.assert_allclose(image[:, 5], behind[:, 5], rtol=samples * U)
        through = behind[:, 3].astype(np.float64) * (1 - share / 2)
        wanted = through + 0.5 * share * np.array([1, 0, 0, 1])
        np.testing.assert_allclose(image[:, 3], wanted, rtol=(4 + samples) * U)


@EVERY
def test_counts_of_masked_fragments_are_those_of_the_lists(pipeline):
    for samples in sample_counts(pipeline):
        options = {"samples": samples, **SHAPE}
        lists = pipeline.render(random_scene(), WIDE, fragments=True, **options)
        counted = pipeline.render(random_scene(), WIDE, fragments="count", **options)
        np.testing.assert_array_equal(counted.counts, lists.fragments.counts)
        np.testing.assert_array_equal(counted.image, lists.image)
        assert counted.stats.fragments == len(lists.fragments) == lists.counts.sum()
        assert (lists.fragments.coverage > 0).all()


@EVERY
def test_permuting_the_triangles_changes_no_mask_and_no_bit(pipeline):
    triangles, colors = scenes.random_triangles(60, 0.6, seed=51)
    for samples in sample_counts(pipeline):
        options = {"width": 40, "height": 40, "samples": samples, "fragments": True}
        first = pipeline.render(ab.Mesh(triangles, colors=colors), FRONT, **options)
        tied = (np.diff(first.fragments.pixel) == 0) & (np.diff(first.fragments.key.astype(np.int64)) == 0)
        assert not tied.any()
        for seed in range(2):
            order = np.random.default_rng(seed).permutation(60)
            again = pipeline.render(ab.Mesh(triangles[order], colors=colors[order]), FRONT, **options)
            np.testing.assert_array_equal(again.image, first.image)
            for name in ("offsets", "key", "coverage", "color"):
                np.testing.assert_array_equal(getattr(again.fragments, name), getattr(first.fragments, name))
            np.testing.assert_array_equal(order[again.fragments.primitive], first.fragments.primitive)


@EVERY
def test_the_exact_image_needs_no_lists(pipeline):
    """Asking for lists or counts beside an image changes no bit of it."""
    for samples in sample_counts(pipeline):
        images = [
            pipeline.render(random_scene(), WIDE, samples=samples, fragments=fragments, **SHAPE).image
            for fragments in (False, "count", True)
        ]
        np.testing.assert_array_equal(images[1], images[0])
        np.testing.assert_array_equal(images[2], images[0])


@EVERY
@pytest.mark.parametrize("resolve", ["per_pixel", "per_sample"])
def test_200_layers_with_samples_are_exact(pipeline, resolve):
    """Longer than any array that a pixel could be sorted in."""
    triangles, colors = scenes.layers(200, 0.02)
    hits = oracle.trace(triangles, colors, oracle.OracleCamera(*scenes.front_camera()), 4, 4)
    wanted = oracle.composite(hits, BEHIND)
    for samples in sample_counts(pipeline):
        frame = pipeline.render(
            ab.Mesh(triangles, colors=colors),
            FRONT,
            width=4,
            height=4,
            samples=samples,
            msaa_resolve=resolve,
            background=BEHIND,
            fragments=True,
        )
        assert (frame.fragments.counts == 200).all()
        assert (frame.fragments.primitive == hits.primitive).all()
        assert (np.abs(frame.image - wanted) <= (2 * 201 + samples) * U * wanted).all()
