"""Invariants of every method: those that its row of the table names hold, the others fail; and all pipelines agree."""

import numpy as np
import pytest

import abuffer as ab
import methods
from abuffer import ParameterError, _core
from abuffer._methods import METHODS, parameters
from abuffer.method import FLAGS
from abuffer.own_methods import BUILT_IN

CAMERA = ab.Camera.look_at((0, 0, 4), (0, 0, 0))
SIZE = {"width": 61, "height": 45}
# What sorts triangles needs more than lists: tests/test_methods_painter.py.
OF_LISTS = [id for id in METHODS if not METHODS[id].sorts]


def scene(opaque=False, seed=5, n=40):
    """Triangles, perhaps a wall among them. A colour a face: what interpolation rounds is not the methods'."""
    rng = np.random.default_rng(seed)
    triangles = rng.uniform(-1, 1, (n, 1, 3)) + rng.uniform(-0.6, 0.6, (n, 3, 3))
    meshes = [ab.Mesh(triangles, colors=rng.uniform(0.05, 1, (n, 4)))]
    if opaque:
        meshes.append(ab.Mesh([[[-3, -3, -0.5], [3, -3, -0.5], [0, 3, -0.5]]], colors=(0.2, 0.5, 0.9), opaque=True))
    return meshes


def seen(id, scene):
    """What composite is given beside lists."""
    return {"scene": scene, "camera": CAMERA} if METHODS[id].sorts else {}


def test_the_core_and_the_table_have_the_same_methods():
    # Beside them the core has what tells how far off some may be.
    assert set(_core.methods()) - {"bounds"} == {id for id in BUILT_IN if not METHODS[id].sorts}


@pytest.mark.parametrize("flag", sorted(set(FLAGS) - {"modes"}))
@pytest.mark.parametrize("id", OF_LISTS)
def test_a_flag_says_whether_an_invariant_holds(id, flag):
    """One that is false must fail: else it says nothing, or the test shows nothing."""
    worst = np.abs(methods.OFF[flag]((id, {}))).max()
    if flag in METHODS[id].flags:
        assert worst < 1e-10, f"{FLAGS[flag]}: off by {worst:.3g}"
    else:
        assert worst > 1e-4, f"{FLAGS[flag]}: off by {worst:.3g} alone, though the table says that it does not hold"


@pytest.mark.parametrize("mode", [mode for mode in ab.BLENDS if mode != "over"])
@pytest.mark.parametrize("id", METHODS)
def test_modes_are_taken_or_refused(id, mode):
    """What takes them blends a single fragment exactly (test_methods_modes.py has more of them)."""
    mesh = ab.Mesh([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], colors=(1, 0.5, 0, 0.5), blend=mode)
    look = {**SIZE, "device": "cpu", "background": (0.2, 0.4, 0.6, 0.5)}
    exact = ab.render(mesh, CAMERA, **look, fragments=True)
    if "modes" in METHODS[id].flags:
        np.testing.assert_allclose(ab.render(mesh, CAMERA, **look, method=id).image, exact.image, rtol=8 * methods.U)
        again = exact.fragments.composite(id, **seen(id, mesh))
        np.testing.assert_allclose(again, exact.fragments.composite(), rtol=1e-15)
        return
    refused = f"is for blend=\"over\" alone, and there is '{mode}'"
    with pytest.raises(ParameterError, match=refused):
        ab.render(mesh, CAMERA, **look, method=id)
    with pytest.raises(ParameterError, match=refused):
        exact.fragments.composite(id, **seen(id, mesh))


@pytest.mark.parametrize("samples", [1, 4])
@pytest.mark.parametrize("opaque", [False, True])
@pytest.mark.parametrize("variant", methods.variants(), ids=methods.name_of)
def test_a_render_is_the_composite_of_its_lists(variant, opaque, samples):
    """In float64 to the last digits: both resolve the same fragments, and a mean of four rounds."""
    id, options = variant
    if METHODS[id].takes_range:
        options = options | {"depth_range": (2.0, 6.0)}
    background = (0.1, 0.2, 0.3, 0.5)
    frame = ab.render(
        scene(opaque), CAMERA, **SIZE, method=id, precision="float64", fragments=True, samples=samples,
        background=background, **options,
    )  # fmt: skip
    again = frame.fragments.composite(id, **options, **seen(id, scene(opaque)))
    np.testing.assert_allclose(frame.image, again, rtol=1e-12, atol=1e-15)
    assert np.isfinite(frame.image).all()


