"""Tiles on a GPU and on the CPU hold the same fragments, bit for bit: masks, counts, keys, order, primitives."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

import abuffer as ab
from comparison import CPU32, GPU, GPU_TILES

pytestmark = pytest.mark.usefixtures("needs_gpu")
PERSPECTIVE = ab.Camera.look_at((0.1, 0.2, 3), (0, 0, 0), fov_y=60.0)
BETWEEN_PLANES = ab.Camera.look_at((0, 0, 3), (0, 0, 0), near=2.5, far=4.0)
INSIDE = ab.Camera.look_at((0.1, 0.2, 0), (0, 0, -1), fov_y=70.0)
PARALLEL = ab.Camera.orthographic((0, 0, 3), (0, 0, 0), height=3.0)
CAMERAS = {"perspective": PERSPECTIVE, "planes": BETWEEN_PLANES, "inside": INSIDE, "parallel": PARALLEL}
SIZE = {"width": 130, "height": 97}


def assert_same_lists(cpu, gpu):
    a, b = cpu.fragments, gpu.fragments
    np.testing.assert_array_equal(a.counts, b.counts)
    for name in ("key", "depth", "primitive", "coverage", "blend"):
        mine, yours = getattr(a, name), getattr(b, name)
        assert (mine is None) == (yours is None), name
        if mine is not None:
            np.testing.assert_array_equal(mine, yours, name)
    assert cpu.stats.rejected_triangles == gpu.stats.rejected_triangles


def both(scene, camera, **options):
    options = {**SIZE, "fragments": True} | options
    return (pipeline.render(scene, camera, **options) for pipeline in (CPU32, GPU_TILES))


def cloud(n, seed, size=1.0, spread=1.0):
    rng = np.random.default_rng(seed)
    return rng.normal(0, spread, (n, 1, 3)) + rng.normal(0, size, (n, 3, 3))


def colors(shape, seed=7):
    return np.random.default_rng(seed).uniform(0, 1, (*shape, 4))


@pytest.mark.parametrize("samples", [1, 2, 4, 8, 16])
@pytest.mark.parametrize("camera", CAMERAS)
def test_lists_have_the_cpus_bits(camera, samples):
    for seed, size in ((1, 1.0), (2, 0.05)):
        mesh = ab.Mesh(cloud(80, seed, size), colors=colors((80, 3)))
        cpu, gpu = both(mesh, CAMERAS[camera], samples=samples)
        assert cpu.stats.fragments > 100
        assert_same_lists(cpu, gpu)


@pytest.mark.parametrize("fragments", [True, "all"])
@pytest.mark.parametrize("samples", [1, 4])
@pytest.mark.parametrize("mode", ["over", "screen"])
def test_opaque_and_cut_out_surfaces_hide_what_they_hide_on_the_cpu(mode, samples, fragments):
    p = cloud(80, 5)
    scene = ab.Scene(
        [
            ab.Mesh(p[:30], colors=colors((30,)), opaque=True),
            ab.Mesh(p[30:], colors=colors((50, 3)), blend=mode),
            ab.Mesh(p[:20] + 0.01, colors=colors((20, 3)), alpha_cutoff=0.5, opaque=True, cull="back"),
        ]
    )
    cpu, gpu = both(scene, BETWEEN_PLANES, samples=samples, fragments=fragments)
    assert_same_lists(cpu, gpu)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e12])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_scenes_of_any_size_and_far_away_have_the_cpus_bits(scale, dtype):
    center = np.array([3e5, -7e5, 2e5]) * scale
    p = (cloud(200, 11) * scale + center).astype(dtype)
    camera = ab.Camera.look_at(center + (0, 0, 5 * scale), center)
    assert_same_lists(*both(ab.Mesh(p, colors=colors((200,))), camera))


@pytest.mark.parametrize("size", [(1, 1), (17, 16), (2100, 40), (40, 2100)], ids=str)
def test_any_size_of_image_has_the_cpus_bits(size):
    width, height = size
    mesh = ab.Mesh(cloud(300, 13, 0.4), colors=colors((300,)))
    assert_same_lists(*both(mesh, PERSPECTIVE, width=width, height=height))


def test_more_triangles_than_a_chunk_and_a_bin_start_with_keep_their_order():
    flat = np.tile(np.float32([[-1, -1, 0], [1, -1, 0], [0, 1, 0]]), (3000, 1, 1))
    cpu, gpu = both(ab.Mesh(flat, colors=(1, 1, 1, 0.01)), PERSPECTIVE, width=40, height=30)
    assert cpu.counts.max() == 3000
    assert_same_lists(cpu, gpu)


def test_triangles_of_several_blocks_of_a_chunk_are_all_binned():
    """Over 262,144 triangles a workgroup bins several blocks one after the other."""
    rng = np.random.default_rng(0)
    center = rng.uniform(0, 1, (270_000, 1, 3)) * (991, 558, 1)
    mesh = ab.Mesh(center + rng.uniform(-1, 1, (270_000, 3, 3)), colors=(1, 0, 0, 0.5))
    camera = ab.Camera.orthographic((495.5, 279, 9), (495.5, 279, 0), height=558)
    cpu, gpu = both(mesh, camera, width=991, height=558, fragments="count")
    np.testing.assert_array_equal(gpu.counts, cpu.counts)


def test_a_list_longer_than_a_software_drivers_loops_is_whole():
    flat = np.tile(np.float32([[-9, -9, 0], [9, -9, 0], [0, 9, 0]]), (70_000, 1, 1))
    frame = GPU_TILES.render(ab.Mesh(flat, colors=(1, 1, 1, 1e-5)), PERSPECTIVE, width=3, height=2, fragments="count")
    assert (frame.counts == 70_000).all()


def test_a_scene_of_nothing_is_the_background():
    for mesh in (ab.Mesh(np.zeros((0, 3, 3))), ab.Mesh(cloud(9, 1, 1e-30)), ab.Mesh(cloud(9, 1) + (0, 0, 99))):
        cpu, gpu = both(mesh, PERSPECTIVE, background=(0.2, 0.4, 0.6, 0.5))
        np.testing.assert_array_equal(cpu.image, gpu.image)


def test_repeats_have_the_same_bits():
    mesh = ab.Mesh(cloud(2000, 17, 0.2), colors=colors((2000, 3)))
    first = GPU_TILES.render(mesh, PERSPECTIVE, **SIZE, fragments=True)
    for _ in range(50):
        again = GPU_TILES.render(mesh, PERSPECTIVE, **SIZE, fragments=True)
        np.testing.assert_array_equal(again.image, first.image)
        np.testing.assert_array_equal(again.fragments.key, first.fragments.key)
        np.testing.assert_array_equal(again.fragments.primitive, first.fragments.primitive)


def test_hardware_does_not_have_these_bits():
    """The comparison can fail: window coordinates are snapped otherwise, or keys rounded otherwise."""
    mesh = ab.Mesh(cloud(500, 19), colors=colors((500, 3)))
    cpu = CPU32.render(mesh, PERSPECTIVE, **SIZE, fragments=True)
    with pytest.raises(AssertionError):
        assert_same_lists(cpu, GPU.render(mesh, PERSPECTIVE, **SIZE, fragments=True))


# ---- what is resolved in registers: images alone, counts, and lists ----


def assert_same_image(scene, camera, **options):
    """Counts and lists as on the CPU, and the image within roundings of it; without them the same bits again."""
    cpu, gpu = both(scene, camera, **(options | {"fragments": "count"}))
    np.testing.assert_array_equal(gpu.counts, cpu.counts)
    assert (gpu.stats.fragments, gpu.stats.max_depth_complexity) == (
        cpu.stats.fragments,
        cpu.stats.max_depth_complexity,
    )
    assert np.isfinite(gpu.image).all()
    # Flat colours: 2(n + 1) roundings of a sum of parts of at most 1. Corners' colours round as barycentric ones do.
    interpolated = any(mesh.color_mode in ("vertex", "corner") for mesh in ab.Scene([scene]).meshes)
    bound = 2 * (cpu.counts.max() + 1) * 2.0**-24 + (1e-4 if interpolated else 0)
    assert np.abs(gpu.image - cpu.image).max() <= bound
    alone = GPU_TILES.render(scene, camera, **({**SIZE, "fragments": False} | options))
    np.testing.assert_array_equal(alone.image, gpu.image)
    listed_cpu, listed = both(scene, camera, **options)
    assert_same_lists(listed_cpu, listed)
    np.testing.assert_array_equal(listed.image, gpu.image)
    behind = listed_cpu.fragments.background
    assert np.abs(listed.fragments.background - behind).max() <= (1e-4 if interpolated else 0)
    return gpu


BEHIND = np.random.default_rng(3).uniform(0, 1, (SIZE["height"], SIZE["width"], 4))


@pytest.mark.parametrize("background", [(0.2, 0.4, 0.6, 0.5), BEHIND], ids=["colour", "image"])
@pytest.mark.parametrize("rate", ["one", "face", "vertex", "corner"])
@pytest.mark.parametrize("camera", CAMERAS)
def test_images_are_the_cpus_whatever_gives_colours(camera, rate, background):
    p = cloud(40, 23, 0.4)
    shape = {"one": (), "face": (40,), "vertex": (120,), "corner": (40, 3)}[rate]
    faces = np.arange(120).reshape(40, 3)
    mesh = ab.Mesh(p.reshape(-1, 3), faces, colors=colors(shape), color_mode=rate)
    assert_same_image(mesh, CAMERAS[camera], background=background)


@pytest.mark.parametrize(
    ("n", "size"),
    [(9, 1.0), (60, 0.6), (400, 0.1), (3000, 0.03), (30_000, 0.02)],
    ids=["few", "some", "many", "small", "tiny"],
)
def test_images_are_the_cpus_whatever_class_a_tile_is_in(n, size):
    frame = assert_same_image(ab.Mesh(cloud(n, 29, size), colors=colors((n,))), PERSPECTIVE)
    assert frame.plan["pipeline"] == "tiles"


def test_meshes_of_different_rates_find_their_own_colours():
    p = cloud(30, 31, 0.3)
    meshes = [
        ab.Mesh(p[:10], colors=(1, 0, 0, 0.5)),
        ab.Mesh(p[10:20], colors=colors((10,))),
        ab.Mesh(p[20:], colors=(0, 1, 0, 0.5)),
    ]
    assert_same_image(meshes, PERSPECTIVE)
    assert_same_image([*meshes, ab.Mesh(p[:5] + 0.1, colors=colors((5, 3)))], PERSPECTIVE)


def test_opaque_surfaces_hide_and_show_behind_what_nothing_lists():
    p = cloud(60, 37, 0.5)
    scene = [
        ab.Mesh(p[:20], colors=colors((20,)), opaque=True),
        ab.Mesh(p[20:40], colors=colors((20, 3)), opaque=True, alpha_cutoff=0.5),
        ab.Mesh(p[40:], colors=colors((20,))),
    ]
    assert_same_image(scene, PERSPECTIVE, background=(0.1, 0.2, 0.3, 1))


def test_faces_in_one_place_are_ordered_by_primitive():
    flat = np.tile(np.float32([[-1, -1, 0], [1, -1, 0], [0, 1, 0]]), (7, 1, 1))
    assert_same_image(ab.Mesh(flat, colors=colors((7,))), PERSPECTIVE)


@pytest.mark.parametrize("layers", [6, 20])
@pytest.mark.parametrize("hides", [False, True])
def test_small_triangles_in_deep_pixels_are_sorted_in_registers_too(layers, hides):
    """Layers of triangles of some 8 pixels, crooked, so that their depths cross; a software driver's registers hold 8."""
    x, y = (v.ravel() for v in np.meshgrid(np.arange(-4, 68, 4.0), np.arange(-4, 52, 4.0)))
    halves = np.array([[(0, 0), (4, 0), (0, 4)], [(4, 0), (4, 4), (0, 4)]])
    flat = (halves[None] + np.stack([x, y], 1)[:, None, None]).reshape(-1, 3, 2)
    rng = np.random.default_rng(53)
    sheets = [np.concatenate([flat, rng.uniform(0, 2, (len(flat), 3, 1)) - k], 2) for k in range(layers)]
    scene = [ab.Mesh(sheet, colors=colors((len(flat),), k)) for k, sheet in enumerate(sheets)]
    if hides:
        scene.append(ab.Mesh([[[-9, -9, -3], [90, -9, -1], [-9, 90, -1]]], colors=(0, 1, 0), opaque=True))
    camera = ab.Camera.orthographic((32, 24, 9), (32, 24, 0), height=48)
    frame = assert_same_image(scene, camera, width=64, height=48)
    if ("software" in frame.plan["device"]) == (layers == 6):
        assert "deep triangles" in frame.plan["tile classes"]


