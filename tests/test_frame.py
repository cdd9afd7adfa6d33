"""What a render returns: types, display, files."""

import dataclasses
import io
import pickle
import warnings

import numpy as np
import pytest

import abuffer as ab
import scenes

Image = pytest.importorskip("PIL.Image")

CAMERA = ab.Camera.look_at((0, 0, 3), (0, 0, 0))
TRIANGLES, COLORS = scenes.random_triangles(40, 0.5, seed=8)


def rendered(item=None, **options):
    item = ab.Mesh(TRIANGLES, colors=COLORS) if item is None else item
    return ab.render(item, CAMERA, width=32, height=24, device="cpu", **options)


def layer(*color):
    """A frame that one layer of this colour covers."""
    return rendered(ab.Mesh(scenes.covering()[0], colors=color), precision="float64")


# what is there


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_the_image_is_of_the_precision(precision):
    frame = rendered(precision=precision)
    assert (frame.image.shape, frame.image.dtype) == ((24, 32, 4), precision)
    assert frame.straight.dtype == precision


@pytest.mark.parametrize(
    ("asked", "counts", "lists"),
    [(False, False, False), ("count", True, False), (True, True, True), ("all", True, True)],
)
def test_counts_and_lists_come_when_asked_for(asked, counts, lists):
    frame = rendered(fragments=asked)
    assert (frame.counts is not None, frame.fragments is not None) == (counts, lists)
    if counts:
        assert (frame.counts.shape, frame.counts.dtype) == ((24, 32), np.int32)
        assert frame.counts.sum() == frame.stats.fragments


def test_an_empty_scene_is_its_background():
    frame = rendered(ab.Scene(), background=(1, 0.5, 0, 0.5), fragments=True)
    np.testing.assert_array_equal(frame.image, np.broadcast_to((0.5, 0.25, 0, 0.5), (24, 32, 4)))
    assert frame.stats.fragments == 0
    assert not frame.counts.any()
    assert len(frame.fragments) == 0


def test_all_lists_opaque_surfaces_too():
    wall = ab.Mesh(scenes.covering(0)[0], opaque=True)
    behind = ab.Mesh(scenes.covering(-1)[0])
    assert rendered([wall, behind], fragments=True).fragments[12, 16].primitive.tolist() == []
    assert rendered([wall, behind], fragments="all").fragments[12, 16].primitive.tolist() == [0, 1]


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_an_alpha_at_the_cutoff_is_kept(precision):
    """Only less alpha than the cutoff is a hole."""
    for alpha, seen in ((0.25, 1), (0.2499, 0)):
        mask = ab.Mesh(scenes.covering()[0], colors=(1, 0, 0, alpha), opaque=True, alpha_cutoff=0.25)
        np.testing.assert_array_equal(rendered(mask, precision=precision).image[..., 3], seen)


def test_stats_and_plan_are_readable():
    frame = rendered(fragments="count")
    assert frame.stats.max_depth_complexity == frame.counts.max()
    assert frame.stats.dropped_fragments == frame.stats.rejected_triangles == 0
    assert frame.stats.device
    assert all(ms >= 0 for ms in frame.stats.ms.values())
    assert "fragments" in str(frame.stats)
    assert frame.plan["pipeline"] == "tiles"
    assert all(what in str(frame.plan) and why in repr(frame.plan) for what, _, why in frame.plan)
    with pytest.raises(KeyError):
        frame.plan["weather"]


def test_samples_stay_apart_if_asked_for():
    frame = rendered(samples=4, msaa_resolve="none")
    assert frame.image.shape == frame.straight.shape == (24, 32, 4, 4)
    assert rendered(samples=1, msaa_resolve="none").image.shape == (24, 32, 1, 4)
    assert rendered(samples=4).image.shape == (24, 32, 4)
    assert repr(frame).startswith("Frame(24×32 of 4 samples, ")
    assert repr(rendered()).startswith("Frame(24×32, ")


