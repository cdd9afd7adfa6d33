"""In which order fragments are submitted: no bit of what is sorted depends on it, sums round otherwise, and ties go by it."""

import numpy as np
import pytest

import abuffer as ab
import methods
from abuffer._methods import METHODS
from comparison import CPU32, CPU64, GPU, GPU_PREFIX, GPU_TILES
from sheets import CAMERA as STRAIGHT
from sheets import everywhere, unit

CAMERA = ab.Camera.look_at((0, 0, 4), (0, 0, 0))
SIZE = {"width": 8, "height": 6}
BEHIND = (0.25, 0.5, 0.125, 0.5)
N = 12
SORTED = ["exact", "depth_peeling", "dual_depth_peeling", "k_buffer", "bucket_peeling", "triangle_sorted"]
# Which fragment is drawn goes by the number of its primitive, and so by the order; objects are one here.
OTHERWISE = ["stochastic", "object_sorted"]
IN_THAT_ORDER = ["unsorted", "mlab", "adaptive", "stencil_routed"]
SUMS = [id for id in METHODS if "order_free" in METHODS[id].flags and id not in SORTED]


def test_every_method_is_one_of_those():
    assert sorted([*SORTED, *SUMS, *IN_THAT_ORDER, *OTHERWISE]) == sorted(METHODS)


def planes():
    """Over the whole view, and through each other: lists of N, that are sorted otherwise from pixel to pixel."""
    rng = np.random.default_rng(6)
    corners = np.tile([[-4.0, -4, 0], [12, -4, 0], [-4, 12, 0]], (N, 1, 1))
    corners[..., 2] = rng.uniform(-2, 1, (N, 1)) + rng.uniform(-1, 1, (N, 3))
    return corners.astype(np.float32), rng.uniform(0.05, 1, (N, 4)).astype(np.float32)


def shuffled(id, pipeline, times=100):
    corners, colors = planes()
    look = {**SIZE, "method": id, "background": BEHIND}
    for seed in range(times):
        order = np.random.default_rng(seed).permutation(N)
        yield pipeline.render(ab.Mesh(corners[order], colors=colors[order]), CAMERA, **look).image


@pytest.mark.parametrize(("id", "pipeline"), everywhere(SORTED), ids=str)
def test_a_hundred_shuffles_change_no_bit_of_what_is_sorted(id, pipeline):
    images = shuffled(id, pipeline)
    first = next(images)
    for image in images:
        np.testing.assert_array_equal(image, first)


@pytest.mark.parametrize(("id", "pipeline"), everywhere(SUMS), ids=str)
def test_shuffles_change_sums_by_roundings_alone(id, pipeline):
    """Two orders, each a quotient of sums of n products, times a coverage of n factors; F of shading sums to some Σ α."""
    images = np.stack(list(shuffled(id, pipeline, 25)))
    bound = 2 * (4 * N + 5) * unit(pipeline) * max(1, planes()[1][:, 3].sum())
    if id == "mboit":  # roundings of moments over the bias of λ
        bound = methods.tolerance(id) * unit(pipeline) / methods.U
    assert np.ptp(images, axis=0).max() <= bound


@pytest.mark.parametrize(("id", "pipeline"), everywhere(IN_THAT_ORDER), ids=str)
def test_shuffles_change_what_composites_in_their_order_by_far_more(id, pipeline):
    images = np.stack(list(shuffled(id, pipeline, 5)))
    assert np.ptp(images, axis=0).max() > 0.01


# ---- ties ----


def both_orders():
    """Two quads at one depth, twice: on the left red comes first, on the right green does."""
    red, green = (1, 0, 0, 0.5), (0, 1, 0, 0.25)
    corners = np.float32([[-2, -2, -1], [0, -2, -1], [0, 2, -1], [-2, 2, -1]])
    faces = [[0, 1, 2], [0, 2, 3]]
    return [
        ab.Mesh(corners + np.float32([x, 0, 0]), faces, color)
        for x, color in ((0, red), (0, green), (2, green), (2, red))
    ]


LATER_IN_FRONT = np.float32([[[0.375, 0.25, 0, 0.625], [0.5, 0.125, 0, 0.625]]])


@pytest.mark.parametrize(
    ("pipeline", "times"), [(CPU32, 1000), (CPU64, 100), (GPU, 1000), (GPU_PREFIX, 100), (GPU_TILES, 100)], ids=str
)
def test_of_a_quad_drawn_twice_the_later_is_in_front_every_time(pipeline, times):
    renderer = ab.Renderer(pipeline.device)
    scene = renderer.upload(both_orders())
    look = {"width": 2, "height": 1, "pipeline": pipeline.pipeline, "precision": pipeline.precision}
    for _ in range(times):
        np.testing.assert_array_equal(renderer.render(scene, STRAIGHT, **look).image, LATER_IN_FRONT)


@pytest.mark.parametrize(
    ("id", "pipeline"), everywhere([id for id in (*SORTED, *IN_THAT_ORDER) if id != "exact"]), ids=str
)
def test_all_that_composites_takes_the_later_for_the_nearer(id, pipeline):
    """Painters too. Buckets of one depth keep one fragment alone."""
    image = pipeline.render(both_orders(), STRAIGHT, width=2, height=1, method=id).image
    if id == "bucket_peeling":
        np.testing.assert_array_equal(image, np.float32([[[0, 0.25, 0, 0.25], [0.5, 0, 0, 0.5]]]))
    else:
        np.testing.assert_array_equal(image, LATER_IN_FRONT)
