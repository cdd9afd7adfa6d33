"""Methods that take blend modes: peelings are exact in all of them, and baselines blend in the order in which they paint."""

import numpy as np
import pytest

import abuffer as ab
import methods
from abuffer import ParameterError
from abuffer._methods import METHODS
from oracle_msaa import blend_lists

CAMERA = ab.Camera.look_at((0, 0, 4), (0, 0, 0))
SIZE = {"width": 61, "height": 45, "background": (0.1, 0.2, 0.3, 0.5)}
TAKE = [id for id in METHODS if "modes" in METHODS[id].flags and id != "exact"]
PEELINGS = [id for id in TAKE if id.endswith("depth_peeling")]
PAINTERS = [id for id in TAKE if METHODS[id].sorts]
MIXED = ab.BLENDS
WALL = ab.Mesh([[[-3, -3, -0.5], [3, -3, -0.5], [0, 3, -0.5]]], colors=(0.2, 0.5, 0.9), opaque=True)
# Float64 composites of a dozen layers of colours up to 1 round by some hundred 2⁻⁵³ at most, in whatever order.
ATOL = 1e-12


def test_peelings_and_baselines_take_modes():
    assert set(TAKE) == {"depth_peeling", "dual_depth_peeling", "unsorted", "object_sorted", "triangle_sorted"}