def test_samples_are_averaged_to_be_shown():
    frame, mean = (rendered(samples=4, msaa_resolve=how, precision="float64") for how in ("none", "per_pixel"))
    assert (frame.image.std(axis=2) > 0.01).any()
    np.testing.assert_array_equal(frame.to_uint8(), mean.to_uint8())
    np.testing.assert_array_equal(frame.to_uint8(srgb=True, background=0.5), mean.to_uint8(srgb=True, background=0.5))
    np.testing.assert_array_equal(opened(io.BytesIO(frame._repr_png_())), mean.to_uint8())


def test_colour_that_exceeds_alpha_in_one_sample_may_not_do_so_in_the_mean():
    frame = layer(0.5, 0.5, 0.5, 0.5)
    samples = np.stack([frame.image, frame.image], axis=2)
    samples[:, :, 0, :3], samples[:, :, 1, :3] = 0.8, 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pixels = dataclasses.replace(frame, image=samples).to_uint8()
    np.testing.assert_array_equal(pixels[0, 0], (204, 204, 204, 128))


# straight


def test_straight_is_what_premultiplied_was():
    frame = layer(0.25, 0.5, 2.0, 0.5)
    np.testing.assert_allclose(frame.image, np.broadcast_to((0.125, 0.25, 1.0, 0.5), (24, 32, 4)), rtol=1e-15)
    np.testing.assert_allclose(frame.straight, np.broadcast_to((0.25, 0.5, 2.0, 0.5), (24, 32, 4)), rtol=1e-15)


def test_straight_is_zero_where_alpha_is():
    np.testing.assert_array_equal(layer(1, 1, 1, 0).straight, 0)


# to_uint8


def test_to_uint8_rounds_straight_colours():
    pixels = layer(0.2, 0.4, 0.9, 0.6).to_uint8()
    assert (pixels.shape, pixels.dtype) == ((24, 32, 4), np.uint8)
    np.testing.assert_array_equal(pixels[0, 0], (51, 102, 230, 153))  # 229.5 to even


def test_to_uint8_encodes_rgb_but_not_alpha():
    """IEC 61966-2-1: 0.5 is 188 of 255, and 0.002 in the straight part is 12.92 · 0.002 · 255 = 6.6."""
    np.testing.assert_array_equal(layer(0.5, 0.002, 1, 0.5).to_uint8(srgb=True)[0, 0], (188, 7, 255, 128))


@pytest.mark.parametrize(
    ("background", "shown"),
    [
        (1, (255, 128, 128, 255)),
        ((0, 1, 0), (128, 128, 0, 255)),
        ((0, 1, 0, 1.0), (128, 128, 0, 255)),
        ((0, 1, 0, 0.0), (255, 0, 0, 128)),
        ((0, 0, 0, 0.5), (170, 0, 0, 191)),  # alpha 0.75, red 0.5/0.75
        (np.full((24, 32, 3), 255, np.uint8), (255, 128, 128, 255)),
    ],
    ids=["grey", "rgb", "rgba", "nothing", "translucent", "image"],
)
def test_to_uint8_over_a_background(background, shown):
    np.testing.assert_array_equal(layer(1, 0, 0, 0.5).to_uint8(background=background)[3, 4], shown)


def test_to_uint8_puts_the_image_over_its_background_before_it_encodes():
    pixels = layer(1, 1, 1, 0.5).to_uint8(srgb=True, background=0)
    np.testing.assert_array_equal(pixels[0, 0], (188, 188, 188, 255))


def test_colour_beyond_alpha_is_shown_over_black_with_a_warning():
    frame = layer(1.5, 0.5, 0, 0.5)
    with pytest.warns(UserWarning, match="colour exceeds alpha: shown over black"):
        pixels = frame.to_uint8()
    np.testing.assert_array_equal(pixels[0, 0], (191, 64, 0, 255))


