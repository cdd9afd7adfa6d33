"""What every pipeline promises, run on each: ties, order, opaque geometry, memory, depth complexity."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import abuffer as ab
import scenes
from abuffer import _core
from comparison import CPU32, CPU64, GPU, GPU_TILES, U

EVERY = pytest.mark.parametrize("pipeline", [CPU32, CPU64, GPU, GPU_TILES], ids=str)
FRONT = ab.Camera(*scenes.front_camera())


def quad(z, color, size=4.0, **kw):
    """Two triangles that cover the view of FRONT at eye depth 3 − z."""
    p = np.float32([[-size, -size, z], [size, -size, z], [size, size, z], [-size, size, z]])
    return ab.Mesh(p, [[0, 1, 2], [0, 2, 3]], color, **kw)


def over(*layers, background=(0, 0, 0, 0)):
    """Straight RGBA layers, front first, composited in float64."""
    color, alpha, through = np.zeros(3), 0.0, 1.0
    for layer in (*layers, background):
        color = color + through * layer[3] * np.array(layer[:3])
        alpha += through * layer[3]
        through *= 1 - layer[3]
    return np.array([*color, alpha])


@EVERY
def test_layers_composite_front_to_back_whatever_their_order(pipeline):
    near, far = (0.9, 0.2, 0.1, 0.5), (0.1, 0.8, 0.4, 0.25)
    behind = (0.2, 0.3, 0.4, 1.0)
    for order in ([quad(1, near), quad(0, far)], [quad(0, far), quad(1, near)]):
        image = pipeline.render(order, FRONT, width=9, height=9, background=behind).image
        np.testing.assert_allclose(image, np.broadcast_to(over(near, far, background=behind), (9, 9, 4)), rtol=6 * U)


@EVERY
def test_a_shared_edge_through_pixel_centres_is_neither_doubled_nor_missed(pipeline):
    counts = pipeline.render(quad(0, (1, 1, 1, 0.5)), FRONT, width=16, height=16, fragments="count").counts
    assert (counts == 1).all()


@EVERY
def test_a_closed_surface_seen_from_outside_has_an_even_count_everywhere(pipeline):
    frame = pipeline.render(ab.Mesh(scenes.nested_icospheres(3, 3)[0]), FRONT, width=128, height=128, fragments="count")
    assert frame.counts.max() >= 6
    assert (frame.counts % 2 == 0).all()


@EVERY
def test_of_equal_depths_the_later_primitive_is_in_front(pipeline):
    triangles, colors = scenes.duplicates()
    frags = pipeline.render(ab.Mesh(triangles, colors=colors), FRONT, width=32, height=32, fragments=True).fragments
    tied = (frags.pixel[1:] == frags.pixel[:-1]) & (frags.key[1:] == frags.key[:-1])
    assert tied.sum() > 300
    assert (frags.primitive[:-1][tied] > frags.primitive[1:][tied]).all()


@EVERY
def test_all_four_copies_of_a_face_tie_however_they_are_rotated_or_wound(pipeline):
    triangles, colors = scenes.duplicates(n=1)
    frags = pipeline.render(ab.Mesh(triangles, colors=colors), FRONT, width=32, height=32, fragments=True).fragments
    counts = frags.counts[frags.counts > 0]
    assert (counts == 4).all()
    assert (frags.key.reshape(-1, 4) == frags.key.reshape(-1, 4)[:, :1]).all()
    assert (frags.primitive.reshape(-1, 4) == [3, 2, 1, 0]).all()


@EVERY
def test_permuting_the_triangles_changes_no_bit_but_the_order_of_ties(pipeline):
    a, b = scenes.random_triangles(200, 0.5, seed=5), scenes.duplicates(n=6)
    triangles, colors = np.concatenate([a[0], b[0]]), np.concatenate([a[1], b[1]])
    size = {"width": 64, "height": 48, "fragments": True}
    camera = ab.Camera(*scenes.front_camera(64 / 48))
    first = pipeline.render(ab.Mesh(triangles, colors=colors), camera, **size)
    tied_fragment = (first.fragments.pixel[1:] == first.fragments.pixel[:-1]) & (
        first.fragments.key[1:] == first.fragments.key[:-1]
    )
    tied = np.zeros(64 * 48, bool)
    tied[first.fragments.pixel[1:][tied_fragment]] = True
    assert 0 < tied.mean() < 0.5
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(len(triangles))
        frame = pipeline.render(ab.Mesh(triangles[order], colors=colors[order]), camera, **size)
        frags = frame.fragments
        np.testing.assert_array_equal(frags.offsets, first.fragments.offsets)
        np.testing.assert_array_equal(frags.key, first.fragments.key)
        free = ~tied[frags.pixel]
        np.testing.assert_array_equal(order[frags.primitive][free], first.fragments.primitive[free])
        np.testing.assert_array_equal(frags.color[free], first.fragments.color[free])
        untied = ~tied.reshape(48, 64)
        np.testing.assert_array_equal(frame.image[untied], first.image[untied])
        # Tied pixels hold the first list re-sorted by the new indices.
        new = np.argsort(order)[first.fragments.primitive]
        resorted = np.lexsort((-new, first.fragments.key, first.fragments.pixel))
        np.testing.assert_array_equal(new[resorted], frags.primitive)


@EVERY
def test_every_pixel_of_the_image_is_its_own_list_composited(pipeline):
    triangles, colors = scenes.random_triangles(600, 0.6, seed=8)
    frame = pipeline.render(
        ab.Mesh(triangles, colors=colors), FRONT, width=80, height=80, fragments=True, background=(0.1, 0.2, 0.3, 0.7)
    )
    wanted = frame.fragments.composite()
    # 2(n + 1)u C for float32 lists composited in float32; all terms are positive, so it is relative to C.
    n = frame.fragments.counts[..., None]
    assert (np.abs(frame.image - wanted) <= 2 * (n + 1) * U * wanted).all()
    shallow = (n <= 16) & (wanted.max(axis=-1, keepdims=True) <= 1)
    assert np.abs(np.where(shallow, frame.image - wanted, 0)).max() <= 1e-6


@EVERY
def test_opaque_geometry_hides_what_is_strictly_behind_and_becomes_the_background(pipeline):
    front, wall, behind = (1, 0, 0, 0.5), (0, 0.5, 1, 0.3), (0, 1, 0, 0.5)
    scene = [quad(-1, behind), quad(0, wall, opaque=True), quad(1, front)]
    frame = pipeline.render(scene, FRONT, width=8, height=8, fragments=True)
    assert (frame.fragments.counts == 1).all()
    assert (frame.fragments.primitive // 2 == 2).all()
    np.testing.assert_array_equal(frame.fragments.background, np.broadcast_to(np.float32([0, 0.5, 1, 1]), (8, 8, 4)))
    np.testing.assert_allclose(frame.image, np.broadcast_to(over(front, (0, 0.5, 1, 1)), (8, 8, 4)), rtol=6 * U)
    np.testing.assert_allclose(frame.fragments.composite(), frame.image, rtol=6 * U)


@EVERY
@pytest.mark.parametrize("translucent_first", [True, False])
def test_a_fragment_at_the_opaque_depth_is_kept_in_front_of_it(pipeline, translucent_first):
    wall, film = quad(0, (0, 0.5, 1), opaque=True), quad(0, (1, 0, 0, 0.5))
    scene = [film, wall] if translucent_first else [wall, film]
    frame = pipeline.render(scene, FRONT, width=8, height=8, fragments=True)
    assert (frame.fragments.counts == 1).all()
    np.testing.assert_allclose(frame.image[0, 0], over((1, 0, 0, 0.5), (0, 0.5, 1, 1)), rtol=6 * U)
    listed = pipeline.render(scene, FRONT, width=8, height=8, fragments="all")
    np.testing.assert_array_equal(listed.image, frame.image)


@EVERY
def test_of_two_opaque_surfaces_at_one_depth_the_later_shows(pipeline):
    scene = [quad(0, (1, 0, 0), opaque=True), quad(0, (0, 1, 0), opaque=True)]
    assert (pipeline.render(scene, FRONT, width=4, height=4).image == [0, 1, 0, 1]).all()


@EVERY
def test_alpha_cutoff_makes_holes_and_leaves_the_rest_opaque(pipeline):
    p = np.float32([[-4, -4, 0], [4, -4, 0], [4, 4, 0], [-4, 4, 0]])
    colors = np.float32([[1, 1, 1, 0], [1, 1, 1, 1], [1, 1, 1, 1], [1, 1, 1, 0]])  # alpha rises from left to right
    leaf = ab.Mesh(p, [[0, 1, 2], [0, 2, 3]], colors, color_mode="vertex", opaque=True, alpha_cutoff=0.5)
    image = pipeline.render(leaf, FRONT, width=16, height=16).image
    assert (image[:, :8] == 0).all()
    assert (image[:, 8:] == 1).all()


@EVERY
def test_fragments_all_lists_opaque_surfaces_too_hiding_nothing(pipeline):
    scene = [quad(-1, (0, 1, 0, 0.5)), quad(0, (0, 0.5, 1, 0.3), opaque=True), quad(1, (1, 0, 0, 0.5))]
    every = pipeline.render(scene, FRONT, width=8, height=8, fragments="all")
    assert (every.fragments.counts == 3).all()
    assert (every.fragments[3, 3].primitive // 2 == [2, 1, 0]).all()
    assert every.fragments[3, 3].color[1, 3] == 1
    np.testing.assert_array_equal(every.image, pipeline.render(scene, FRONT, width=8, height=8).image)


@EVERY
def test_the_plan_says_when_lists_are_empty_because_all_is_opaque(pipeline):
    frame = pipeline.render(quad(0, (1, 0, 0), opaque=True), FRONT, width=4, height=4, fragments=True)
    assert len(frame.fragments) == 0
    assert "opaque" in str(frame.plan)


@EVERY
@pytest.mark.parametrize("cull", [None, "back", "front"])
@pytest.mark.parametrize("flipped", [False, True])
def test_cull_drops_one_side_by_the_winding_given(pipeline, cull, flipped):
    p = np.float32([[-4, -4, 0], [4, -4, 0], [0, 8, 0]])  # counter-clockwise for the eye
    mesh = ab.Mesh(p[::-1] if flipped else p, colors=(1, 1, 1, 0.5), cull=cull)
    seen = pipeline.render(mesh, FRONT, width=8, height=8).stats.fragments > 0
    assert seen == (cull is None or (cull == "back") != flipped)


@EVERY
def test_cull_holds_for_triangles_that_reach_behind_the_eye(pipeline):
    floor = np.float32([[-50, -1, 50], [50, -1, 50], [0, -1, -50]])  # seen from above; counter-clockwise there
    counts = {
        cull: pipeline.render(ab.Mesh(floor, cull=cull), FRONT, width=16, height=16).stats.fragments
        for cull in (None, "back", "front")
    }
    assert counts["back"] == counts[None] > 0
    assert counts["front"] == 0


@EVERY
def test_near_and_far_cut_where_they_say(pipeline):
    layers = [quad(3 - depth, (1, 1, 1, 0.5), size=40) for depth in (0.5, 1.5, 2.5, 3.5)]
    camera = ab.Camera.look_at((0, 0, 3), (0, 0, 0), near=1.0, far=3.0)
    frags = pipeline.render(layers, camera, width=8, height=8, fragments=True).fragments
    assert (frags.counts == 2).all()
    np.testing.assert_allclose(frags[4, 4].depth, [1.5, 2.5], rtol=1e-6)


@EVERY
@pytest.mark.parametrize("depth", [1e-6, 1e-3, 1.0, 1e3, 1e6])
def test_without_near_and_far_any_depth_in_front_of_the_eye_is_drawn(pipeline, depth):
    camera = ab.Camera.look_at((0, 0, 0), (0, 0, -1))
    layers = [quad(-depth * k, (1, 1, 1, 0.5), size=2 * depth) for k in (1.0, 1 + 2**-18)]
    frags = pipeline.render(layers, camera, width=8, height=8, fragments=True).fragments
    assert (frags.counts == 2).all(), "two layers that standard window z would merge"
    assert (frags.primitive.reshape(-1, 2) // 2 == [0, 1]).all()
    np.testing.assert_allclose(frags.depth.reshape(-1, 2)[:, 0], depth, rtol=1e-6)


@EVERY
def test_nothing_behind_an_orthographic_eye_is_drawn(pipeline):
    camera = ab.Camera.orthographic((0, 0, 0), (0, 0, -1), height=2)
    frags = pipeline.render(
        [quad(1, (1, 1, 1, 0.5)), quad(-1, (1, 1, 1, 0.5))], camera, width=8, height=8, fragments=True
    ).fragments
    assert (frags.counts == 1).all()
    np.testing.assert_allclose(frags.depth, 1, rtol=1e-6)


@EVERY
def test_triangles_that_overflow_are_rejected_and_counted(pipeline):
    far = 1.7e308 if pipeline is CPU64 else 1e200
    huge = np.float64([[0, 0, -1], [far, 0, -1], [0, far, -1]])
    frame = pipeline.render([ab.Mesh(huge), quad(0, (1, 1, 1, 0.5))], FRONT, width=8, height=8)
    assert frame.stats.rejected_triangles == 1
    np.testing.assert_allclose(frame.image[..., 3], 0.5)


@EVERY
def test_an_image_background_shows_through_pixel_by_pixel(pipeline):
    background = np.random.default_rng(0).uniform(0, 1, (6, 7, 4)).astype(np.float32)
    glass = (1, 0, 0, 0.25)
    frame = pipeline.render(quad(0, glass), ab.Camera.look_at((0, 0, 3), (0, 0, 0)), background=background)
    wanted = [[over(glass, background=background[y, x].astype(float)) for x in range(7)] for y in range(6)]
    np.testing.assert_allclose(frame.image, wanted, rtol=6 * U)


@EVERY
def test_a_small_memory_gives_the_same_bits(pipeline):
    triangles, colors = scenes.random_triangles(3000, 0.4, seed=9)
    wall = quad(-0.2, (0.3, 0.3, 0.3), opaque=True)
    scene = [ab.Mesh(triangles, colors=colors), wall]
    size = {"width": 100, "height": 90, "fragments": True}
    camera = ab.Camera(*scenes.front_camera(100 / 90))
    large = pipeline.render(scene, camera, **size)
    # Enough for the fullest tile (the CPU bins triangles, the GPU stores nodes), too little for the image.
    memory = "1.5MB" if pipeline.device == "gpu" else "40kB"
    small = pipeline.render(scene, camera, memory=memory, **size)
    assert small.stats.bands > 1
    assert large.stats.bands == 1
    np.testing.assert_array_equal(small.image, large.image)
    for field in ("offsets", "key", "primitive", "color"):
        np.testing.assert_array_equal(getattr(small.fragments, field), getattr(large.fragments, field))


@EVERY
def test_too_small_a_memory_says_what_it_needs(pipeline):
    triangles, colors = scenes.layers(3000, 0.01)
    with pytest.raises(ab.CapacityError, match=r"\d+ bytes are needed, but the limit is \d+ bytes; .*memory="):
        pipeline.render(ab.Mesh(triangles, colors=colors), FRONT, width=16, height=16, memory=4096)


@EVERY
def test_renders_repeat_bit_for_bit(pipeline):
    triangles, colors = scenes.random_triangles(500, 0.5, seed=11)
    scene = ab.Mesh(triangles, colors=colors)
    first = pipeline.render(scene, FRONT, width=64, height=64, fragments=True)
    for _ in range(3):
        again = pipeline.render(scene, FRONT, width=64, height=64, fragments=True)
        np.testing.assert_array_equal(again.image, first.image)
        np.testing.assert_array_equal(again.fragments.primitive, first.fragments.primitive)


def stack(n, seed=0):
    """n flat layers in random order: colours and alphas such that the deepest still matter."""
    rng = np.random.default_rng(seed)
    triangles, colors = np.empty((n, 3, 3), np.float32), np.empty((n, 4), np.float32)
    # Steps of 2^-20 relative and more: distinct in float32 through every rounding of 1/w.
    depth = np.geomspace(1.0, 4.0, n) if n <= 1000 else 1 + np.arange(n) * 2.0**-18
    order = rng.permutation(n)
    for i, d in zip(order, depth, strict=True):
        triangles[i] = [[-8 * d, -8 * d, -d], [24 * d, -8 * d, -d], [-8 * d, 24 * d, -d]]
    colors[:, :3], colors[:, 3] = rng.uniform(0, 1, (n, 3)), 1.0 / n
    return triangles, colors, order


@EVERY
@pytest.mark.parametrize("n", [31, 32, 33, 64, 65, 1000, 100_000])
def test_depth_complexity_has_no_limit(pipeline, n):
    triangles, colors, order = stack(n)
    camera = ab.Camera.look_at((0, 0, 0), (0, 0, -1))
    frame = pipeline.render(ab.Mesh(triangles, colors=colors), camera, width=3, height=2, fragments=True)
    assert frame.stats.max_depth_complexity == n
    assert frame.stats.fragments == 6 * n
    assert (frame.fragments.primitive.reshape(6, n) == order).all()
    wanted = over(*colors[order].astype(np.float64))
    bound = 2 * (n + 1) * U * wanted  # forward error of n-layer over
    assert (np.abs(frame.image - wanted) <= bound).all()


def test_one_pixel_of_200_000_nodes_is_resolved_over_several_dispatches():
    n = 200_000  # llvmpipe silently ends every loop of an invocation after 65,535 iterations in total
    triangles, colors, order = stack(n)
    camera = ab.Camera.look_at((0, 0, 0), (0, 0, -1))
    frame = GPU.render(ab.Mesh(triangles, colors=colors), camera, width=1, height=1, fragments="count")
    assert frame.counts.tolist() == [[n]]
    wanted = over(*colors[order].astype(np.float64))
    assert (np.abs(frame.image[0, 0] - wanted) <= 2 * (n + 1) * U * wanted).all()


def test_more_nodes_than_a_binding_holds_are_rendered_in_bands(needs_gpu):
    """llvmpipe binds 128 MiB, 8.4 million colours; these are 10.5 million fragments, at the default memory."""
    triangles, colors = scenes.layers(40, 0.05)
    mesh = ab.Mesh(triangles, colors=colors)
    frame = GPU.render(mesh, FRONT, width=512, height=512, fragments="count")
    binding = next(a["max_binding"] for a in _core.adapters() if a["name"] == frame.stats.device)
    assert (frame.stats.bands > 1) == (16 * frame.stats.fragments > binding)
    assert (frame.counts == 40).all()
    np.testing.assert_allclose(frame.image, CPU32.render(mesh, FRONT, width=512, height=512).image, rtol=84 * U)


def test_without_a_forced_early_depth_test_the_shader_compares_depths(tmp_path, needs_gpu):
    """What Metal and DX12 do; also without timestamps, which no device must have."""
    script = """if True:
        import sys, numpy as np, abuffer as ab, scenes
        triangles, colors = scenes.random_triangles(200, 0.5, seed=3)
        wall = ab.Mesh(scenes.covering()[0], opaque=True)
        frame = ab.render([wall, ab.Mesh(triangles, colors=colors)], ab.Camera(*scenes.front_camera()),
                          width=48, height=48, device="gpu", pipeline="linked_list", fragments=True)
        np.savez(sys.argv[1], image=frame.image, key=frame.fragments.key)
        print(sorted(frame.stats.ms))
    """
    printed, arrays = [], []
    for without in ("", "SHADER_EARLY_DEPTH_TEST,TIMESTAMP_QUERY"):
        path = tmp_path / f"{len(arrays)}.npz"
        environment = os.environ | {
            "ABUFFER_WITHOUT": without,
            "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")]),
        }
        run = subprocess.run([sys.executable, "-c", script, path], env=environment, capture_output=True, text=True)
        assert run.returncode == 0, run.stderr
        printed.append(run.stdout)
        arrays.append(np.load(path))
    assert "build" in printed[0]
    assert "build" not in printed[1], "the features were not withheld"
    assert len(arrays[0]["key"]) > 1000
    np.testing.assert_array_equal(arrays[0]["image"], arrays[1]["image"])
    np.testing.assert_array_equal(arrays[0]["key"], arrays[1]["key"])


@settings(max_examples=60, derandomize=True, deadline=None)
@given(data=st.data())
def test_cpu_precisions_agree_on_any_small_scene(data):
    """Not a bound: float32 and float64 lists of the same random triangles have the same fragments off their edges."""
    n = data.draw(st.integers(1, 6))
    values = st.integers(-400, 400).map(lambda i: i / 128)
    corners = data.draw(st.lists(values, min_size=9 * n, max_size=9 * n))
    triangles = np.float32(corners).reshape(n, 3, 3)
    size = {"width": 24, "height": 24, "fragments": "count"}
    single = CPU32.render(ab.Mesh(triangles), FRONT, **size)
    double = CPU64.render(ab.Mesh(triangles), FRONT, **size)
    # Snapping to 1/256 pixel lands the two on neighbouring positions at most: few pixels can differ.
    assert (single.counts != double.counts).mean() <= 0.02
