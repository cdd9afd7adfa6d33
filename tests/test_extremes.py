"""Numbers at the edge: large and small scenes, stray vertices, grounds under the eye, slivers in HDR, forked processes."""

import multiprocessing

import numpy as np
import pytest

import abuffer as ab
import scenes
from comparison import CPU32, CPU64, GPU, GPU_TILES
from sheets import everywhere

EVERY = pytest.mark.parametrize("pipeline", [CPU32, CPU64, GPU, GPU_TILES], ids=str)
FLOAT32 = pytest.mark.parametrize("pipeline", [CPU32, GPU, GPU_TILES], ids=str)


@FLOAT32
@pytest.mark.parametrize("far", [1e4, 1e6, 1e9])
@pytest.mark.parametrize("used", [False, True], ids=["unused", "used"])
def test_a_distant_vertex_costs_the_rest_no_precision(pipeline, far, used):
    triangles, colors = scenes.random_triangles(100, 0.5, seed=21)
    camera = ab.Camera(*scenes.front_camera())
    size = {"width": 64, "height": 64, "fragments": True}
    alone = pipeline.render(ab.Mesh(triangles, colors=colors), camera, **size)
    # Behind the eye, so that it covers nothing.
    stray = np.array([[far, 0, far], [far, 1, far], [far + 1, 0, far]])
    positions = np.concatenate([triangles.reshape(-1, 3), stray])
    faces = np.arange(len(positions)).reshape(-1, 3)[: None if used else -1]
    colors = np.concatenate([colors, colors[:1]])[: len(faces)]
    with_stray = pipeline.render(ab.Mesh(positions, faces, colors), camera, **size)
    np.testing.assert_array_equal(with_stray.image, alone.image)
    np.testing.assert_array_equal(with_stray.fragments.key, alone.fragments.key)


@FLOAT32
@pytest.mark.parametrize("size", [1e3, 1e4])
def test_a_ground_that_passes_under_the_eye_has_the_depth_of_its_plane(pipeline, size):
    ground = np.float32([[-size, 0, -size], [size, 0, -size], [size, 0, size], [-size, 0, size]])
    mesh = ab.Mesh(ground, [[0, 1, 2], [0, 2, 3]], (1, 1, 1, 0.5))
    camera = ab.Camera.look_at((0.1, 1.7, 0.2), (0, 1, -10), fov_y=60)
    shape = {"width": 160, "height": 90, "fragments": True}
    truth = CPU64.render(mesh, camera, **shape).fragments
    frags = pipeline.render(mesh, camera, **shape).fragments
    np.testing.assert_array_equal(frags.offsets, truth.offsets)
    # 1/w is the height over the ground divided by a sum of terms of `size`: it keeps 2^-24 of size over height.
    np.testing.assert_allclose(frags.depth, truth.depth, rtol=4 * 2.0**-24 * size / 1.7)


@EVERY
@pytest.mark.parametrize("depth", [41.0, 47.0, 49.0, 94.0, 1e3, 1 / 3])
@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_what_lies_exactly_at_far_is_kept(pipeline, depth, kind):
    depth = float(np.float32(depth))
    if kind == "perspective":
        camera = ab.Camera.look_at((0, 0, 0), (0, 0, -1), far=depth)
    else:
        camera = ab.Camera.orthographic((0, 0, 0), (0, 0, -1), height=depth, far=depth)
    wall = np.float32([[-9, -9, -1], [27, -9, -1], [-9, 27, -1]]) * np.float32(depth)
    assert (pipeline.render(ab.Mesh(wall), camera, width=4, height=4, fragments="count").counts == 1).all()
    beyond = np.nextafter(wall, 2 * wall) * np.float32(1.001)
    assert (pipeline.render(ab.Mesh(beyond), camera, width=4, height=4, fragments="count").counts == 0).all()


# Of depths from a near of 1e-6 to 1e6, pairs that are 2⁻²⁰ of their depth apart.
NEAR = 1e-6
PAIRS = np.sort(np.outer([1, 1 + 2.0**-20], np.geomspace(1.5 * NEAR, 1e6, 20)).ravel())
IN_PAIRS = np.c_[np.random.default_rng(25).uniform(0, 1, (40, 3)), np.full(40, 0.08)].astype(np.float32)


def over(colors):
    color, through = np.zeros(4), 1.0
    for *rgb, alpha in colors.astype(float):
        color += through * alpha * np.array([*rgb, 1])
        through *= 1 - alpha
    return color


@pytest.mark.parametrize(("method", "pipeline"), everywhere(["exact", "depth_peeling", "dual_depth_peeling"]), ids=str)
def test_layers_keep_their_order_over_twelve_orders_of_magnitude(method, pipeline):
    order = np.random.default_rng(26).permutation(40)
    corners = np.array([[-9, -9, -1], [27, -9, -1], [-9, 27, -1]]) * PAIRS[order, None, None]
    camera = ab.Camera.look_at((0, 0, 0), (0, 0, -1), near=NEAR)
    frame = pipeline.render(
        ab.Mesh(corners, colors=IN_PAIRS[order]), camera, width=2, height=1, method=method, fragments=True
    )
    wanted = over(IN_PAIRS)
    np.testing.assert_allclose(frame.image, np.broadcast_to(wanted, (1, 2, 4)), rtol=(3 * 40 + 2) * 2.0**-24)
    for pixel in (frame.fragments[0, 0], frame.fragments[0, 1]):
        np.testing.assert_array_equal(order[pixel.primitive], np.arange(40))
        # 1/w and its interpolation round some times.
        np.testing.assert_allclose(pixel.depth, PAIRS, rtol=4 * 2.0**-24)


