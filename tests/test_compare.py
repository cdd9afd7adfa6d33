"""Comparisons: rows say what methods cost and how far off they are, and planted ones land where they should."""

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest

import abuffer as ab
from abuffer import ParameterError
from abuffer._methods import METHODS
from abuffer.comparing import measuring
from abuffer.comparing.measuring import COLUMNS
from abuffer.comparing.metrics import FLOOR
from abuffer.own_methods import BUILT_IN
from comparisons import CAMERA, QUICK, SHEETS, SIZE


@pytest.fixture(scope="module")
def compared():
    scenes = {"sheets": SHEETS, "random": ab.scenes.random_triangles(n=60)}
    return ab.compare(scenes, CAMERA, **SIZE, **QUICK, sweep={"mlab": {"k": [1, 2, 8]}})


def test_every_method_is_a_row_on_every_scene(compared):
    for scene in ("sheets", "random"):
        labels = [row["label"] for row in compared.select(scene=scene)]
        assert set(labels) == BUILT_IN - {"mlab"} | {"mlab k=1", "mlab k=2", "mlab k=8"}
        assert len(labels) == len(set(labels))
    assert all(list(row) == list(COLUMNS) for row in compared.rows)
    assert all(row["failure"] == "" and row["device"] == "cpu" for row in compared.rows)


def test_exact_is_off_by_roundings_alone_and_others_by_what_is_known(compared):
    rows = {row["label"]: row for row in compared.select(scene="sheets")}
    assert rows["exact"]["max_abs"] < 1e-7
    # The last sheet is in front: C = .75 blue + .25 (.25 green + .75 · .5 red).
    wanted = np.array([0.25 * 0.75 * 0.5, 0.25 * 0.25, 0.75])
    np.testing.assert_allclose(compared.references["sheets"][5, 5, :3], wanted)
    additive = np.array([0.5, 0.25, 0.75])
    assert rows["additive"]["max_abs"] == pytest.approx((additive - wanted).max(), rel=1e-5)
    assert rows["additive"]["rmse"] == pytest.approx(np.sqrt(np.mean((additive - wanted) ** 2)), rel=1e-5)
    # Of alpha additive leaves the background's.
    assert rows["additive"]["alpha_rmse"] == pytest.approx(1 - 0.25 * 0.75 * 0.5, rel=1e-5)
    assert rows["unsorted"]["max_abs"] < 1e-7  # submitted back to front
    assert rows["mlab k=1"]["merged"] > 0 == rows["mlab k=8"]["merged"]


def test_facts_of_rows_are_those_of_the_methods_and_the_scene(compared):
    rows = {row["label"]: row for row in compared.select(scene="sheets")}
    pixels = SIZE["width"] * SIZE["height"]
    assert {row["fragments"] for row in rows.values()} == {3 * pixels}
    assert {row["depth_complexity"] for row in rows.values()} == {3}
    assert {label: rows[label]["passes"] for label in ("exact", "mboit", "depth_peeling", "dual_depth_peeling")} == {
        "exact": 1, "mboit": 2, "depth_peeling": 4, "dual_depth_peeling": 3,
    }  # fmt: skip
    assert rows["k_buffer"]["bytes_per_pixel"] == METHODS["k_buffer"].bytes_per_pixel(k=8, tail="drop")
    assert all(row["deterministic"] for row in rows.values())
    for row in rows.values():
        assert 0 < row["wall_ms_q1"] <= row["wall_ms"] <= row["wall_ms_q3"]
        assert math.isnan(row["gpu_ms"])  # of the CPU


def test_no_error_exceeds_its_bound(compared):
    bounded = [row for row in compared.rows if math.isfinite(row["error_bound"])]
    assert {row["label"] for row in bounded} == {
        "exact", "depth_peeling", "dual_depth_peeling", "k_buffer", "weighted_sum",
    }  # fmt: skip
    assert all(row["max_abs"] <= row["error_bound"] for row in bounded)


def grey(color, depth, primitive, behind):
    return behind * 0 + 0.5


@pytest.fixture
def planted():
    """Registers methods, and takes them back."""
    yield lambda id, numpy: ab.register_method(id, order="any", numpy=numpy)
    for id in set(METHODS) - BUILT_IN:
        del METHODS[id]