def meshes(modes=MIXED, opaque=False, seed=5, n=12):
    """Large triangles, a mesh and a mode each. A colour a face: what interpolation rounds is not the methods'."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-0.5, 0.5, (n, 1, 3)) + rng.uniform(-1, 1, (n, 3, 3)) * (2.5, 2.5, 1.5)
    colors = rng.uniform(0.05, 1, (n, 4))
    scene = [ab.Mesh(corners[i], colors=colors[i], blend=modes[i % len(modes)]) for i in range(n)]
    return [*scene, WALL] if opaque else scene


def panes(modes=MIXED, n=7):
    """Upright triangles, the farthest first: they neither cross nor tie."""
    rng = np.random.default_rng(3)
    colors = rng.uniform(0.05, 1, (n, 4))
    corners = rng.uniform(-0.3, 0.3, (n, 3, 2)) + [[-1, -1], [1, -1], [0, 1]]
    z = np.linspace(-1, 1, n)
    return [
        ab.Mesh(np.c_[corners[i], np.full(3, z[i])], colors=colors[i], blend=modes[i % len(modes)]) for i in range(n)
    ]


def image(scene, method="exact", **kw):
    return ab.render(scene, CAMERA, **SIZE, method=method, precision="float64", **kw).image


def lists(scene, samples=1):
    return ab.render(scene, CAMERA, **SIZE, precision="float64", samples=samples, fragments=True).fragments


def folded(frags, when):
    """Lists blended one fragment onto the other, `when` (primitives,) rising: a mean of samples (H, W, 4)."""
    order = np.lexsort((-when[frags.primitive], frags.pixel))
    height, width = frags.shape
    behind = frags.background.reshape(height * width, frags.samples, 4)
    modes = np.array(ab.BLENDS)[frags.blend[order]]
    total = 0.0
    for s in range(frags.samples):
        kept = np.ones(len(frags), bool) if frags.coverage is None else frags.coverage[order] >> s & 1 == 1
        total = total + blend_lists(frags.offsets, frags.color[order], behind[:, s], modes, kept)
    return (total / frags.samples).reshape(height, width, 4)


EACH = pytest.mark.parametrize("modes", [*((mode,) for mode in ab.BLENDS), MIXED], ids=lambda modes: "-".join(modes))
SURROUNDINGS = pytest.mark.parametrize(
    ("opaque", "samples"), [(opaque, samples) for opaque in (False, True) for samples in (1, 4)]
)


@EACH
@SURROUNDINGS
@pytest.mark.parametrize("method", PEELINGS)
def test_peelings_are_exact_in_any_mode(method, opaque, samples, modes):
    for seed in range(3):
        scene = meshes(modes, opaque, seed)
        got = image(scene, method, samples=samples)
        np.testing.assert_allclose(got, image(scene, samples=samples), rtol=0, atol=ATOL)


@pytest.mark.parametrize("mode", [mode for mode in ab.BLENDS if mode != "over"])
@pytest.mark.parametrize("method", PEELINGS)
def test_a_mode_that_was_taken_for_over_would_be_seen(method, mode):
    assert np.abs(image(meshes((mode,)), method) - image(meshes(("over",)))).max() > 0.1


@pytest.mark.parametrize("layers", [1, 2, 4])
def test_of_mixed_modes_too_the_nearest_layers_are_composited(layers):
    scene = meshes()
    frags = lists(scene)
    behind = frags.background.reshape(-1, 4)
    modes = np.array(ab.BLENDS)[frags.blend]
    wanted = blend_lists(frags.offsets, frags.color, behind, modes, kept=frags.layer < layers)
    got = image(scene, "depth_peeling", layers=layers)
    np.testing.assert_allclose(got.reshape(-1, 4), wanted, rtol=0, atol=ATOL)
    assert frags.counts.max() > layers


@EACH
@pytest.mark.parametrize("method", TAKE)
def test_what_comes_back_to_front_is_exact(method, modes):
    scene = panes(modes)
    np.testing.assert_allclose(image(scene, method), image(scene), rtol=0, atol=ATOL)
    if METHODS[method].sorts:
        np.testing.assert_allclose(image(scene[::-1], method), image(scene), rtol=0, atol=ATOL)


@EACH
@SURROUNDINGS
def test_unsorted_blends_in_the_order_of_submission(opaque, samples, modes):
    for seed in range(3):
        scene = meshes(modes, opaque, seed)
        frags = lists(scene, samples)
        if frags.blend is None:
            frags.blend = np.zeros(len(frags), np.uint8)
        got = image(scene, "unsorted", samples=samples)
        np.testing.assert_allclose(got, folded(frags, np.arange(13)), rtol=0, atol=ATOL)


def test_the_order_of_submission_would_be_told_from_its_reverse():
    frags = lists(meshes())
    assert np.abs(folded(frags, np.arange(13)) - folded(frags, -np.arange(13))).max() > 0.1


@SURROUNDINGS
@pytest.mark.parametrize("method", PAINTERS)
def test_painters_blend_in_the_order_in_which_they_paint(method, opaque, samples):
    """By the depth of the middle: of a mesh of one triangle that of its box, 4 − z here."""
    for seed in range(3):
        scene = meshes(MIXED, opaque, seed)
        z = np.array([mesh.positions[:, 2] for mesh in scene])
        middle = z.mean(axis=1) if method == "triangle_sorted" else (z.min(axis=1) + z.max(axis=1)) / 2
        frags = lists(scene, samples)
        got = image(scene, method, samples=samples)
        np.testing.assert_allclose(got, folded(frags, middle), rtol=0, atol=ATOL)
        assert np.abs(got - image(scene, "unsorted", samples=samples)).max() > 0.05


@EACH
@SURROUNDINGS
@pytest.mark.parametrize("method", TAKE)
def test_float32_and_gpus_agree_with_float64_in_any_mode(method, opaque, samples, modes, needs_gpu):
    scene = meshes(modes, opaque)
    double, single, gpu = (
        ab.render(scene, CAMERA, **SIZE, method=method, device=d, precision=p, pipeline="tiles", samples=samples)
        for d, p in (("cpu", "float64"), ("cpu", "float32"), ("gpu", "float32"))
    )
    # Additive layers add up to several times 1, and so do their roundings.
    atol = methods.tolerance(method) * max(1, double.image.max())
    np.testing.assert_allclose(single.image, double.image, rtol=0, atol=atol)
    np.testing.assert_allclose(gpu.image, single.image, rtol=0, atol=atol)


@SURROUNDINGS
@pytest.mark.parametrize("method", TAKE)
def test_a_render_of_mixed_modes_is_the_composite_of_its_lists(method, opaque, samples):
    scene = meshes(MIXED, opaque)
    frame = ab.render(scene, CAMERA, **SIZE, method=method, precision="float64", samples=samples, fragments=True)
    seen = {"scene": scene, "camera": CAMERA} if METHODS[method].sorts else {}
    again = frame.fragments.composite(method, **seen)
    np.testing.assert_allclose(frame.image, again, rtol=0, atol=ATOL)
    assert set(np.unique(frame.fragments.blend)) == set(range(5))


@pytest.mark.parametrize("method", TAKE)
def test_a_blend_of_ones_own_is_for_exact_alone(method, needs_gpu):
    darken = ab.Blend("min(dst, src.rgb)", lambda dst, src, depth: np.minimum(dst, src[:, :3]), "darken")
    scene = [*panes(), panes()[0].replaced(blend=darken)]
    refused = rf"method '{method}' takes the modes over, additive, .*, and there is .*'exact' alone"
    for device in ("cpu", "gpu"):
        with pytest.raises(ParameterError, match=refused):
            ab.render(scene, CAMERA, **SIZE, method=method, device=device)
    frags = ab.render(scene, CAMERA, **SIZE, device="cpu", fragments=True).fragments
    seen = {"scene": scene, "camera": CAMERA} if METHODS[method].sorts else {}
    with pytest.raises(ParameterError, match=refused):
        frags.composite(method, **seen)
