"""Comparisons: rows say what methods cost and how far off they are, and planted ones land where they should."""

import json
import math

import numpy as np
import pytest

import abuffer as ab
from abuffer import ParameterError
from abuffer._methods import METHODS
from abuffer.comparing.entries import entries
from abuffer.comparing.measuring import COLUMNS
from abuffer.own_methods import BUILT_IN

SIZE = {"width": 48, "height": 36}
QUICK = {"devices": ["cpu"], "repeats": 2, "warmup": 3}


def sheets(*colors):
    """Triangles over the whole view, the first the farthest."""
    return ab.Mesh(
        [[(-30, -30, z), (30, -30, z), (0, 60, z)] for z in range(len(colors))], colors=colors, color_mode="face"
    )


SHEETS = sheets((1, 0, 0, 0.5), (0, 1, 0, 0.25), (0, 0, 1, 0.75))
CAMERA = ab.Camera.look_at((0, 0, 9), (0, 0, 0))


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


def test_a_slow_and_a_wrong_method_land_where_they_should():
    """Planted: a method that is exact and slow is dominated, one that is fast and wrong is not exact."""

    def wrong(color, depth, primitive, behind):
        return behind * 0 + 0.5

    ab.register_method("planted_wrong", title="grey", source="none", order="any", passes=1, numpy=wrong)
    try:
        entries = ["exact", "planted_wrong", {"method": "depth_peeling", "label": "slow"}]
        found = ab.compare(SHEETS, CAMERA, width=160, height=120, devices=["cpu"], repeats=5, methods=entries)
        rows = {row["label"]: row for row in found.rows}
        assert rows["planted_wrong"]["max_abs"] == pytest.approx(0.5 - 0.25 * 0.25, rel=1e-6)
        assert rows["planted_wrong"]["rmse"] > 0.1 > rows["exact"]["rmse"]
        # As slow as is sure, whatever else the machine does.
        rows["slow"].update(wall_ms_q1=10 * rows["exact"]["wall_ms_q3"], rmse=rows["exact"]["rmse"])
        assert rows["slow"] not in found.pareto() and rows["exact"] in found.pareto()
    finally:
        del METHODS["planted_wrong"]


def row(label, q1, q3, rmse):
    times = {"wall_ms_q1": q1, "wall_ms": (q1 + q3) / 2, "wall_ms_q3": q3, "gpu_ms": float("nan")}
    return {"label": label, "scene": "s", "device": "d", "rmse": rmse, "failure": ""} | times


def test_dominance_is_not_claimed_where_quartiles_overlap():
    fast, close, slow = row("fast", 1, 2, 0.1), row("close", 1.9, 3, 0.1), row("slow", 2.1, 3, 0.1)
    better = row("better", 5, 6, 0.05)
    best = ab.Comparison([fast, close, slow, better], {}).pareto()
    assert [each["label"] for each in best] == ["fast", "close", "better"]


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


def test_a_reference_of_ones_own_is_what_errors_are_of():
    grey = np.full((36, 48, 4), 0.5)
    found = ab.compare(SHEETS, CAMERA, **SIZE, **QUICK, methods=["exact"], reference=grey)
    assert found.rows[0]["max_abs"] == pytest.approx(0.5 - 0.0625)
    with pytest.raises(ParameterError, match="reference must be an image of 36×48×4"):
        ab.compare(SHEETS, CAMERA, **SIZE, **QUICK, reference=grey[:-1])
    with pytest.raises(ParameterError, match='reference must be "float64" or an image'):
        ab.compare(SHEETS, CAMERA, **SIZE, **QUICK, reference="float32")


def test_it_is_saved_and_loaded_whole(compared, tmp_path):
    compared.save(tmp_path)
    again = ab.Comparison.load(tmp_path)
    assert json.dumps(again.rows) == json.dumps(compared.rows)
    assert again.environment == compared.environment
    assert list(again.rendered) == list(compared.rendered)
    for key, image in compared.rendered.items():
        np.testing.assert_array_equal(again.rendered[key], image)
    for scene in compared.scenes:
        np.testing.assert_array_equal(again.references[scene], compared.references[scene])
        np.testing.assert_array_equal(again.exact[scene].fragments.depth, compared.exact[scene].fragments.depth)
    with pytest.raises(ParameterError, match="holds no comparison"):
        ab.Comparison.load(tmp_path / "nothing")


def without_times(rows):
    return json.dumps([{name: value for name, value in row.items() if "_ms" not in name} for row in rows])