def test_colour_beyond_one_is_cut_with_a_warning():
    frame = layer(1.5, 0.5, 0, 1)
    with pytest.warns(UserWarning, match="colour exceeds 1: shown as 1"):
        pixels = frame.to_uint8()
    np.testing.assert_array_equal(pixels[0, 0], (255, 128, 0, 255))


def test_no_warning_for_what_straight_colours_can_hold():
    white = ab.Mesh(scenes.layers(500, 0.01)[0], colors=(1, 1, 1, 0.01))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pixels = rendered(white).to_uint8()
    np.testing.assert_array_equal(pixels[..., :3], 255)


def test_to_uint8_refuses_a_background_of_another_size():
    with pytest.raises(ab.ParameterError, match=r"background must be grey.*H, W = \(24, 32\)"):
        rendered().to_uint8(background=np.zeros((2, 2, 3)))


# files


def opened(source):
    with Image.open(source) as image:
        assert image.mode == "RGBA"
        return np.asarray(image)


def test_a_png_holds_to_uint8(tmp_path):
    frame = rendered()
    for path in (tmp_path / "x.png", str(tmp_path / "y.PNG")):
        frame.save(path)
        np.testing.assert_array_equal(opened(path), frame.to_uint8())
    frame.save(tmp_path / "z.png", srgb=True, background=0.5)
    np.testing.assert_array_equal(opened(tmp_path / "z.png"), frame.to_uint8(srgb=True, background=0.5))


def test_notebooks_show_the_png():
    frame = rendered()
    np.testing.assert_array_equal(opened(io.BytesIO(frame._repr_png_())), frame.to_uint8())


@pytest.mark.parametrize("asked", [False, "count", True])
def test_an_npz_holds_everything(tmp_path, asked):
    frame = rendered(fragments=asked, background=(0.1, 0.2, 0.3, 0.4))
    for path in (tmp_path / "x.npz", str(tmp_path / "y.NPZ")):
        frame.save(path)
        loaded = ab.Frame.load(path)
        assert loaded.image.dtype == frame.image.dtype
        np.testing.assert_array_equal(loaded.image, frame.image)
        np.testing.assert_array_equal(loaded.counts, frame.counts)
        assert loaded.stats == frame.stats
        assert list(loaded.plan) == list(frame.plan)
        assert (loaded.fragments is None) == (frame.fragments is None)
        if asked is True:
            for field in ("offsets", "depth", "key", "color", "primitive", "background"):
                np.testing.assert_array_equal(getattr(loaded.fragments, field), getattr(frame.fragments, field))


def test_an_npz_holds_samples_and_blend_modes(tmp_path):
    item = ab.Mesh(TRIANGLES, colors=COLORS, blend="additive")
    frame = rendered(item, samples=4, msaa_resolve="none", fragments=True, background=(0.1, 0.2, 0.3, 0.4))
    frame.save(tmp_path / "x.npz")
    loaded = ab.Frame.load(tmp_path / "x.npz")
    np.testing.assert_array_equal(loaded.image, frame.image)
    assert loaded.fragments.samples == 4
    for field in ("coverage", "blend", "background"):
        np.testing.assert_array_equal(getattr(loaded.fragments, field), getattr(frame.fragments, field))


def test_other_endings_are_refused(tmp_path):
    for name in ("x.jpg", "x", "png"):
        with pytest.raises(ab.ParameterError, match=r"saves as .png or .npz, got"):
            rendered().save(tmp_path / name)
    with pytest.raises(ab.ParameterError, match=r"are for .png"):
        rendered().save(tmp_path / "x.npz", srgb=True)


def test_load_refuses_what_is_no_frame(tmp_path):
    np.savez(tmp_path / "other.npz", a=1)
    with pytest.raises(ab.ParameterError, match="holds no frame"):
        ab.Frame.load(tmp_path / "other.npz")