def test_a_slow_and_a_wrong_method_land_where_they_should(planted, monkeypatch):
    """Planted: one that is exact and slow is dominated, one that is wrong is off; by a clock of their own."""
    clock = itertools.count()  # a second from one look to the next
    late = [0]
    monkeypatch.setattr(measuring, "time", SimpleNamespace(perf_counter=lambda: next(clock) + late[0]))

    def slow(color, depth, primitive, behind):
        late[0] += 7
        alpha = color[..., 3:]
        front = np.concatenate([np.ones_like(alpha[:, :1]), np.cumprod(1 - alpha, axis=1)], axis=1)
        layers = np.concatenate([alpha * color[..., :3], alpha], axis=2) * front[:, :-1]
        return layers.sum(axis=1) + front[:, -1] * behind * np.array([*[1, 1, 1], 1])

    planted("planted_wrong", grey)
    ab.register_method("planted_slow", order="front_to_back", numpy=slow)
    methods = ["exact", "planted_wrong", "planted_slow"]
    found = ab.compare(SHEETS, CAMERA, **SIZE, devices=["cpu"], repeats=3, methods=methods)
    rows = {row["label"]: row for row in found.rows}
    assert rows["planted_wrong"]["max_abs"] == pytest.approx(0.5 - 0.25 * 0.25, rel=1e-6)
    assert rows["planted_wrong"]["rmse"] > 0.1
    assert rows["planted_slow"]["rmse"] < FLOOR
    assert [row["wall_ms"] for row in found.rows] == [1000, 1000, 8000]
    # As fast and less wrong dominates nothing: what is as fast is not told apart.
    assert found.pareto() == [rows["exact"], rows["planted_wrong"]]


def test_what_has_other_bits_each_time_is_not_deterministic(planted):
    values = iter(np.linspace(0, 1, 100))
    planted("planted_noise", lambda color, depth, primitive, behind: behind * 0 + next(values))
    found = ab.compare(SHEETS, CAMERA, **SIZE, **QUICK, methods=["exact", "planted_noise"])
    assert [row["deterministic"] for row in found.rows] == [True, False]


@pytest.mark.parametrize("at_call", [1, 5])
def test_what_a_users_function_raises_is_a_row_that_says_so(planted, at_call):
    """Before turns, and in one of them."""
    calls = []

    def fails(color, depth, primitive, behind):
        calls.append(None)
        if len(calls) >= at_call:
            raise ValueError("planted")
        return behind * 0

    planted("planted_failure", fails)
    found = ab.compare(SHEETS, CAMERA, **SIZE, **QUICK, methods=["planted_failure", "exact"])
    failure, exact = found.rows
    assert "planted" in failure["failure"] and exact["failure"] == ""
    assert list(found.images_of()) == ["exact"]


def row(label, q1, q3, rmse):
    times = {"wall_ms_q1": q1, "wall_ms": (q1 + q3) / 2, "wall_ms_q3": q3, "gpu_ms": float("nan")}
    return {"label": label, "scene": "s", "device": "d", "rmse": rmse, "failure": ""} | times


def test_dominance_is_not_claimed_where_quartiles_overlap():
    fast, close, slow = row("fast", 1, 2, 0.1), row("close", 1.9, 3, 0.1), row("slow", 2.1, 3, 0.1)
    better = row("better", 5, 6, 0.05)
    best = ab.Comparison([fast, close, slow, better], {}).pareto()
    assert [each["label"] for each in best] == ["fast", "close", "better"]


def test_quartiles_that_touch_overlap():
    fast, slow = row("fast", 1, 2, 0.1), row("slow", 2, 3, 0.1)
    assert ab.Comparison([fast, slow], {}).pareto() == [fast, slow]


def test_roundings_of_float32_order_no_row_before_another():
    fast, slow = row("fast", 1, 1, 9e-7), row("slow", 2, 2, 1e-8)
    assert ab.Comparison([fast, slow], {}).pareto() == [fast]
    fast["rmse"] = 1.1e-6
    assert ab.Comparison([fast, slow], {}).pareto() == [fast, slow]


def test_what_has_no_finite_error_is_not_among_the_best():
    rows = [row("good", 1, 1, 0.0), row("unknown", 9, 9, math.nan), row("broken", 0.1, 0.1, math.inf)]
    assert ab.Comparison(rows, {}).pareto() == rows[:1]


@pytest.mark.parametrize("error", ["psnr", "ssim", "label", "rsme"])
def test_more_of_an_error_is_worse(error):
    with pytest.raises(ParameterError, match="error must be one of 'rmse', 'max_abs'"):
        ab.Comparison([row("one", 1, 1, 0.1)], {}).pareto(error)


def test_times_of_a_gpu_are_those_that_all_rows_have():
    failed = row("failed", 1, 1, 0.1) | {"failure": "it cannot"}
    on_gpu = row("on gpu", 1, 1, 0.1) | {"gpu_ms": 0.5}
    assert ab.Comparison([on_gpu, failed], {}).time_column() == "gpu_ms"
    assert ab.Comparison([on_gpu, row("on cpu", 1, 1, 0.1)], {}).time_column() == "wall_ms"


def test_those_of_a_scene_and_a_device_are_among_those_of_all(compared):
    assert compared.pareto(scene="random", device="cpu") == [
        row for row in compared.pareto() if row["scene"] == "random"
    ]
    with pytest.raises(ParameterError, match="scene must be one of 'sheets', 'random', got 'bunny'"):
        compared.pareto(scene="bunny")