@pytest.mark.parametrize("n", [8, 16, 17, 63, 64, 65, 200])
def test_a_pixel_deeper_than_any_class_is_rendered_whole(n):
    rng = np.random.default_rng(41)
    flat = np.tile(np.float32([[-1, -1, 0], [1, -1, 0], [0, 1, 0]]), (n, 1, 1)) + rng.permutation(n)[:, None, None] * (
        0,
        0,
        0.01,
    )
    frame = assert_same_image(ab.Mesh(flat, colors=colors((n,)) * (1, 1, 1, 0.2)), PERSPECTIVE, width=40, height=30)
    assert frame.stats.max_depth_complexity == n


def two_layers():
    """Small triangles, of which no pixel has many."""
    x, y = np.meshgrid(np.linspace(-1.4, 1.4, 60), np.linspace(-1.4, 1.4, 60))
    at = np.stack([x, y, x * 0], axis=-1).reshape(-1, 1, 3)
    return np.concatenate([at + cloud(3600, 43, 0.02, 0), at + cloud(3600, 44, 0.02, 0)])


def test_the_same_image_in_bands_where_memory_is_short():
    mesh = ab.Mesh(two_layers(), colors=colors((7200,)))
    whole = GPU_TILES.render(mesh, PERSPECTIVE, width=320, height=320, fragments="count")
    several = GPU_TILES.render(mesh, PERSPECTIVE, width=320, height=320, fragments="count", memory=30_000)
    assert (whole.stats.bands, several.stats.bands > 1) == (1, True)
    assert several.stats.fragments == whole.stats.fragments
    np.testing.assert_array_equal(several.image, whole.image)
    np.testing.assert_array_equal(several.counts, whole.counts)
    with pytest.raises(ab.CapacityError, match="one row of tiles"):
        GPU_TILES.render(mesh, PERSPECTIVE, width=320, height=320, memory=1000)


