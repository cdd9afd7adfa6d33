"""Columns of rows: times are of the frames, costs are the published ones."""

import math

import numpy as np
import pytest

import abuffer as ab
from abuffer.comparing import measuring
from abuffer.comparing.entries import entries
from comparisons import CAMERA, QUICK, SHEETS, SIZE


def rows_of(*methods, **arguments):
    found = ab.compare(SHEETS, CAMERA, **SIZE, **QUICK | arguments, methods=list(methods))
    assert [row["failure"] for row in found.rows] == [""] * len(found.rows)
    return found.rows


def test_times_are_quartiles_of_frames():
    times = [(float(ms), 10.0 * ms, {"walk": ms, "sort": 1.0}) for ms in (5, 1, 2, 4, 3)]
    found = measuring._times(times)
    assert (found["wall_ms_q1"], found["wall_ms"], found["wall_ms_q3"]) == (2, 3, 4)
    assert (found["gpu_ms_q1"], found["gpu_ms"], found["gpu_ms_q3"]) == (20, 30, 40)
    assert found["stage_ms"] == {"walk": 3, "sort": 1.0}
    assert found["frames"] == 5


def test_gpu_time_is_that_of_its_stages_but_for_the_hosts():
    class Stats:
        device, gpu_ms = "a GPU", None
        ms = {"upload": 5.0, "walk": 1.0, "sort": 0.5, "wait and readback": 9.0}

    assert measuring.gpu_ms(Stats) == 1.5
    Stats.gpu_ms = 1.25
    assert measuring.gpu_ms(Stats) == 1.25
    Stats.device = "cpu"
    assert math.isnan(measuring.gpu_ms(Stats))


def test_of_what_takes_seconds_a_few_frames_are_timed(monkeypatch):
    monkeypatch.setattr(measuring, "MOST_SECONDS", 0.0)
    (row,) = rows_of("exact", repeats=30, warmup=30)
    assert row["frames"] == measuring.SAME == 3
    monkeypatch.setattr(measuring, "MOST_SECONDS", 10.0)
    assert rows_of("exact", repeats=30)[0]["frames"] == 30
    assert row["deterministic"] is True


def test_what_a_bounded_method_cannot_keep_is_told():
    pixels = SIZE["width"] * SIZE["height"]
    rows = rows_of({"method": "k_buffer", "k": 2}, {"method": "mlab", "k": 1}, "exact")
    kept = [(row["dropped"], row["merged"]) for row in rows]
    assert kept == [(pixels, 0), (0, 2 * pixels), (0, 0)]  # of three sheets; mlab has one layer beside its k
    assert {(row["fragments"], row["depth_complexity"]) for row in rows} == {(3 * pixels, 3)}


def test_pixels_that_hold_fragments_are_covered():
    """Beside an empty half, PSNR of covered pixels is 3 dB less."""
    half = ab.Mesh(
        [[-30, -30, 0], [0, -30, 0], [0, 30, 0], [-30, -30, 0], [0, 30, 0], [-30, 30, 0]], colors=(1, 0, 0, 0.5)
    )
    camera = ab.Camera.orthographic((0, 0, 9), (0, 0, 0), height=8)
    (row,) = ab.compare(half, camera, **SIZE, **QUICK, methods=["additive"]).rows
    green = ab.compare(half, camera, **SIZE, **QUICK, methods=["additive"], background=(0, 1, 0)).rows[0]
    assert row["fragments"] == SIZE["width"] * SIZE["height"] / 2
    assert green["psnr"] - green["psnr_covered"] == pytest.approx(10 * math.log10(2), abs=1e-4)


def test_memory_and_passes_are_the_published_ones(needs_gpu):
    """METHODS: heads and nodes of lists; 8 bytes and 12 a fragment, in two passes, of prefix sums; half in half floats."""
    rows = rows_of(
        "exact",
        "exact@linked_list",
        {"method": "exact@linked_list", "node_format": "rgb565_depth16", "label": "small nodes"},
        "exact@prefix_sum",
        "wboit@hardware",
        {"method": "wboit@hardware", "targets": "float16", "label": "half"},
        {"method": "stochastic@hardware", "targets": "float16", "label": "draws"},
        "depth_peeling",
        {"method": "depth_peeling", "layers": 2, "label": "two"},
        {"method": "depth_peeling", "layers": 100, "label": "hundred"},
        devices=["gpu"],
    )
    costs = [(row["bytes_per_pixel"], row["passes"]) for row in rows]
    assert costs == [
        (0, 1), (4 + 16 * 3, 1), (4 + 8 * 3, 1), (8 + 12 * 3, 2), (20, 1), (10, 1), (96, 1), (24, 4), (24, 2), (24, 4),
    ]  # fmt: skip


def test_a_weight_of_ones_own_is_a_row():
    weight = "clamp(10.0 / z, 0.01, 3000.0)"
    own, given = rows_of({"method": "wboit", "weight": weight}, {"method": "wboit", "weight": "none"})
    assert own["bytes_per_pixel"] == given["bytes_per_pixel"] == 20
    assert own["rmse"] != given["rmse"]
    assert math.isnan(own["error_bound"]) and math.isfinite(given["error_bound"])


@pytest.mark.parametrize(
    ("given", "is_known"),
    [
        ({"method": "exact"}, True),
        ({"method": "exact", "cutoff": 0.1}, False),
        ({"method": "k_buffer", "k": 2}, True),
        ({"method": "k_buffer", "k": 2, "tail": "blend"}, False),
        ({"method": "depth_peeling", "layers": 2}, True),
        ({"method": "mlab"}, False),
    ],
)
def test_bounds_are_known_of_some_methods(given, is_known):
    (row,) = rows_of(given)
    assert math.isfinite(row["error_bound"]) == is_known
    if is_known:
        assert row["max_abs"] <= row["error_bound"]


def test_of_other_blend_modes_no_bound_is_known():
    glow = ab.Mesh([[-9, -9, 0], [9, -9, 0], [0, 9, 0]], colors=(1, 0, 0, 0.5), blend="additive")
    (row,) = ab.compare(glow, CAMERA, **SIZE, **QUICK, methods=["exact"]).rows
    assert math.isnan(row["error_bound"])


def test_a_k_buffers_bound_is_that_of_its_own_k():
    (entry,) = entries(["k_buffer"], None, is_gpu=False)
    bounds = [rows_of({"method": "k_buffer", "k": k})[0]["error_bound"] for k in (1, 2, 8)]
    assert rows_of(entry.label)[0]["error_bound"] == bounds[2]
    assert bounds[0] > bounds[1] > bounds[2]
    assert np.isfinite(bounds).all()
