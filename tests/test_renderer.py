"""Scenes that stay on a device: their frames are those of `render`, whatever was rendered before."""

import gc
from typing import NamedTuple

import numpy as np
import pytest

import abuffer as ab


class Way(NamedTuple):
    device: str
    pipeline: str


WAYS = [Way("cpu", "tiles"), Way("gpu", "tiles"), Way("gpu", "linked_list"), Way("gpu", "prefix_sum")]
SIZE = {"width": 48, "height": 40}


def soup(count, seed=0, opaque=False):
    rng = np.random.default_rng(seed)
    positions = rng.uniform(-1, 1, (count, 1, 3)) + rng.uniform(-0.4, 0.4, (count, 3, 3))
    return ab.Mesh(positions, colors=rng.uniform(0.1, 0.9, (count, 4)), color_mode="face", opaque=opaque)


def turntable(count):
    angles = np.arange(count) * 2 * np.pi / count
    return [ab.Camera.look_at((4 * np.sin(a), 0.5, 4 * np.cos(a)), (0, 0, 0)) for a in angles]


def assert_same(frame, other):
    np.testing.assert_array_equal(frame.image, other.image)
    if other.counts is not None:
        np.testing.assert_array_equal(frame.counts, other.counts)
    if other.fragments is not None:
        np.testing.assert_array_equal(frame.fragments.key, other.fragments.key)
        np.testing.assert_array_equal(frame.fragments.primitive, other.fragments.primitive)
    assert frame.stats.fragments == other.stats.fragments


@pytest.mark.parametrize("fragments", [False, "count", True])
@pytest.mark.parametrize("way", WAYS, ids=lambda way: f"{way.device}-{way.pipeline}")
def test_a_turntable_has_the_frames_of_render_in_order(way, fragments):
    scene, arguments = [soup(60), soup(5, 1, opaque=True)], SIZE | {"pipeline": way.pipeline, "fragments": fragments}
    renderer = ab.Renderer(way.device)
    uploaded = renderer.upload(scene)
    cameras = turntable(5)
    frames = list(renderer.render_many(uploaded, cameras, **arguments))
    assert len(frames) == 5
    for frame, camera in zip(frames, cameras, strict=True):
        assert_same(frame, ab.render(scene, camera, device=way.device, **arguments))
    assert not np.array_equal(frames[0].image, frames[1].image)


@pytest.mark.parametrize("way", WAYS, ids=lambda way: f"{way.device}-{way.pipeline}")
def test_what_was_rendered_before_does_not_show(way):
    """Other sizes, backgrounds, lists and options between two renders leave nothing behind."""
    scene, (camera, other) = soup(40), turntable(2)
    renderer = ab.Renderer(way.device)
    uploaded = renderer.upload(scene)
    changes = [
        {},
        {"background": (1, 0.5, 0.25)},
        {"width": 21, "height": 70},
        {"fragments": True},
        {"samples": 4},
        {"fragments": "count", "memory": "64KiB"},
        {"max_sorted_fragments": 1},
        {},
    ]
    for change in changes:
        arguments = {"pipeline": way.pipeline} | SIZE | change
        for view in (camera, other):
            frame = renderer.render(uploaded, view, **arguments)
            assert_same(frame, ab.render(scene, view, device=way.device, **arguments))


def test_a_frame_that_needs_more_room_than_the_one_before_is_whole(needs_gpu):
    """Far away each triangle is in one tile; near by it is in many, and cut by the eye's plane into pieces."""
    scene = soup(300, seed=3)
    near, far = (ab.Camera.look_at((0, 0, z), (0, 0, 0), fov_y=100) for z in (0.1, 60))
    arguments = {"pipeline": "tiles", "width": 300, "height": 200}
    renderer = ab.Renderer("gpu")
    frames = renderer.render_many(renderer.upload(scene), [far, near, near, far], **arguments)
    for frame, camera in zip(frames, [far, near, near, far], strict=True):
        assert_same(frame, ab.render(scene, camera, device="gpu", **arguments))