def test_standard_z_would_tie_all_but_the_nearest_of_them_and_reversed_z_none():
    """z = 1 − n/d in float32: all beyond n 2²⁵ are at 1. Ties go by submission, here the nearest first, so that the
    farthest is in front."""
    depths, near = PAIRS.astype(np.float32), np.float32(NEAR)
    standard, reversed_ = 1 - near / depths, near / depths
    assert standard.dtype == np.float32
    np.testing.assert_array_equal(standard == 1, depths > NEAR * 2**25)
    assert (PAIRS > NEAR * 2**25).sum() > 10
    assert (np.diff(reversed_) < 0).all()
    drawn = np.lexsort((-np.arange(40), standard))
    assert (drawn != np.arange(40)).any()
    off = np.abs(over(IN_PAIRS[drawn]) - over(IN_PAIRS))
    assert off[:3].max() > 0.01 > 1e-12 > off[3]  # alpha does not depend on the order
    np.testing.assert_array_equal(np.argsort(-reversed_, kind="stable"), np.arange(40))


@EVERY
@pytest.mark.parametrize("scale", [1e-15, 1e-9, 1e9, 1e15])
def test_a_scene_of_any_scale_gives_the_same_picture(pipeline, scale):
    triangles, colors = scenes.random_triangles(100, 0.5, seed=22)
    pictures = [
        pipeline.render(
            ab.Mesh(triangles * s, colors=colors), ab.Camera.look_at((0, 0, 3 * s), (0, 0, 0)), width=48, height=48
        ).image
        for s in (1.0, scale)
    ]
    off = np.abs(pictures[0] - pictures[1]).max(axis=-1)
    assert (off > 1e-4).mean() < 0.005  # scaled coordinates round elsewhere: a pixel beside an edge may change


@FLOAT32
def test_hdr_colours_on_slivers_stay_finite(pipeline):
    rng = np.random.default_rng(23)
    start, along = rng.uniform(-1, 1, (2000, 1, 3)), rng.uniform(-1, 1, (2000, 1, 3))
    across = rng.normal(0, 1, (2000, 1, 3)) * 1e-6
    triangles = np.concatenate([start, start + along, start + along / 2 + across], axis=1).astype(np.float32)
    colors = np.float32(10.0) ** rng.uniform(-30, 37, (2000, 3, 4)).astype(np.float32)
    colors[..., 3] = 0.25
    camera = ab.Camera(*scenes.front_camera())
    frame = pipeline.render(ab.Mesh(triangles, colors=colors), camera, width=256, height=256, fragments=True)
    own = colors[frame.fragments.primitive]
    assert len(own) > 50
    assert np.isfinite(frame.image).all()
    assert (frame.fragments.color >= own.min(axis=1)).all()
    assert (frame.fragments.color <= own.max(axis=1)).all()


@pytest.mark.parametrize("pipeline", [CPU32, GPU, GPU_TILES], ids=str)
def test_a_pixel_deeper_than_a_threads_share_is_counted_in_the_bytes(pipeline):
    triangles, colors = scenes.layers(3000, 0.01)
    frame = pipeline.render(
        ab.Mesh(triangles, colors=colors), ab.Camera(*scenes.front_camera()), width=2, height=1, memory=500_000
    )
    assert frame.stats.fragments == 6000
    lists = frame.stats.bytes["scratch"] + frame.stats.bytes.get("pool", 0)
    assert 3000 * 16 <= lists <= 500_000


def test_what_a_gpu_cannot_bind_at_once_is_rendered_pixel_by_pixel(needs_gpu):
    triangles, colors = scenes.layers(3000, 0.01)
    mesh, camera = ab.Mesh(triangles, colors=colors), ab.Camera(*scenes.front_camera(5 / 3))
    small = GPU.render(mesh, camera, width=5, height=3, memory=300_000)
    assert small.stats.bands == 15
    np.testing.assert_array_equal(small.image, GPU.render(mesh, camera, width=5, height=3).image)


def in_a_fork(pipeline, queue):
    triangles, colors = scenes.random_triangles(50, 0.5, seed=24)
    try:
        frame = pipeline.render(
            ab.Mesh(triangles, colors=colors), ab.Camera(*scenes.front_camera()), width=32, height=32, fragments=True
        )
        queue.put((frame.image, frame.fragments.composite()))
    except ab.DeviceError as error:
        queue.put(str(error))


@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")  # that it is multi-threaded is the point
@FLOAT32
def test_a_forked_child_renders_and_composites_as_its_parent_does(pipeline):
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    in_a_fork(pipeline, queue)
    wanted = queue.get(timeout=60)
    child = context.Process(target=in_a_fork, args=(pipeline, queue))
    child.start()
    got = queue.get(timeout=60)
    child.join(60)
    assert child.exitcode == 0
    if isinstance(got, str):  # NVIDIA's driver does not survive a fork: then that is what must be said
        assert pipeline.device == "gpu"
        assert "fork" in got
        assert "spawn" in got
        return
    np.testing.assert_array_equal(got[0], wanted[0])
    np.testing.assert_array_equal(got[1], wanted[1])