@pytest.mark.parametrize("memory", [None, 120_000, 50_000])
def test_sorted_lists_come_in_as_many_bands_as_they_take(memory):
    """Two layers of small triangles, so that registers do, and more fragments than a pixel is first given room for."""
    mesh = ab.Mesh(two_layers(), colors=colors((7200,)))
    cpu, gpu = both(mesh, PERSPECTIVE, width=320, height=320, memory=memory)
    assert gpu.plan["lists"] == "sorted"
    assert (gpu.stats.bands > 1) == (memory is not None)
    assert memory is None or gpu.stats.bytes["nodes"] < memory
    assert_same_lists(cpu, gpu)


@pytest.mark.parametrize("fragments", [True, "count"])
@pytest.mark.parametrize("samples", [1, 4])
def test_bins_that_do_not_fit_memory_come_in_bands_whatever_is_listed(samples, fragments):
    """Opaque surfaces are drawn, and lists of several samples or of pixels too deep for registers made, band after band."""
    deep = np.tile(np.float32([[-0.5, -1.4, 0.5], [0.5, -1.4, 0.5], [0, 1.4, 0.5]]), (70, 1, 1))
    scene = [
        ab.Mesh(two_layers(), colors=colors((7200,))),
        ab.Mesh(cloud(6, 61, 0.7), colors=colors((6,)), opaque=True),
        ab.Mesh(deep, colors=(0, 0, 1, 0.05)),
    ]
    asked = {"width": 320, "height": 320, "samples": samples, "fragments": fragments}
    cpu, gpu = both(scene, PERSPECTIVE, **asked, memory=120_000)
    np.testing.assert_array_equal(gpu.counts, cpu.counts)
    whole = GPU_TILES.render(scene, PERSPECTIVE, **asked)
    np.testing.assert_array_equal(gpu.image, whole.image)
    assert (whole.stats.bands, gpu.stats.bands > 1) == (1, True)
    if fragments is True:
        assert_same_lists(cpu, gpu)


