"""The planner's law: model only what a scene requires. One test for each thing that a scene does not pay for."""

import numpy as np
import pytest

import abuffer as ab
import scenes
from comparison import CPU32, GPU

FRONT = ab.Camera(*scenes.front_camera(aspect=4 / 3))
SIZE = {"width": 64, "height": 48}
SMALL = "rgba8_depth32"  # the format that has room for nothing else


def layers(n, blend="over"):
    triangles, colors = scenes.layers(n, 0.3)
    return ab.Mesh(triangles, colors=colors, blend=blend)


def wall(z=-1.0):
    return ab.Mesh(scenes.covering(z)[0], colors=(0.3, 0.3, 0.3), opaque=True)


def node_bytes(*meshes, **options):
    frame = GPU.render(list(meshes), FRONT, **SIZE, **options)
    return int(frame.plan["node format"].split(", ")[1].removesuffix(" bytes"))


def why(frame, what):
    return next(reason for name, _, reason in frame.plan if name == what)


def test_one_sample_a_pixel_takes_no_coverage_bits(needs_gpu):
    assert node_bytes(layers(3)) == 28
    assert node_bytes(layers(3), samples=4) == 32
    assert why(GPU.render(layers(3), FRONT, **SIZE), "samples") == "no coverage bits"


def test_coverage_rides_in_the_spare_bits_of_a_format_that_has_some(needs_gpu):
    spare = "rgba8_depth24_coverage8"
    assert node_bytes(layers(3), samples=4, node_format=spare) == node_bytes(layers(3), node_format=spare) == 12


def test_a_scene_that_is_all_over_takes_no_mode_ids(needs_gpu):
    assert node_bytes(layers(3), node_format=SMALL) == 12
    assert node_bytes(layers(3), layers(3, "additive"), node_format=SMALL) == 16
    frame = GPU.render(layers(3), FRONT, **SIZE)
    assert frame.plan["blend"] == "all over"
    assert why(frame, "blend") == "no mode ids"


def test_mode_ids_ride_beside_the_primitive_where_there_is_one(needs_gpu):
    assert node_bytes(layers(3), layers(3, "additive")) == node_bytes(layers(3)) == 28


def test_opaque_meshes_that_would_blend_otherwise_are_no_reason_for_mode_ids(needs_gpu):
    assert node_bytes(layers(3), wall(), node_format=SMALL) == 12


def test_primitives_are_kept_only_where_something_asks_for_them(needs_gpu):
    assert node_bytes(layers(3), node_format=SMALL) == 12
    assert node_bytes(layers(3), node_format=SMALL, fragments=True) == 16
    assert node_bytes(layers(3), node_format=SMALL, max_sorted_fragments=2, limit_policy="last_submitted") == 16
    assert node_bytes(layers(3), node_format=SMALL, max_sorted_fragments=2) == 12


def test_without_opaque_geometry_there_is_no_depth_target_and_no_opaque_pass(needs_gpu):
    pixels = SIZE["width"] * SIZE["height"]
    without, with_wall = (GPU.render(meshes, FRONT, **SIZE) for meshes in (layers(3), [layers(3), wall()]))
    assert without.plan["opaque geometry"] == "none"
    assert "opaque" not in without.stats.ms
    assert without.stats.bytes["targets"] == pixels  # a byte that nothing is written to
    assert with_wall.stats.bytes["targets"] == (4 + 16) * pixels  # depth and colour
    assert "opaque" in with_wall.stats.ms


def test_opaque_geometry_that_is_listed_hides_nothing_and_has_no_target(needs_gpu):
    frame = GPU.render([layers(3), wall()], FRONT, **SIZE, fragments="all")
    assert frame.plan["opaque geometry"] == "none"


def test_without_translucent_geometry_there_are_no_lists(needs_gpu):
    frame = GPU.render(wall(), FRONT, **SIZE)
    assert "nodes" not in frame.stats.bytes
    assert not any(stage.startswith(("build", "classify", "resolve")) for stage in frame.stats.ms)
    np.testing.assert_array_equal(frame.image, CPU32.render(wall(), FRONT, **SIZE).image)


def test_only_the_classes_that_lists_fall_into_are_named(needs_gpu):
    frame = GPU.render(layers(9), FRONT, **SIZE)
    assert frame.plan["resolve classes"] == "9–16"
    assert why(frame, "resolve classes") == "longest list 9"
    assert [stage for stage in frame.stats.ms if stage.startswith("resolve")] in (["resolve 9–16"], [])


def test_tiles_without_translucent_geometry_are_counted_and_not_resolved(needs_gpu):
    small = ab.Mesh(np.float32([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]]), colors=(1, 0, 0, 0.5))
    frame = GPU.render(small, FRONT, width=320, height=240)
    filled, of, tiles, *_ = frame.plan["tiles"].split()
    assert of == "of"
    assert int(filled) <= 4
    assert int(tiles) == 20 * 15
    assert frame.stats.bytes["heads"] < 320 * 240  # of the rectangle alone


def test_modes_that_are_affine_go_front_to_back_and_a_blend_of_ones_own_does_not(needs_gpu):
    assert GPU.render(layers(3, "screen"), FRONT, **SIZE).plan["direction"] == "front to back"
    own = ab.Blend("dst * src.rgb")
    assert GPU.render(layers(3, own), FRONT, **SIZE).plan["direction"] == "back to front"


def test_samples_are_resolved_apart_only_where_that_is_asked_for(needs_gpu):
    together, apart = (
        GPU.render(layers(3), FRONT, **SIZE, samples=4, msaa_resolve=resolve) for resolve in ("per_pixel", "per_sample")
    )
    assert "average" not in together.stats.ms
    assert "average" in apart.stats.ms
    assert (
        apart.stats.bytes["image band"] - together.stats.bytes["image band"] >= 4 * 16 * 64 * 48 - 64
    )  # no buffer is empty


def test_a_pool_that_expects_right_draws_the_geometry_once(needs_gpu):
    frame = GPU.render(layers(40), FRONT, **SIZE)
    assert frame.stats.fragments == 40 * 64 * 48
    assert frame.stats.bytes["nodes"] <= 28 * (1.1 * frame.stats.fragments + 4096)
    assert "count" not in frame.stats.ms


@pytest.mark.parametrize("pipeline", [CPU32, GPU], ids=str)
def test_the_plan_is_a_few_readable_lines(pipeline):
    text = str(pipeline.render([layers(9), wall()], FRONT, **SIZE).plan)
    assert 6 <= len(text.splitlines()) <= 16
    assert all(len(line) < 130 and line.endswith(")") and ": " in line for line in text.splitlines())
    for what in ("device", "pipeline", "samples", "blend", "direction", "rectangle", "tiles", "bands"):
        assert f"{what}: " in text
