"""Native forms: methods on the hardware's rasteriser have the images that they have in tiles."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import abuffer as ab
import methods
from abuffer import ParameterError
from abuffer._methods import METHODS

CAMERA = ab.Camera.look_at((0, 0, 4), (0, 0, 0))
SIZE = {"width": 61, "height": 45}
NATIVE = [id for id in METHODS if METHODS[id].is_native]
# Draws are samples there, whose edges are other than those of pixels.
PIXELWISE = [id for id in NATIVE if id != "stochastic"]
# Moments of 16 bits are rounded at each fragment, which blending does not do.
BLENDED = [variant for variant in methods.variants(PIXELWISE) if "bits" not in variant[1]]
BEHIND = (0.1, 0.2, 0.3, 0.5)
WALL = ab.Mesh([[[-3, -3, -0.9], [3, -3, -0.9], [0, 3, -0.9]]], colors=(0.2, 0.5, 0.9), opaque=True)

pytestmark = pytest.mark.usefixtures("needs_gpu")


def scene(opaque=False, seed=5, n=14):
    """Triangles that face the camera: a GPU may interpolate depths between corners that it has snapped."""
    rng = np.random.default_rng(seed)
    triangles = rng.uniform(-1, 1, (n, 1, 3)) + rng.uniform(-2, 2, (n, 3, 3)) * (1, 1, 0)
    return [ab.Mesh(triangles, colors=rng.uniform(0.05, 1, (n, 4)))] + [WALL] * opaque


def sheets(depths, colors, **mesh):
    """Triangles over the whole view, facing the camera."""
    corners = ((-30, -30), (30, -30), (0, 60))
    return ab.Mesh(
        [[(*corner, 4 - depth) for corner in corners] for depth in depths], colors=colors, color_mode="face", **mesh
    )


def both(scene, method, camera=CAMERA, size=SIZE, **options):
    """Of the hardware, and of the CPU in the same precision."""
    hardware = ab.render(scene, camera, **size, method=method, device="gpu", pipeline="hardware", **options)
    return hardware, ab.render(scene, camera, **size, method=method, device="cpu", **options)


def both_targets(scene, method, targets, camera, size):
    """The same, with colours drawn in so many bits."""
    options = {"method": method, "device": "gpu", "pipeline": "hardware", "targets": targets}
    wanted = ab.render(scene, camera, **size, method=method, device="cpu")
    return ab.render(scene, camera, **size, **options), wanted


@pytest.mark.parametrize("opaque", [False, True])
@pytest.mark.parametrize("variant", BLENDED, ids=methods.name_of)
def test_an_image_is_that_of_tiles(variant, opaque):
    id, options = variant
    hardware, wanted = both(scene(opaque), id, background=BEHIND, fragments="count", **options)
    # Edges through a pixel's very centre are the hardware's to round.
    same = hardware.counts == wanted.counts
    assert same.mean() > 0.99
    assert np.isfinite(hardware.image).all()
    np.testing.assert_allclose(hardware.image[same], wanted.image[same], atol=methods.tolerance(id))
    assert (hardware.counts > 2).sum() > 100


def test_that_comparison_would_fail_for_another_weight():
    images = [both(scene(), "wboit", weight=weight)[i].image for i, weight in enumerate(("7", "9"))]
    assert np.abs(images[0] - images[1]).max() > 10 * methods.tolerance("wboit")


@pytest.mark.parametrize("variant", [v for v in methods.variants(["stochastic"])], ids=methods.name_of)
@pytest.mark.parametrize("draws", [1, 2, 3, 7, 8, 64])
def test_draws_are_those_of_tiles_where_no_edge_is(variant, draws):
    """Of any number, whatever samples a device has: to the last draw."""
    options = variant[1] | {"draws": draws}
    rng = np.random.default_rng(3)
    for opaque in (False, True):
        wall = [sheets([5.5], np.array([(0.3, 0.2, 0.9)]), opaque=True)] * opaque
        all = [sheets(rng.permutation([3.0, 4.0, 5.0, 6.0]), rng.uniform(0.1, 0.9, (4, 4))), *wall]
        hardware, wanted = both(all, "stochastic", background=BEHIND, **options)
        np.testing.assert_allclose(hardware.image, wanted.image, atol=5e-6)


def test_draws_by_the_hardware_have_the_expectation_of_exact():
    """At edges too, where samples are covered one by one: the mean over seeds, within five deviations."""
    frames, draws = 64, 8
    all = [
        ab.render(
            scene(), CAMERA, **SIZE, method="stochastic", draws=draws, seed=seed, device="gpu", pipeline="hardware"
        )
        for seed in range(frames)
    ]
    exact = ab.render(scene(), CAMERA, **SIZE, samples=8, device="cpu").image
    mean = np.mean([frame.image for frame in all], axis=0)
    # R / (2 √S) a frame at most, and beside it what four samples of an edge differ from eight by.
    inside = np.abs(ab.render(scene(), CAMERA, **SIZE, samples=4, device="cpu").image - exact).max(axis=-1) == 0
    assert inside.mean() > 0.4
    assert np.abs(mean - exact)[inside].max() < 5 / (2 * np.sqrt(draws * frames))


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
@pytest.mark.parametrize("id", ["depth_peeling", "dual_depth_peeling"])
def test_coincident_fragments_are_all_peeled_the_later_in_front(id, order):
    colors = np.array([(1, 0, 0, 0.5), (0, 1, 0, 0.25)])[list(order)]
    twice = sheets([4.0, 4.0, 5.0], np.concatenate([colors, [(0, 0, 1, 0.5)]]))
    hardware, wanted = both(twice, id, fragments="count")
    np.testing.assert_allclose(hardware.image, wanted.image, atol=1e-6)
    later, earlier = colors[1], colors[0]
    red_green = later[3] * later[:2] + (1 - later[3]) * earlier[3] * earlier[:2]
    np.testing.assert_allclose(hardware.image[20, 30, :2], red_green, atol=1e-6)
    assert (hardware.counts == 3).all()


def test_layers_beyond_a_limit_are_dropped_and_counted():
    four = sheets([3.0, 4.0, 5.0, 6.0], np.array([(1, 1, 1, 0.5)] * 4))
    frame, _ = both(four, "depth_peeling", layers=3)
    np.testing.assert_allclose(frame.image[0, 0], 1 - 0.5**3, atol=1e-6)
    assert frame.stats.dropped_fragments == SIZE["width"] * SIZE["height"]
    assert frame.stats.max_depth_complexity == 4
    assert frame.plan["passes over geometry"] == "3"


def test_thin_layers_keep_their_alpha():
    """1000 of 1e-7: alpha is accumulated; as 1 − T it would be 19 % off."""
    layers = sheets(np.linspace(3, 5, 1000), np.full((1000, 4), (1, 1, 1, 1e-7)))
    wanted = -np.expm1(1000 * np.log1p(-1e-7))
    for id in ("wboit", "unsorted"):
        frame = both(layers, id, size={"width": 4, "height": 4})[0]
        np.testing.assert_allclose(frame.image[..., 3], wanted, rtol=2e-5)


def test_a_thousand_layers_of_moments_are_not_black():
    """Their transmittances are down to e⁻¹⁶⁰⁰⁰: weights have a common factor, and a least one."""
    for n in (100, 1000):
        colors = np.full((n, 4), (0.25, 0.5, 1, 1))
        frame, wanted = both(sheets(np.linspace(3, 5, n), colors), "mboit", size={"width": 4, "height": 4})
        np.testing.assert_allclose(frame.image, wanted.image, atol=1e-5)


@pytest.mark.parametrize("id", PIXELWISE)
def test_targets_of_16_bits_round_each_fragment(id):
    """By 2⁻¹¹ of the sum, which is some times the image: of additive up to 10, of a mean as much as its weights."""
    options = {"background": BEHIND, "device": "gpu", "pipeline": "hardware", "method": id}
    single, half = (ab.render(scene(), CAMERA, **SIZE, **options, targets=t) for t in ("float32", "float16"))
    off = np.abs(half.image - single.image).max()
    assert 1e-5 < off < 20 * 2**-11
    assert half.stats.bytes["targets"] < single.stats.bytes["targets"]


@pytest.mark.parametrize(("layers", "holds"), [(21, True), (40, False)])
def test_weights_as_published_overflow_16_bits_from_22_near_layers_on(layers, holds):
    """22 · 3000 > 65504, where devices have infinity, or the largest number; 32 bits hold them."""
    colors = np.full((layers, 4), (1, 0.5, 0.25, 1))
    near = sheets(np.linspace(0.011, 0.012, layers), colors)
    options = {"size": {"width": 4, "height": 4}, "camera": ab.Camera.look_at((0, 0, 4), (0, 0, 0), near=1e-3)}
    half, wanted = both_targets(near, "wboit", "float16", **options)
    # A rounding of 2⁻¹² each.
    assert (np.abs(half.image - wanted.image) < layers * 2**-12).all() == holds
    single, _ = both_targets(near, "wboit", "float32", **options)
    np.testing.assert_allclose(single.image, wanted.image, atol=1e-5)


@pytest.mark.parametrize("id", PIXELWISE)
def test_culled_cut_out_and_far_geometry_is_no_fragment(id):
    rng = np.random.default_rng(8)
    triangles = rng.uniform(-1, 1, (40, 1, 3)) + rng.uniform(-2, 2, (40, 3, 3)) * (1, 1, 0)
    colors = rng.uniform(0.05, 1, (40, 4))
    meshes = [
        ab.Mesh(triangles[:10], colors=colors[:10], cull="back"),
        ab.Mesh(triangles[10:20], colors=colors[10:20], cull="front"),
        ab.Mesh(triangles[20:34], colors=colors[20:34]),
        ab.Mesh(triangles[34:], colors=colors[34:], opaque=True, alpha_cutoff=0.5),
    ]
    camera = ab.Camera.look_at((0, 0, 4), (0, 0, 0), near=3.6, far=4.4)
    hardware, wanted = both(meshes, id, camera, fragments="count")
    whole = ab.render(meshes, CAMERA, **SIZE, fragments="count")
    assert (whole.counts != wanted.counts).mean() > 0.1
    same = hardware.counts == wanted.counts
    assert same.mean() > 0.99
    np.testing.assert_allclose(hardware.image[same], wanted.image[same], atol=methods.tolerance(id))


@pytest.mark.parametrize("id", PIXELWISE)
def test_a_parallel_view_and_colours_of_vertices(id):
    rng = np.random.default_rng(9)
    triangles = rng.uniform(-1, 1, (12, 1, 3)) + rng.uniform(-2, 2, (12, 3, 3)) * (1, 1, 0)
    mesh = ab.Mesh(triangles, colors=rng.uniform(0.05, 1, (12, 3, 4)))
    camera = ab.Camera.orthographic((0, 0, 4), (0, 0, 0), height=2.5)
    background = rng.uniform(0, 1, (45, 61, 4))
    hardware, wanted = both([mesh, WALL], id, camera, background=background, fragments="count")
    same = hardware.counts == wanted.counts
    assert same.mean() > 0.99
    # Interpolated between corners that may be 1/512 of a pixel off, over some 10 pixels.
    np.testing.assert_allclose(hardware.image[same], wanted.image[same], atol=2e-3)
    assert np.median(np.abs(hardware.image - wanted.image)) < 1e-5


def test_vertices_far_from_the_origin_keep_their_double_positions():
    """At 1e7 a float is a whole unit wide."""
    at = np.array([1e7, -2e7, 3e7])
    mesh = ab.Mesh(scene()[0].positions.reshape(-1, 3, 3).astype(float) + at, colors=scene()[0].colors)
    camera = ab.Camera.look_at(at + (0, 0, 4), at)
    hardware, wanted = both(mesh, "wboit", camera, fragments="count", depth_range=(3, 5))
    same = hardware.counts == wanted.counts
    assert same.mean() > 0.99
    np.testing.assert_allclose(hardware.image[same], wanted.image[same], atol=1e-4)


@pytest.mark.parametrize("width", [1, 16, 17, 63, 64, 65, 300])
def test_rows_of_any_width_come_back(width):
    hardware, wanted = both(scene(), "additive", size={"width": width, "height": 5}, fragments="count")
    same = hardware.counts == wanted.counts
    np.testing.assert_allclose(hardware.image[same], wanted.image[same], atol=5e-6)
    assert hardware.image.shape == (5, width, 4)


@pytest.mark.parametrize("id", NATIVE)
def test_an_empty_view_shows_the_background(id):
    away = ab.Camera.look_at((0, 0, 4), (0, 0, 9))
    for meshes in (scene(), scene(opaque=True)):
        frame, _ = both(meshes, id, away, background=BEHIND)
        np.testing.assert_allclose(
            frame.image, np.broadcast_to(np.float32([0.05, 0.1, 0.15, 0.5]), (45, 61, 4)), atol=1e-7
        )
        assert frame.stats.fragments == 0


@pytest.mark.parametrize("id", NATIVE)
def test_the_same_render_has_the_same_bits(id):
    images = [both(scene(True), id)[0].image for _ in range(3)]
    np.testing.assert_array_equal(images[0], images[1])
    np.testing.assert_array_equal(images[0], images[2])


@pytest.mark.parametrize("id", NATIVE)
def test_lists_beside_it_are_those_of_tiles(id):
    frame, _ = both(scene(), id, fragments=True)
    wanted = ab.render(scene(), CAMERA, **SIZE, device="cpu", fragments=True).fragments
    np.testing.assert_array_equal(frame.fragments.key, wanted.key)
    np.testing.assert_array_equal(frame.fragments.primitive, wanted.primitive)
    np.testing.assert_array_equal(frame.counts, wanted.counts)


@pytest.mark.parametrize("id", NATIVE)
def test_the_plan_and_stats_say_what_it_took(id):
    frame, _ = both(scene(), id)
    assert frame.plan["cost"] == "native"
    assert frame.plan["pipeline"] == "hardware"
    assert frame.stats.bytes["targets"] >= 16 * SIZE["width"] * SIZE["height"]
    assert "count" in frame.stats.ms
    own = sum(ms for stage, ms in frame.stats.ms.items() if stage not in ("upload", "wait and readback"))
    counts_itself = id.endswith("peeling")
    assert frame.stats.gpu_ms == pytest.approx(own if counts_itself else own - frame.stats.ms["count"])


def test_a_renderer_keeps_the_scene_for_it():
    renderer = ab.Renderer("gpu")
    uploaded = renderer.upload(scene())
    frames = [renderer.render(uploaded, CAMERA, **SIZE, method="mboit", pipeline="hardware") for _ in range(2)]
    assert frames[1].plan["geometry"] == "kept"
    np.testing.assert_array_equal(frames[0].image, frames[1].image)
    many = list(renderer.render_many(uploaded, [CAMERA] * 2, **SIZE, method="mboit", pipeline="hardware"))
    np.testing.assert_array_equal(many[1].image, frames[0].image)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"method": "exact"}, r"does not have method 'exact': give pipeline=\"tiles\" or pipeline=\"linked_list\""),
        ({"method": "mlab"}, r"does not have method 'mlab': give pipeline=\"tiles\""),
        ({"method": "wboit", "weight": "alpha / z"}, "does not have method 'wboit'"),
        ({"method": "mboit", "bits": 16}, "adds to moments, and bits=16 rounds what is there"),
        ({"method": "wboit", "samples": 4}, "has 1 sample a pixel, got 4"),
        ({"method": "wboit", "targets": "float64"}, "targets must be one of 'float32', 'float16'"),
        ({"method": "wboit", "targets": "float16", "pipeline": "tiles"}, "targets is an option of pipeline hardware"),
        ({"method": "wboit", "device": "cpu"}, 'pipeline "hardware" needs a GPU'),
        ({"method": "wboit", "precision": "float64", "device": "auto"}, 'pipeline "hardware" needs a GPU'),
    ],
)
def test_what_has_no_native_form_is_refused(arguments, message):
    with pytest.raises(ParameterError, match=message):
        ab.render(scene(), CAMERA, **SIZE, **{"device": "gpu", "pipeline": "hardware"} | arguments)


def test_a_device_without_blending_of_floats_is_told():
    code = (
        "import abuffer as ab\n"
        "mesh = ab.Mesh([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], colors=(1, 0, 0, 0.5))\n"
        "try: ab.render(mesh, width=8, height=8, method='wboit', device='gpu', pipeline='hardware')\n"
        "except ab.UnsupportedError as e: print(e)\n"
    )
    environment = os.environ | {"ABUFFER_WITHOUT": "FLOAT32_BLENDABLE"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    assert 'does not blend into 32-bit floats, which pipeline "hardware" needs' in done.stdout


def test_a_native_form_is_a_file_of_the_methods_name():
    files = {path.stem for path in (Path(__file__).parents[1] / "shaders" / "hardware").glob("*.wgsl")}
    assert {id for id in NATIVE if not METHODS[id].sorts} == files & set(METHODS)


def test_modes_are_for_tiles():
    glow = ab.Mesh(scene()[0].positions, colors=scene()[0].colors, blend="additive", color_mode="face")
    with pytest.raises(
        ParameterError, match='pipeline "hardware" is for blend="over" alone, and there is \'additive\''
    ):
        ab.render(glow, CAMERA, **SIZE, method="depth_peeling", device="gpu", pipeline="hardware")