def test_more_bins_than_there_are_at_once_come_in_bands():
    """512 bins of 256×256 pixels are what one band has."""
    p = cloud(300, 67, 0.02) * (6, 0.03, 1)
    mesh = ab.Mesh(p, colors=colors((300,)))
    camera = ab.Camera.orthographic((0, 0, 9), (0, 0, 0), height=0.2)
    asked = {"width": 16384, "height": 2200, "samples": 2, "fragments": "count"}
    cpu, gpu = both(mesh, camera, **asked)
    assert cpu.stats.fragments > 100_000
    np.testing.assert_array_equal(gpu.counts, cpu.counts)


def test_lists_that_do_not_fit_a_row_of_tiles_are_still_whole():
    mesh = ab.Mesh(cloud(40, 5, 0.6), colors=colors((40,)))
    cpu, gpu = both(mesh, PERSPECTIVE, memory=20_000)
    assert gpu.plan["lists"] != "sorted"
    assert_same_lists(cpu, gpu)


def test_more_fragments_than_pixels_are_listed_whole():
    flat = np.tile(np.float32([[-9, -9, 0], [9, -9, 0], [0, 9, 0]]), (7, 1, 1))
    mesh = ab.Mesh(flat + np.arange(7)[:, None, None] * np.float32([0, 0, 0.1]), colors=(1, 0, 0, 0.5))
    cpu, gpu = both(mesh, PERSPECTIVE)
    assert gpu.plan["lists"] == "sorted"
    assert gpu.stats.fragments == 7 * SIZE["width"] * SIZE["height"]
    assert_same_lists(cpu, gpu)


