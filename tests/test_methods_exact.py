"""Closed forms of `exact`: the colours of stacks that can be said in a formula, and what changes no bit."""

import numpy as np
import pytest

import abuffer as ab
import methods

U64 = 2.0**-53
CAMERA = ab.Camera.look_at((0, 0, 4), (0, 0, 0))
SIZE = {"width": 61, "height": 45}
DEVICES = ["cpu", "gpu"]


def stack(colors, alphas, background=(0, 0, 0, 0), **options):
    """The exact image of greys, (n,), or RGB, (n, 3), front to back."""
    colors, alphas = np.asarray(colors, float), np.asarray(alphas, float)
    rgb = np.broadcast_to(colors[:, None] if colors.ndim == 1 else colors, (len(colors), 3))
    rgba = np.c_[rgb, np.broadcast_to(alphas, len(rgb))]
    return methods.lists_of(np.arange(1, len(rgb) + 1)[None], rgba[None], background=background).composite(**options)[
        0, 0
    ]


def assert_equal_to(got, wanted, n):
    """Within the forward error bound of n layers, γ_{2n+2} C, and as much again for the closed form."""
    np.testing.assert_allclose(got, wanted, rtol=4 * (n + 1) * U64, atol=0)


def test_geometric_colours_make_a_geometric_series():
    for n in (1, 2, 10, 100):
        for alpha in (0.01, 0.5, 0.9):
            for q in (0.3, 0.9):
                ratio = q * (1 - alpha)
                wanted = alpha * (1 - ratio**n) / (1 - ratio)
                assert_equal_to(stack(q ** np.arange(n), alpha)[0], wanted, n)


def test_alternating_white_and_black_are_a_series_of_every_other_power():
    for n in (1, 2, 3, 10, 101):
        for alpha in (0.1, 0.5, 0.9):
            r = 1 - alpha
            wanted = alpha * (1 - r ** (2 * -(-n // 2))) / (1 - r * r)
            assert_equal_to(stack((np.arange(n) + 1) % 2, alpha)[0], wanted, n)


def test_black_in_front_would_fail_that_formula():
    with pytest.raises(AssertionError):
        assert_equal_to(stack([0, 1, 0], 0.5)[0], 0.5 * (1 - 0.5**4) / 0.75, 3)


def test_red_over_green_over_blue():
    """The example of Enderton et al. 2010: alphas .45, .45 and 1."""
    assert_equal_to(stack(np.eye(3), [0.45, 0.45, 1]), [0.45, 0.2475, 0.3025, 1], 3)
    assert_equal_to(stack(np.eye(3)[:2], 0.45, background=(0, 0, 1)), [0.45, 0.2475, 0.3025, 1], 3)


def test_alphas_of_1_over_their_place_from_behind_make_the_mean():
    """`over` is then a running average: the i-th from behind has a share of 1/i."""
    colors = np.random.default_rng(1).random((200, 3))
    image = stack(colors, 1 / np.arange(200, 0, -1))
    assert_equal_to(image, [*colors.mean(axis=0), 1], 200)


def test_n_layers_of_alpha_1_over_n_approach_1_minus_1_over_e():
    for n in (10, 1000, 100_000):
        wanted = -np.expm1(n * np.log1p(-1 / n))
        assert_equal_to(stack(np.ones(n), 1 / n), wanted, n)
    assert abs(stack(np.ones(1000), 1 / 1000)[0] - 0.632305) < 5e-7
    # (1 − 1/n)ⁿ = (1 − 1/(2n) + …) / e
    assert abs(stack(np.ones(100_000), 1e-5)[0] - (1 - np.exp(-1))) < 0.51 * np.exp(-1) * 1e-5


def triangles(n=40, seed=3):
    """Random triangles and a colour of each, all values of float32."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1, 1, (n, 1, 3)) + rng.uniform(-0.6, 0.6, (n, 3, 3))
    return corners.astype(np.float32), rng.uniform(0.05, 1, (n, 4)).astype(np.float32)


def rendered(corners, colors, device, background=(0.25, 0.5, 0.125, 0.5), **options):
    mesh = ab.Mesh(corners, colors=colors)
    return ab.render(mesh, CAMERA, **SIZE, device=device, pipeline="tiles", background=background, **options)


@pytest.mark.parametrize("device", DEVICES)
def test_inserted_layers_of_alpha_0_change_no_bit(device, needs_gpu):
    """T + 0, T · 1 and C + 0 · c are exact."""
    corners, colors = triangles()
    more, their_colors = triangles(seed=4)
    mixed, mixed_colors = np.empty((80, 3, 3), np.float32), np.empty((80, 4), np.float32)
    mixed[::2], mixed[1::2] = corners, more
    mixed_colors[::2], mixed_colors[1::2] = colors, their_colors * np.float32([1, 1, 1, 0])
    wanted = rendered(corners, colors, device)
    image = rendered(mixed, mixed_colors, device).image
    np.testing.assert_array_equal(image, wanted.image)
    mixed_colors[1::2, 3] = 1e-3  # as it would show
    assert np.abs(rendered(mixed, mixed_colors, device).image - wanted.image).max() > 1e-4


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("method", ["exact", "depth_peeling", "dual_depth_peeling"])
def test_what_is_behind_alpha_1_changes_no_bit(device, method, needs_gpu):
    """0 times any colour is 0."""
    corners, colors = triangles(12)
    wall = np.float32([[-9, -9, 0.2], [9, -9, 0.2], [0, 9, 0.2]])
    images = []
    for shown in (1.0, 0.3):
        meshes = [ab.Mesh(wall, colors=(0.2, 0.3, 0.4, 1.0)), ab.Mesh(corners + [0, 0, 2], colors=colors)]
        meshes.append(ab.Mesh(corners - [0, 0, 2], colors=colors * np.float32(shown)))
        images.append(ab.render(meshes, CAMERA, **SIZE, device=device, pipeline="tiles", method=method).image)
    np.testing.assert_array_equal(*images)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("method", ["exact", "wboit"])
def test_colours_scaled_by_a_power_of_two_scale_every_bit(device, method, needs_gpu):
    """Exponents alone change, where nothing overflows: products and sums round alike."""
    corners, colors = triangles()
    image = rendered(corners, colors, device, method=method).image
    for k in (-8, 1, 10):
        scale = np.float32([2.0**k] * 3 + [1])
        scaled = rendered(corners, colors * scale, device, (np.float32([0.25, 0.5, 0.125, 0.5]) * scale), method=method)
        np.testing.assert_array_equal(scaled.image, image * scale)
    third = np.float32([3, 3, 3, 1])  # which is none
    scaled = rendered(corners, colors * third, device, np.float32([0.25, 0.5, 0.125, 0.5]) * third, method=method)
    assert (scaled.image != image * third).any()