def test_a_scene_too_deep_for_registers_goes_by_lists_and_back(needs_gpu):
    layers = np.array([[[-2, -2, 0], [2, -2, 0], [0, 2, 0]]]) + np.linspace(0, 1, 100)[:, None, None] * [0, 0, 1]
    scene = ab.Mesh(layers, colors=(1, 1, 1, 0.1))
    inside, outside = (ab.Camera.look_at((0, 0, z), (0, 0, z - 1)) for z in (0.03, 4))  # 3 and 100 layers
    renderer = ab.Renderer("gpu")
    uploaded = renderer.upload(scene)
    for frame, camera in zip(
        renderer.render_many(uploaded, [inside, outside, inside], pipeline="tiles", **SIZE),
        [inside, outside, inside],
        strict=True,
    ):
        assert_same(frame, ab.render(scene, camera, device="gpu", pipeline="tiles", **SIZE))
    assert frame.stats.max_depth_complexity < 8


@pytest.mark.parametrize("render", ["render", "render_many"])
def test_a_frame_whose_tiles_the_frames_before_had_none_like_is_whole(needs_gpu, render):
    """From the front one layer a pixel, from the side 6 in some and a hundred small triangles in others."""
    layers = [[(-1, -1, z), (1, -1, z), (0, 1, z)] for z in np.linspace(-0.5, 0.5, 6)]
    crumbs = np.random.default_rng(0).uniform(-0.15, 0.15, (300, 1, 3)) + (5, 0, 0)
    crumbs = crumbs + np.random.default_rng(1).uniform(-0.03, 0.03, (300, 3, 3))
    scene = ab.Mesh(np.concatenate([np.array(layers), crumbs]), colors=(0.9, 0.5, 0.2, 0.3))
    aside, ahead = ab.Camera.look_at((-9, 0, 0), (-12, 0, 0)), ab.Camera.look_at((0, 0, 5), (0, 0, 0))
    crumbled = ab.Camera.look_at((5, 0, 2), (5, 0, 0))
    cameras = [aside, ahead, crumbled, ahead, aside]
    renderer = ab.Renderer("gpu")
    uploaded = renderer.upload(scene)
    arguments = SIZE | {"pipeline": "tiles", "fragments": "count"}
    if render == "render":
        frames = [renderer.render(uploaded, camera, **arguments) for camera in cameras]
    else:
        frames = list(renderer.render_many(uploaded, cameras, **arguments))
    classes = [frame.plan["tile classes"] for frame in frames]
    assert len(set(classes)) > 1, "else the cameras do not show what is tested"
    for frame, camera in zip(frames, cameras, strict=True):
        assert_same(frame, ab.render(scene, camera, device="gpu", **arguments))
        cpu = ab.render(scene, camera, device="cpu", **arguments)
        np.testing.assert_array_equal(frame.counts, cpu.counts)


def test_bands_of_one_frame_are_not_those_of_the_next(needs_gpu):
    """Near by its triangles are in more tiles than this memory has room for at once."""
    x, y = (v.ravel() for v in np.meshgrid(np.linspace(-1, 1, 40), np.linspace(-1, 1, 40)))
    at = np.stack([x, y, 0 * x], axis=-1)[:, None]
    mesh = ab.Mesh(at + np.array([[0, 0, 0], [0.05, 0, 0], [0, 0.05, 0]]), colors=(1, 0, 0, 0.5))
    far, near = (ab.Camera.look_at((0, 0, z), (0, 0, 0), fov_y=60) for z in (60, 2))
    asked = {"pipeline": "tiles", "width": 300, "height": 300, "memory": 12_000}
    renderer = ab.Renderer("gpu")
    uploaded = renderer.upload(mesh)
    bands = [renderer.render(uploaded, camera, **asked).stats.bands for camera in (far, near, far)]
    assert bands[0] == bands[2] == 1 < bands[1]