def test_an_image_of_one_triangle_more_is_seen():
    """The comparison can fail."""
    p = cloud(40, 47, 0.4, 0.2)
    cpu, _ = both(ab.Mesh(p, colors=(1, 0, 0, 0.5)), PERSPECTIVE, fragments="count")
    _, gpu = both(ab.Mesh(p[1:], colors=(1, 0, 0, 0.5)), PERSPECTIVE, fragments="count")
    assert np.abs(cpu.image - gpu.image).max() > 0.01


# ---- random scenes ----

# Halves of a pixel on a 64-pixel image: corners on centres, shared edges, duplicates, slivers, and some far outside.
ON_GRID = st.integers(-10, 138).map(lambda i: (i / 2 - 32) / 32)
NEAR = st.tuples(ON_GRID, ON_GRID, st.sampled_from([-0.5, 0.0, 0.25]))
FAR = st.tuples(*[st.floats(-40, 40, width=32)] * 3)
CORNERS = st.lists(st.one_of(NEAR, NEAR, NEAR, FAR), min_size=3, max_size=12)


@st.composite
def soups(draw):
    corners = np.float64(draw(CORNERS))
    index = st.integers(0, len(corners) - 1)
    faces = draw(st.lists(st.tuples(index, index, index), min_size=1, max_size=24))
    return corners, faces


def assert_soup_is_the_same(soup, camera, samples):
    corners, faces = soup
    mesh = ab.Mesh(corners, faces, colors=colors((len(corners),)), color_mode="vertex")
    assert_same_lists(*both(mesh, camera, width=64, height=64, samples=samples))


@given(soups(), st.sampled_from([ab.Camera.orthographic((0, 0, 3), (0, 0, 0), height=2.0), PERSPECTIVE]))
@settings(max_examples=100, deadline=None, derandomize=True)
def test_random_soups_have_the_cpus_bits(soup, camera):
    assert_soup_is_the_same(soup, camera, 1)


@pytest.mark.slow
@given(soups(), st.sampled_from(list(CAMERAS.values())), st.sampled_from([1, 1, 4]))
@settings(max_examples=2000, deadline=None, derandomize=True)
def test_two_thousand_random_soups_have_the_cpus_bits(soup, camera, samples):
    assert_soup_is_the_same(soup, camera, samples)
