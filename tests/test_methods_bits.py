"""What changes no bit of an image, whatever it is rounded to: for every method of which it holds, on every pipeline."""

import numpy as np
import pytest

import abuffer as ab
import methods
from abuffer._methods import METHODS
from sheets import pipelines_of, unit

CAMERA = ab.Camera.look_at((0, 0, 4), (0, 0, 0))
SIZE = {"width": 24, "height": 18}
BEHIND = np.float32([0.25, 0.5, 0.125, 0.5])
RANGE = (1.0, 10.0)
ALL = [("exact", {}), *methods.variants()]


def everywhere(variants):
    """On the CPU, and with defaults on GPUs."""
    cases = [(v, p) for v in variants for p in pipelines_of(v[0]) if p.device == "cpu" or not v[1]]
    names = [f"{methods.name_of(variant)}-{pipeline}" for variant, pipeline in cases]
    return pytest.mark.parametrize(("variant", "pipeline"), cases, ids=names)


def flagged(flag):
    """By the table, which is of defaults: a limit of layers leaves out what is behind invisible ones."""
    return [(id, options) for id, options in ALL if flag in METHODS[id].flags and "layers" not in options]


def triangles(n=12, seed=3):
    """Random triangles and a colour of each, all values of float32."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1, 1, (n, 1, 3)) + rng.uniform(-0.9, 0.9, (n, 3, 3))
    return corners.astype(np.float32), rng.uniform(0.05, 1, (n, 4)).astype(np.float32)


def rendered(variant, pipeline, scene, background=BEHIND, scale=1.0):
    id, options = variant
    if METHODS[id].takes_range:
        options = options | {"depth_range": np.multiply(RANGE, scale)}
    camera = ab.Camera.look_at((0, 0, 4 * scale), (0, 0, 0))
    return pipeline.render(scene, camera, **SIZE, method=id, background=background, **options).image


@everywhere(flagged("noop_alpha0"))
def test_inserted_layers_of_alpha_0_change_no_bit(variant, pipeline):
    """T + 0, T · 1 and C + 0 · c are exact. But the two ends of dual peeling meet elsewhere, and what is shaded by an
    absorbance is so relatively to the least one, that of an invisible fragment too: both round otherwise."""
    (corners, colors), (more, their_colors) = triangles(), triangles(seed=4)
    # Between the others; or after them, where draws go by the number of a primitive.
    after = variant[0] == "stochastic"
    here, there = (slice(12), slice(12, None)) if after else (slice(0, None, 2), slice(1, None, 2))
    mixed, mixed_colors = np.empty((24, 3, 3), np.float32), np.empty((24, 4), np.float32)
    mixed[here], mixed[there] = corners, more
    mixed_colors[here], mixed_colors[there] = colors, their_colors * np.float32([1, 1, 1, 0])
    wanted = rendered(variant, pipeline, ab.Mesh(corners, colors=colors))
    image = rendered(variant, pipeline, ab.Mesh(mixed, colors=mixed_colors))
    if variant[0] in ("dual_depth_peeling", "wavelet", "fourier"):
        np.testing.assert_allclose(image, wanted, rtol=2 * (3 * 24 + 2) * unit(pipeline))
    else:
        np.testing.assert_array_equal(image, wanted)
    mixed_colors[there, 3] = 0.5  # as they would show
    assert np.abs(rendered(variant, pipeline, ab.Mesh(mixed, colors=mixed_colors)) - wanted).max() > 1e-3


@everywhere(flagged("opaque_front"))
def test_what_is_behind_a_nearest_layer_of_alpha_1_changes_no_bit(variant, pipeline):
    """0 times any colour is 0."""
    corners, colors = triangles()
    images = []
    for alpha, shown in ((1, 1.0), (1, 0.3), (0.9, 1.0), (0.9, 0.3)):
        wall = ab.Mesh([[-9, -9, 2.5], [9, -9, 2.5], [0, 9, 2.5]], colors=(0.2, 0.3, 0.4, alpha))
        behind = ab.Mesh(corners, colors=colors * np.float32([shown, shown, shown, 1]))
        images.append(rendered(variant, pipeline, [wall, behind]))
    np.testing.assert_array_equal(images[0], images[1])
    assert variant[1] or (images[2] != images[3]).any()  # a limit of one may leave all of it out


@everywhere([variant for variant in ALL if variant[0] in ("exact", "depth_peeling", "dual_depth_peeling")])
def test_what_is_behind_alpha_1_anywhere_changes_no_bit_of_what_is_exact(variant, pipeline):
    corners, colors = triangles()
    images = []
    for alpha, shown in ((1, 1.0), (1, 0.3), (0.9, 1.0), (0.9, 0.3)):
        wall = ab.Mesh([[-9, -9, 0.2], [9, -9, 0.2], [0, 9, 0.2]], colors=(0.2, 0.3, 0.4, alpha))
        front = ab.Mesh(corners[:6] * [1, 1, 0.2] + [0, 0, 1.5], colors=colors[:6])
        behind = ab.Mesh(corners - [0, 0, 2], colors=colors * np.float32(shown))
        images.append(rendered(variant, pipeline, [wall, front, behind]))
    np.testing.assert_array_equal(images[0], images[1])
    assert variant[1] or (images[2] != images[3]).any()


@everywhere(ALL)
def test_colours_scaled_by_a_power_of_two_scale_every_bit(variant, pipeline):
    """Exponents alone change, where nothing overflows: products and sums round alike."""
    corners, colors = triangles()
    image = rendered(variant, pipeline, ab.Mesh(corners, colors=colors))
    assert (image != rendered(variant, pipeline, [])).any()
    for k in (-8, 10):
        scale = np.float32([2.0**k] * 3 + [1])
        scaled = rendered(variant, pipeline, ab.Mesh(corners, colors=colors * scale), BEHIND * scale)
        np.testing.assert_array_equal(scaled, image * scale)


@pytest.mark.parametrize("pipeline", pipelines_of("exact"), ids=str)
def test_another_scale_would_round_otherwise(pipeline):
    corners, colors = triangles()
    third = np.float32([3, 3, 3, 1])
    image = rendered(("exact", {}), pipeline, ab.Mesh(corners, colors=colors))
    scaled = rendered(("exact", {}), pipeline, ab.Mesh(corners, colors=colors * third), BEHIND * third)
    assert (scaled != image * third).any()
    np.testing.assert_allclose(scaled, image * third, rtol=60 * methods.U)


@everywhere(ALL)
def test_a_scene_64_times_as_large_gives_the_same_image_unless_weights_are_of_its_depth(variant, pipeline):
    """To the bit where depths are compared alone, and where they are part of a range but for its logarithm."""
    corners, colors = triangles()
    image, larger = (
        rendered(variant, pipeline, ab.Mesh(corners * np.float32(s), colors=colors), scale=s) for s in (1.0, 64.0)
    )
    id, options = variant
    if id == "wboit" and options.get("weight", "7") in "789":
        assert np.abs(larger - image).max() > 1e-3
    elif id in ("wavelet", "fourier", "mboit"):
        # Moments of layers that almost touch may differ by more: see methods.TOLERANCE.
        assert np.quantile(np.abs(larger - image), 0.99) < 1e-4
    else:
        np.testing.assert_array_equal(larger, image)