@pytest.mark.parametrize("fragments", [False, True])
def test_geometry_goes_to_the_device_once(needs_gpu, fragments):
    renderer = ab.Renderer("gpu")
    uploaded = renderer.upload(soup(20))
    frames = renderer.render_many(uploaded, turntable(4), pipeline="tiles", fragments=fragments, **SIZE)
    kept = [any(what == "geometry" for what, *_ in frame.plan) for frame in frames]
    assert kept == [False, True, True, True]


def test_an_uploaded_scene_is_what_it_was():
    scene = ab.Scene([soup(3)])
    renderer = ab.Renderer("cpu")
    uploaded = renderer.upload(scene)
    before = renderer.render(uploaded, **SIZE)
    scene.add(soup(9, seed=5))
    assert_same(renderer.render(uploaded, **SIZE), before)


def test_frames_before_an_error_come_first():
    renderer = ab.Renderer("cpu")
    frames = renderer.render_many(soup(3), [turntable(1)[0], "no camera"], **SIZE)
    assert next(frames).image.shape == (40, 48, 4)
    with pytest.raises(ab.ParameterError, match="camera must be"):
        next(frames)


def test_frames_before_an_error_of_the_cameras_come_first():
    def cameras():
        yield turntable(1)[0]
        raise RuntimeError("no more film")

    frames = ab.Renderer("cpu").render_many(soup(3), cameras(), **SIZE)
    assert next(frames).image.shape == (40, 48, 4)
    with pytest.raises(RuntimeError, match="film"):
        next(frames)


@pytest.mark.parametrize(
    ("cameras", "arguments", "words"),
    [
        (turntable(1)[0], {}, "got one Camera"),
        (None, {}, "iterable of Camera, got NoneType"),
        ([], {"widht": 3}, "did you mean 'width'"),
        ([], {"device": "gpu"}, "device is the renderer's"),
        ([], {"max_error": "small"}, "max_error must be a number"),
        ([], {"max_error": 0.1, "cutoff": 0.1}, "leave cutoff out"),
    ],
)
def test_what_is_wrong_with_many_frames_is_said_at_once(cameras, arguments, words):
    with pytest.raises(ab.ParameterError, match=words):
        ab.Renderer("cpu").render_many(soup(3), cameras, **arguments)


def test_many_frames_are_of_the_scene_as_it_was():
    scene = ab.Scene([soup(3)])
    frames = ab.Renderer("cpu").render_many(scene, turntable(1), **SIZE)
    scene.add(soup(9, seed=5))
    assert_same(next(frames), ab.render(soup(3), turntable(1)[0], device="cpu", **SIZE))


def test_an_uploaded_scene_is_for_its_renderer():
    uploaded = ab.Renderer("cpu").upload(soup(1))
    with pytest.raises(ab.SceneError, match="give its `scene`"):
        ab.render(uploaded)


def test_frames_that_nobody_takes_are_let_go(needs_gpu):
    renderer = ab.Renderer("gpu")
    uploaded = renderer.upload(soup(30))
    frames = renderer.render_many(uploaded, turntable(9), pipeline="tiles", **SIZE)
    next(frames)
    del frames
    gc.collect()
    assert_same(
        renderer.render(uploaded, turntable(1)[0], pipeline="tiles", **SIZE),
        ab.render(soup(30), turntable(1)[0], device="gpu", pipeline="tiles", **SIZE),
    )


def test_a_renderer_keeps_its_device():
    with pytest.raises(ab.ParameterError, match="device is the renderer's, 'cpu'"):
        ab.Renderer("cpu").render(soup(1), device="gpu")


def test_a_renderer_of_no_device_is_an_error_at_once():
    with pytest.raises(ab.DeviceError, match="Voodoo"):
        ab.Renderer("Voodoo 2")


def test_another_renderers_scene_is_refused():
    uploaded = ab.Renderer("cpu").upload(soup(1))
    with pytest.raises(ab.ParameterError, match="another Renderer"):
        ab.Renderer("cpu").render(uploaded)