@pytest.mark.parametrize("samples", [1, 4])
@pytest.mark.parametrize("opaque", [False, True])
@pytest.mark.parametrize("variant", methods.variants(), ids=methods.name_of)
def test_float32_and_gpus_agree_with_float64(variant, opaque, samples, needs_gpu):
    id, options = variant
    n = methods.TRIANGLES.get(id, 40)
    images = {}
    for device, precision in (("cpu", "float64"), ("cpu", "float32"), ("gpu", "float32")):
        frame = ab.render(
            scene(opaque, n=n), CAMERA, **SIZE, method=id, device=device, precision=precision, pipeline="tiles",
            samples=samples, background=(0.1, 0.2, 0.3, 0.5), fragments="count", **options,
        )  # fmt: skip
        images[device, precision] = frame
        assert np.isfinite(frame.image).all()
    double, single, gpu = images.values()
    np.testing.assert_allclose(single.image, double.image, atol=methods.tolerance(id))
    np.testing.assert_allclose(gpu.image, single.image, atol=methods.tolerance(id))
    np.testing.assert_array_equal(gpu.counts, single.counts)
    for what in ("fragments", "max_depth_complexity", "dropped_fragments", "merged_fragments"):
        assert getattr(gpu.stats, what) == getattr(single.stats, what), what


def test_that_agreement_would_fail_for_another_parameter(needs_gpu):
    """The comparison above tells k = 2 from k = 3."""
    images = [
        ab.render(scene(), CAMERA, **SIZE, method="k_buffer", k=k, device=device, pipeline="tiles").image
        for k, device in ((2, "cpu"), (3, "gpu"))
    ]
    assert np.abs(images[0] - images[1]).max() > 10 * methods.tolerance("k_buffer")


@pytest.mark.parametrize("variant", methods.variants(), ids=methods.name_of)
def test_lists_come_with_any_method(variant, needs_gpu):
    id, options = variant
    wanted = ab.render(scene(), CAMERA, **SIZE, device="cpu", fragments=True).fragments
    for device in ("cpu", "gpu"):
        frame = ab.render(
            scene(), CAMERA, **SIZE, method=id, device=device, pipeline="tiles", fragments=True, **options
        )
        np.testing.assert_array_equal(frame.fragments.key, wanted.key)
        np.testing.assert_array_equal(frame.fragments.primitive, wanted.primitive)


@pytest.mark.parametrize(
    ("id", "device", "fragments", "apart"),
    [
        ("wboit", "cpu", True, False),
        ("wboit", "cpu", "all", True),
        ("wboit", "gpu", True, True),
        ("wboit", "gpu", "count", False),
        ("triangle_sorted", "cpu", True, True),
        ("exact", "gpu", "all", False),
    ],
)
def test_times_of_lists_that_are_rendered_by_themselves_say_so(id, device, fragments, apart, needs_gpu):
    """Beside an image that opaque surfaces hide in, that is painted in another order, or that a GPU keeps no lists for."""
    given = {**SIZE, "method": id, "device": device, "pipeline": "tiles"}
    frame = ab.render(scene(True), CAMERA, **given, fragments=fragments)
    assert any(stage.startswith("lists: ") for stage in frame.stats.ms) == apart
    np.testing.assert_array_equal(frame.image, ab.render(scene(True), CAMERA, **given).image)


@pytest.mark.parametrize("id", [id for id in METHODS if id != "exact"])
def test_an_empty_pixel_shows_the_background(id, needs_gpu):
    background = (0.1, 0.2, 0.3, 0.5)
    wanted = np.float32([0.05, 0.1, 0.15, 0.5])
    for device in ("cpu", "gpu"):
        frame = ab.render(
            scene(), ab.Camera.look_at((0, 0, 4), (0, 0, 9)), **SIZE, method=id, device=device, pipeline="tiles",
            background=background,
        )  # fmt: skip
        np.testing.assert_allclose(frame.image, np.broadcast_to(wanted, frame.image.shape), atol=1e-7)


def test_what_tiles_hold_in_parts_is_the_same_image(needs_gpu):
    """An image of more rows than one binding has room for, and an image in bands of bins."""
    whole = ab.render(scene(), CAMERA, **SIZE, method="wboit", device="gpu", pipeline="tiles")
    banded = ab.render(scene(), CAMERA, **SIZE, method="wboit", device="gpu", pipeline="tiles", memory=2048)
    np.testing.assert_array_equal(whole.image, banded.image)


def test_pipelines_of_lists_have_exact_alone(needs_gpu):
    with pytest.raises(ParameterError, match="pipeline 'linked_list' does not have method 'wboit'"):
        ab.render(scene(), CAMERA, **SIZE, method="wboit", device="gpu", pipeline="linked_list")
    assert ab.render(scene(), CAMERA, **SIZE, method="wboit", device="gpu").plan["pipeline"] == "tiles"


def test_the_plan_says_that_times_are_of_a_replay():
    for id in METHODS:
        frame = ab.render(scene(), CAMERA, **SIZE, method=id, device="cpu")
        assert [choice for what, choice, _ in frame.plan if what == "cost"] == ([] if id == "exact" else ["replayed"])


def test_unknown_parameters_name_the_methods_that_have_them():
    with pytest.raises(ParameterError, match=r"k is no parameter of method 'wboit', which has weight.*k_buffer"):
        ab.render(scene(), CAMERA, **SIZE, method="wboit", k=4)
    with pytest.raises(ParameterError, match="did you mean 'weight'"):
        ab.render(scene(), CAMERA, **SIZE, method="wboit", wieght="7")
    with pytest.raises(ParameterError, match="has no argument 'cutoff' and method 'wboit' no option of that name"):
        ab.render(scene(), CAMERA, **SIZE, method="wboit", cutoff=0.1)
    with pytest.raises(ParameterError, match=r"method must be one of .*; did you mean 'wboit'"):
        ab.render(scene(), CAMERA, **SIZE, method="woit")


