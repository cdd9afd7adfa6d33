"""The comparison with the oracle bites: each way of being wrong fails it."""

import dataclasses

import numpy as np
import pytest

import abuffer as ab
import oracle
import scenes
from comparison import CPU32, CPU64, EDGE, assert_frame_matches

TRIANGLES, COLORS = scenes.random_triangles(120, 0.6, seed=31)
CAMERA = oracle.OracleCamera(*scenes.front_camera())
HITS = oracle.trace(TRIANGLES, COLORS, CAMERA, 48, 48)
EDGES = oracle.edge_distance(TRIANGLES, CAMERA, 48, 48)
PRECISIONS = pytest.mark.parametrize("precision", [CPU32, CPU64], ids=str)


def rendered(precision, triangles=TRIANGLES, colors=COLORS):
    camera = ab.Camera(*scenes.front_camera())
    return precision.render(ab.Mesh(triangles, colors=colors), camera, width=48, height=48, fragments=True)


def deep_pixel(frame):
    """A pixel off all edges and near ties with at least three fragments, and where its list starts."""
    clear = (EDGES >= 4 * EDGE) & ~oracle.near_tie_pixels(HITS, 1e-4) & (frame.fragments.counts >= 3)
    pixel = int(np.flatnonzero(clear.ravel())[0])
    return divmod(pixel, 48), int(frame.fragments.offsets[pixel])


def relisted(frame, **arrays):
    """The frame with other arrays in its lists, unchecked."""
    frags = frame.fragments
    parts = {f: getattr(frags, f) for f in ("offsets", "depth", "key", "color", "primitive")} | arrays
    return dataclasses.replace(frame, fragments=ab.Fragments._of(frags.shape, parts, frags.background))


@PRECISIONS
def test_the_unchanged_frame_passes(precision):
    assert_frame_matches(rendered(precision), HITS, EDGES, precision)


@PRECISIONS
def test_one_pixel_a_little_off_fails(precision):
    frame = rendered(precision)
    (y, x), _ = deep_pixel(frame)
    image = frame.image.copy()
    image[y, x, 1] += 1e-3
    with pytest.raises(AssertionError, match=rf"pixel \[{y}, {x}\] channel 1"):
        assert_frame_matches(dataclasses.replace(frame, image=image), HITS, EDGES, precision)


@PRECISIONS
def test_two_layers_swapped_fail(precision):
    frame = rendered(precision)
    _, first = deep_pixel(frame)
    primitive = frame.fragments.primitive.copy()
    primitive[[first, first + 1]] = primitive[[first + 1, first]]
    with pytest.raises(AssertionError, match="primitives, front to back"):
        assert_frame_matches(relisted(frame, primitive=primitive), HITS, EDGES, precision)


@PRECISIONS
def test_a_lost_fragment_fails(precision):
    frame = rendered(precision)
    (y, x), first = deep_pixel(frame)
    offsets = frame.fragments.offsets.copy()
    offsets[48 * y + x + 1 :] -= 1
    kept = np.delete(np.arange(len(frame.fragments)), first)
    arrays = {f: getattr(frame.fragments, f)[kept] for f in ("depth", "key", "color", "primitive")}
    with pytest.raises(AssertionError, match="counts outside the edge band"):
        assert_frame_matches(relisted(frame, offsets=offsets, **arrays), HITS, EDGES, precision)


@PRECISIONS
def test_a_depth_a_little_off_fails(precision):
    frame = rendered(precision)
    _, first = deep_pixel(frame)
    depth = frame.fragments.depth.copy()
    depth[first] *= 1 + 1e-3
    with pytest.raises(AssertionError, match="depth is off by"):
        assert_frame_matches(relisted(frame, depth=depth), HITS, EDGES, precision)


@PRECISIONS
def test_a_colour_a_thousandth_off_fails(precision):
    colors = COLORS.copy()
    colors[..., 0] *= 1 - 1e-3
    with pytest.raises(AssertionError, match="channel 0 is off by"):
        assert_frame_matches(rendered(precision, colors=colors), HITS, EDGES, precision)


@PRECISIONS
def test_geometry_a_tenth_of_a_pixel_off_fails(precision):
    pixel = 2 * 3 * np.tan(np.radians(22.5)) / 48  # at the scene's middle
    with pytest.raises(AssertionError, match=r"counts outside the edge band|is off by"):
        assert_frame_matches(rendered(precision, TRIANGLES + (pixel / 10, 0, 0)), HITS, EDGES, precision)


@PRECISIONS
def test_an_image_that_is_not_finite_fails(precision):
    frame = rendered(precision)
    image = frame.image.copy()
    image[0, 0] = np.nan
    with pytest.raises(AssertionError):
        assert_frame_matches(dataclasses.replace(frame, image=image), HITS, EDGES, precision)