def test_frames_pickle_and_compare_by_identity():
    frame = rendered(fragments=True)
    other = pickle.loads(pickle.dumps(frame))
    np.testing.assert_array_equal(other.image, frame.image)
    assert frame == frame
    assert frame != other


# the camera


def test_the_camera_stays_where_it_was_when_the_scene_grows(tmp_path):
    scene = ab.Scene(ab.Mesh(TRIANGLES, colors=COLORS))
    camera = ab.Camera.fit(scene)
    frame = ab.render(scene, camera, width=32, height=24, device="cpu", precision="float64", fragments=True)
    before = frame.fragments.points(camera)
    scene.add(ab.Mesh(TRIANGLES + 100))
    assert not np.allclose(frame.fragments.points(camera), before)
    frame.save(tmp_path / "a.npz")
    for kept in (frame, ab.Frame.load(tmp_path / "a.npz"), pickle.loads(pickle.dumps(frame))):
        np.testing.assert_array_equal(kept.fragments.points(kept.camera), before)
        assert ab.render(scene, kept.camera, device="cpu").image.shape == (24, 32, 4)  # its size is the frame's


def test_a_frame_keeps_any_camera(tmp_path):
    k = [[50, 1, 20], [0, 50, 10], [0, 0, 1]]
    for camera in (
        ab.Camera.look_at((0, 0, 3), (0, 0, 0), near=0.1, far=9),
        ab.Camera.orthographic((0, 0, 3), (0, 0, 0), height=3),
        ab.Camera.from_intrinsics(k, np.eye(4), width=40, height=20),
    ):
        frame = ab.render(ab.Scene(), camera, width=40, height=20, device="cpu")
        frame.save(tmp_path / "a.npz")
        other = ab.Frame.load(tmp_path / "a.npz").camera
        for ours, theirs in zip(other.matrices(40, 20), camera.matrices(40, 20), strict=True):
            np.testing.assert_array_equal(ours, theirs)
        assert (other.near, other.far, other.is_perspective) == (camera.near, camera.far, camera.is_perspective)


def test_a_fitted_camera_is_fitted_once_a_render(monkeypatch):
    fitted = []
    sphere = ab.Scene.bounding_sphere
    monkeypatch.setattr(ab.Scene, "bounding_sphere", lambda scene: fitted.append(scene) or sphere(scene))
    ab.render(ab.Mesh(TRIANGLES), width=8, height=8, device="cpu")
    assert len(fitted) == 1


# files that are not ours


@pytest.mark.parametrize("load", [ab.Frame.load, ab.Fragments.load])
def test_a_file_that_is_not_ours_is_named(tmp_path, load):
    path = tmp_path / "other.npz"
    np.save(tmp_path / "array.npy", np.zeros(3))
    for content in (b"", b"hello", b"PK\x03\x04 broken", (tmp_path / "array.npy").read_bytes()):
        path.write_bytes(content)
        with pytest.raises(ab.ParameterError, match=r"other\.npz' is not an \.npz that abuffer saved"):
            load(path)
    np.savez(path, a=[1])
    with pytest.raises(ValueError, match=r"other\.npz' holds no .* missing") as caught:
        load(path)
    assert isinstance(caught.value, ab.AbufferError)
    with pytest.raises(FileNotFoundError):
        load(tmp_path / "nothing.npz")


def test_paths_may_begin_with_the_home_directory(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    frame = rendered(fragments=True)
    frame.save("~/a.npz")
    frame.fragments.save("~/b.npz")
    assert ab.Frame.load("~/a.npz").image.shape == frame.image.shape
    assert len(ab.Fragments.load("~/b.npz")) == len(frame.fragments)


def test_a_row_that_the_plan_has_not_is_named_beside_those_that_it_has():
    plan = ab.render(ab.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), device="cpu").plan
    with pytest.raises(KeyError, match="no row 'rectangles': it has device, pipeline"):
        plan["rectangles"]