@pytest.mark.parametrize("id", METHODS)
def test_parameters_out_of_range_are_refused(id):
    for parameter in METHODS[id].parameters:
        bad = ["nonsense", None]
        if not parameter.choices and not isinstance(parameter.default, bool):
            bad += [parameter.low - 1, np.nan, *([parameter.high + 1] if np.isfinite(parameter.high) else [])]
            bad += [1.5] if parameter.is_integer else []
        for value in bad:
            with pytest.raises(ParameterError, match=parameter.name):
                ab.render(scene(), CAMERA, **SIZE, device="cpu", method=id, **{parameter.name: value})


def test_a_depth_range_is_two_rising_depths():
    for value in (3, (2, 1), (0, np.inf), (-np.inf, 1), (np.nan, 1), (0, np.nan), "ab"):
        with pytest.raises(ParameterError, match="depth_range"):
            ab.render(scene(), CAMERA, **SIZE, device="cpu", method="wboit", depth_range=value)


@pytest.mark.parametrize("value", [(0, 1e39), (-1e39, 1), (-3e38, 3e38)], ids=str)
def test_a_depth_range_that_float32_does_not_hold_is_refused(value):
    with pytest.raises(ParameterError, match=r"depth_range(\[\d\])? must .*3\.4"):
        ab.render(scene(), CAMERA, **SIZE, device="cpu", method="wboit", depth_range=value)


@pytest.mark.parametrize("device", ["cpu", "gpu"])
@pytest.mark.parametrize("id", [id for id in METHODS if METHODS[id].takes_range])
def test_a_depth_range_that_is_one_depth_in_float32_is_one_depth(id, device, needs_gpu):
    options = {"weight": "10"} if id == "wboit" else {}
    given = {**SIZE, "method": id, "device": device, "pipeline": "tiles", **options}
    rounded, one, apart = (
        ab.render(scene(), CAMERA, **given, depth_range=of).image for of in ((3, 3 + 1e-9), (3, 3), (3, 3.1))
    )
    np.testing.assert_array_equal(rounded, one)
    assert np.isfinite(one).all()
    assert np.abs(apart - one).max() > 1e-3


def test_no_parameter_is_named_like_an_argument_or_another_option():
    assert not set(parameters()) & {*ab.job.ARGUMENTS, *ab.options.EXACT_OPTIONS}


@pytest.mark.parametrize("device", ["cpu", "gpu"])
@pytest.mark.parametrize("id", ["wboit", "unsorted", "triangle_sorted"])
def test_listing_opaque_surfaces_changes_no_image(id, device, needs_gpu):
    """With "all" they are in the lists, and hide in the image as ever."""
    given = {**SIZE, "method": id, "device": device, "pipeline": "tiles"}
    plain, all_listed = (ab.render(scene(True), CAMERA, **given, fragments=f) for f in (False, "all"))
    np.testing.assert_array_equal(all_listed.image, plain.image)
    assert all_listed.stats.fragments == all_listed.counts.sum() == len(all_listed.fragments)
    assert (all_listed.fragments.primitive == 40).any()  # the wall


def test_the_depth_range_is_that_of_the_vertices_that_translucent_triangles_have():
    rng = np.random.default_rng(0)
    positions, colors = rng.uniform(-1, 1, (24, 3)), rng.uniform(0, 1, (8, 4))
    faces = np.arange(24).reshape(8, 3)
    with_unused = ab.Mesh(np.vstack([positions, [[0, 0, -1e6]]]), faces, colors=colors)
    image, wanted = (
        ab.render(m, CAMERA, **SIZE, method="mboit", device="cpu")
        for m in (with_unused, ab.Mesh(positions, faces, colors=colors))
    )
    np.testing.assert_array_equal(image.image, wanted.image)
    depths = 4 - positions[:, 2]
    assert image.plan["depth range"] == f"{depths.min():g} to {depths.max():g}"
    # What is far away leaves the nearest depth where it is; an eye amid the scene does not.
    far = ab.Mesh([[-1e4, 0, -1e4], [1e4, 0, -1e4], [0, 1e4, -1e4]], colors=(1, 1, 1, 0.5))
    ranges = [
        ab.render([far, with_unused], camera, **SIZE, method="mboit", device="cpu").plan["depth range"]
        for camera in (CAMERA, ab.Camera.look_at((0, 0, 0), (0, 0, -1)))
    ]
    assert ranges == [f"{depths.min():g} to 10004", "10 to 10000"]


def test_a_cost_is_told_for_several_parameters():
    row = ab.methods()["mlab"]
    assert row["bytes per pixel"] == "32; 8 with k=1; 16 with k=2; 64 with k=8; 512 with k=64"
    assert ab.methods()["stochastic"]["passes"] == "1; 2 with estimator='c'"
    for id in METHODS:
        assert set(ab.methods()[id]) >= {"title", "source", "order", "passes", "bytes per pixel", "parameters", "exact"}