def test_a_resumed_comparison_is_that_of_an_uninterrupted_one(tmp_path):
    scenes = {"sheets": SHEETS, "random": ab.scenes.random_triangles(n=60), "cyclic": ab.scenes.cyclic()}
    arguments = {"camera": CAMERA, **SIZE, **QUICK, "methods": ["exact", "wboit"]}
    whole = ab.compare(scenes, **arguments)

    def interrupt(done, all, what):
        if what.startswith("random: turn 2"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        ab.compare(scenes, **arguments, save=tmp_path, progress=interrupt)
    assert ab.Comparison.load(tmp_path).scenes == ["sheets"]
    measured = []
    resumed = ab.compare(
        scenes, **arguments, save=tmp_path, resume=True, progress=lambda done, all, what: measured.append(what)
    )
    assert not any(what.startswith("sheets") for what in measured)
    assert without_times(resumed.rows) == without_times(whole.rows)
    for key, image in whole.rendered.items():
        np.testing.assert_array_equal(resumed.rendered[key], image)
    assert without_times(ab.Comparison.load(tmp_path).rows) == without_times(whole.rows)


def test_what_cannot_be_resumed_is_refused(tmp_path):
    arguments = {"camera": CAMERA, **QUICK, "methods": ["exact", "wboit"], "save": tmp_path}
    ab.compare({"sheets": SHEETS}, **SIZE, **arguments)
    with pytest.raises(ParameterError, match="holds a comparison: give resume=True"):
        ab.compare({"sheets": SHEETS}, **SIZE, **arguments)
    with pytest.raises(ParameterError, match="sheets was measured at 48×36, and 40×30 is asked for"):
        ab.compare({"sheets": SHEETS}, width=40, height=30, **arguments, resume=True)
    with pytest.raises(ParameterError, match=r"sheets was measured with other methods \(mlab, wboit\)"):
        ab.compare({"sheets": SHEETS}, **SIZE, **arguments | {"methods": ["exact", "mlab"]}, resume=True)


def test_a_folder_is_overwritten_whole(tmp_path, compared):
    other = ab.compare(ab.scenes.cyclic(), **SIZE, **QUICK, methods=["exact"])
    other.save(tmp_path)
    compared.save(tmp_path)
    again = ab.Comparison.load(tmp_path)
    np.testing.assert_array_equal(again.exact["sheets"].image, compared.exact["sheets"].image)


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


def test_by_default_a_gpu_compares_every_pipeline_of_every_method():
    labels = [entry.label for entry in entries(None, None, is_gpu=True)]
    assert {"exact", "exact@linked_list", "exact@prefix_sum", "wboit", "wboit@hardware", "mlab"} <= set(labels)
    assert "mlab@hardware" not in labels
    assert all("@" not in entry.label for entry in entries(None, None, is_gpu=False))


def test_a_sweep_of_several_parameters_has_all_combinations():
    found = entries(["exact"], {"mboit": {"moments": [4, 6], "beta": [0, 0.25]}}, is_gpu=False)
    assert [entry.label for entry in found] == [
        "exact",
        *(f"mboit moments={moments} beta={beta}" for moments in (4, 6) for beta in (0, 0.25)),
    ]
    assert {entry.curve for entry in found[1:]} == {"mboit"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"methods": ["wbolt"]}, "did you mean 'wboit'"),
        ({"methods": ["mlab@hardware"]}, "pipeline of mlab must be one of 'tiles'"),
        ({"methods": [{"method": "mlab", "kk": 2}]}, "did you mean 'k'"),
        ({"methods": [{"method": "mlab", "k": 0}]}, "k must be"),
        ({"methods": "wboit"}, "methods must be a list"),
        ({"methods": ["wboit", "wboit"]}, "wboit: compared twice"),
        ({"methods": []}, "methods is empty"),
        ({"sweep": {"mlab": [2, 4]}}, "must be a dict of parameters and their values"),
        ({"devices": "cpu"}, r"give \['cpu'\]"),
        ({"repeats": 0}, "repeats must be at least 1"),
        ({"resume": True}, "give the folder as save="),
    ],
)
def test_arguments_that_are_wrong_are_named(arguments, message):
    with pytest.raises(ParameterError, match=message):
        ab.compare(SHEETS, CAMERA, **SIZE, **QUICK | arguments)


def test_scenes_are_named_by_their_keys_or_their_own_names():
    two = [ab.scenes.cyclic(), ab.scenes.coplanar()]
    assert ab.compare(two, **SIZE, **QUICK, methods=["exact"]).scenes == ["cyclic", "coplanar"]
    assert ab.compare({"a": SHEETS, "b": two[0]}, CAMERA, **SIZE, **QUICK, methods=["exact"]).scenes == ["a", "b"]
    with pytest.raises(ParameterError, match="several scenes are named cyclic"):
        ab.compare([two[0], two[0]], **SIZE, **QUICK)
    with pytest.raises(ParameterError, match="there is no scene"):
        ab.compare({}, **SIZE, **QUICK)


def test_rows_are_a_table(compared):
    table = compared.to_pandas()
    assert len(table) == len(compared.rows)
    assert list(table.columns) == list(COLUMNS)
    html = compared._repr_html_()
    assert html.count("<tr>") == 1 + len(compared.rows)
    hostile = ab.Comparison([compared.rows[0] | {"label": "<script>"}], {})._repr_html_()
    assert "<script>" not in hostile and "&lt;script&gt;" in hostile