def test_a_row_does_not_dominate_itself_nor_rows_of_another_scene():
    one, other = row("one", 1, 1, 0.1), row("other", 2, 2, 0.1) | {"scene": "t"}
    assert ab.Comparison([one, other], {}).pareto() == [one, other]


def test_what_fails_is_a_row_that_says_why():
    glow = ab.Mesh([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], colors=(1, 0, 0, 0.5), blend="additive")
    found = ab.compare(glow, **SIZE, **QUICK, methods=["exact", "wboit"])
    exact, wboit = found.rows
    assert (exact["failure"], wboit["label"]) == ("", "wboit")
    assert "is for blend=\"over\" alone, and there is 'additive'" in wboit["failure"]
    assert math.isnan(wboit["rmse"]) and found.pareto() == [exact]


def test_progress_counts_every_step():
    steps = []
    ab.compare(SHEETS, CAMERA, **SIZE, **QUICK, methods=["exact", "wboit"], progress=lambda *step: steps.append(step))
    assert [done for done, _, _ in steps] == [0, 1, 2, 3]
    assert {all for _, all, _ in steps} == {4}


def test_native_forms_are_compared_on_gpus(needs_gpu):
    found = ab.compare(
        SHEETS,
        CAMERA,
        **SIZE,
        devices=["gpu"],
        repeats=2,
        methods=["exact", "wboit", "wboit@hardware", "exact@linked_list"],
    )
    rows = {row["label"]: row for row in found.rows}
    assert rows["wboit@hardware"]["rmse"] == pytest.approx(rows["wboit"]["rmse"], rel=1e-4)
    assert rows["exact@linked_list"]["bytes_per_pixel"] == 4 + 16 * 3
    assert all(row["gpu_ms"] > 0 for row in rows.values())
    assert found.time_column() == "gpu_ms"


def test_columns_that_are_not_there_are_named(compared):
    with pytest.raises(ParameterError, match="did you mean 'scene'"):
        compared.select(scen="sheets")


def test_what_another_renderer_made_is_a_row():
    """With its errors beside the same reference, and its times among those of the methods."""
    found = ab.compare(SHEETS, CAMERA, **SIZE, **QUICK, methods=["exact", "wboit"])
    theirs = np.full((36, 48, 4), 0.5, np.float32)
    found.add_image("mine", theirs, ms=[3.0, 1.0, 2.0])
    found.add_image("untimed", found.references["scene"])
    *_, mine, untimed = found.rows
    assert list(mine) == list(COLUMNS)
    assert (mine["wall_ms_q1"], mine["wall_ms"], mine["wall_ms_q3"], mine["frames"]) == (1.5, 2.0, 2.5, 3)
    assert mine["max_abs"] == pytest.approx(0.5 - 0.0625)
    assert (untimed["rmse"], untimed["psnr"]) == (0, math.inf)
    assert found.time_column() == "wall_ms" and untimed not in found.pareto()
    np.testing.assert_array_equal(found.images_of()["mine"], theirs)
    for label, image, message in [
        ("mine", theirs, "there is a row 'mine'"),
        ("other", theirs[1:], "must be an image of 36×48×4"),
        ("other", np.uint8(theirs), "divide by 255"),
        ("reference", theirs, "a label must be text"),
        ("other", [[1], [2, 3]], "is no array"),
    ]:
        with pytest.raises(ParameterError, match=message):
            found.add_image(label, image)
    for ms, message in [(4.0, "ms must be a list"), ([0.0], "ms must be over 0"), (["x"], "ms must be a number")]:
        with pytest.raises(ParameterError, match=message):
            found.add_image("other", theirs, ms=ms)
    with pytest.raises(ParameterError, match="scene must be one of 'scene', got 'bunny'"):
        found.add_image("other", theirs, scene="bunny")


def test_rows_are_a_table(compared):
    table = compared.to_pandas()
    assert len(table) == len(compared.rows)
    assert list(table.columns) == list(COLUMNS)
    html = compared._repr_html_()
    assert html.count("<tr>") == 1 + len(compared.rows)
    hostile = ab.Comparison([compared.rows[0] | {"label": "<script>"}], {})._repr_html_()
    assert "<script>" not in hostile and "&lt;script&gt;" in hostile


def test_another_renderers_row_stands_beside_those_of_its_device(needs_gpu):
    found = ab.compare(SHEETS, CAMERA, **SIZE, repeats=1, methods=["exact"], devices=["cpu", "gpu"])
    found.add_image("mine", found.references["scene"], device=found.devices[1])
    assert found.select(label="mine")[0]["device"] == found.devices[1]
    # It has no time, and so takes no other row's from the plot.
    assert found.time_column(found.select(device=found.devices[1])) == "gpu_ms"


def test_where_all_methods_failed_another_renderer_has_a_row():
    found = ab.compare(SHEETS, CAMERA, **SIZE, **QUICK, methods=[{"method": "wboit", "pipeline": "hardware"}])
    found.add_image("mine", found.references["scene"])
    assert found.rows[1]["rmse"] == 0
