"""What there is to choose from, and how a device is chosen."""

import os
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import abuffer as ab
from abuffer import measured, tables
from abuffer.job import prepared

TRIANGLE = ab.Mesh([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], colors=(1, 0, 0, 0.5))
CAMERA = ab.Camera.look_at((0, 0, 3), (0, 0, 0))


def adapter(name, kind, lacks=None):
    return {
        "name": name,
        "kind": kind,
        "backend": "vulkan",
        "driver": "of a test",
        "max_binding": 2**27,
        "lacks": lacks,
        "samples": [1, 2, 4, 8],
    }


LARGE, SMALL = adapter("Voodoo 2 SLI", "discrete"), adapter("Voodoo Rush", "integrated")
OLD = adapter("Voodoo 1", "discrete", lacks="storage buffers that fragment shaders can write")
SOFTWARE = adapter("softpipe (2 cores)", "software")


ON_GPU = pytest.mark.parametrize("pipeline", ["linked_list", "prefix_sum"])


@pytest.fixture
def machine(monkeypatch):
    """Says which adapters this machine has, best first, and what ABUFFER_DEVICE is."""

    def has(*adapters, environment=None):
        monkeypatch.setattr("abuffer._core.adapters", lambda: [dict(a) for a in adapters])
        monkeypatch.setattr(tables, "_found", (None, []))
        monkeypatch.delenv("ABUFFER_DEVICE", raising=False)
        if environment is not None:
            monkeypatch.setenv("ABUFFER_DEVICE", environment)

    return has


def chosen(device="auto", pipeline="auto", precision="float32", **wants):
    """The adapter's place, None for the CPU, and the plan's rows by what they are about, as `render` gets them."""
    plan = []
    place, which = tables.choose(
        pipeline, device, precision, os.environ.get("ABUFFER_DEVICE"), plan, tables.Wants(**wants)
    )
    plan = {what: (choice, why) for what, choice, why in plan}
    assert which == plan["pipeline"][0]
    return place, plan


def refused(error, **kw):
    with pytest.raises(error) as caught:
        chosen(**kw)
    assert type(caught.value) is error
    return str(caught.value)


# ---- tables ----


@pytest.mark.parametrize("table", [ab.methods, ab.pipelines, ab.devices])
def test_tables_are_dicts_of_rows_that_print_as_tables(table):
    rows = table()
    assert isinstance(rows, dict)
    lines = str(rows).splitlines()
    columns = ["id", *next(iter(rows.values()))]
    assert lines[0].split("  ")[0].strip() == "id"
    assert all(column in lines[0] for column in columns)
    assert set(lines[1]) == {"-", " "}
    assert len(lines) == 2 + len(rows)
    for line, (key, row) in zip(lines[2:], rows.items(), strict=True):
        assert list(row) == columns[1:]
        for column, cell in zip(columns, [key, *row.values()], strict=True):
            at = lines[0].index(column)
            assert line[at:].startswith(str(cell))  # under its column's name
    assert repr(rows) == str(rows)


@pytest.mark.parametrize("table", [ab.methods, ab.pipelines, ab.devices])
def test_a_table_is_the_callers_own(table):
    changed = table()
    changed.clear()
    assert table()


def test_a_table_without_rows_prints_as_none():
    assert str(tables.Table()) == "(none)"


def test_there_is_a_pipeline_for_each_kind_of_device():
    runs_on = {key: row["runs on"] for key, row in ab.pipelines().items()}
    assert runs_on == {"tiles": "cpu, gpu", "linked_list": "gpu", "prefix_sum": "gpu", "hardware": "gpu"}


def test_every_method_renders():
    for method in ab.methods():
        assert ab.render(TRIANGLE, CAMERA, width=8, height=8, device="cpu", method=method).image.any()


def test_the_cpu_is_always_a_device(machine):
    machine()
    assert list(ab.devices()) == ["cpu"]
    assert ab.devices()["cpu"]["pipelines"] == "tiles"


def test_devices_tell_kind_driver_and_what_runs_on_them(machine):
    machine(LARGE, OLD, SOFTWARE)
    devices = ab.devices()
    assert list(devices) == ["cpu", "Voodoo 2 SLI", "Voodoo 1", "softpipe (2 cores)"]
    wanted = {"kind": "discrete", "backend": "vulkan", "driver": "of a test"}
    wanted |= {"pipelines": "tiles, linked_list, prefix_sum, hardware"}
    assert devices["Voodoo 2 SLI"] == wanted
    assert devices["Voodoo 1"]["pipelines"] == "none: lacks storage buffers that fragment shaders can write"
    assert devices["softpipe (2 cores)"]["kind"] == "software"


def test_two_adapters_of_one_name_are_two_devices(machine):
    machine(LARGE, LARGE)
    assert len(ab.devices()) == 3


def test_real_adapters_come_before_software_ones(needs_gpu):
    kinds = [row["kind"] for key, row in ab.devices().items() if key != "cpu"]
    assert kinds == sorted(kinds, key=["discrete", "integrated", "virtual", "other", "software"].index)


def test_listing_devices_leaves_the_environment_alone(monkeypatch):
    for before in ({}, {"NODEVICE_SELECT": "0"}):
        monkeypatch.delenv("NODEVICE_SELECT", raising=False)
        for key, value in before.items():
            monkeypatch.setenv(key, value)
        monkeypatch.setattr(tables, "_found", (None, []))
        ab.devices()
        assert {k: v for k, v in os.environ.items() if k == "NODEVICE_SELECT"} == before


def test_adapters_are_looked_for_once_a_process_even_from_many_threads(monkeypatch):
    asked = []

    def slow():
        asked.append(os.environ.get("NODEVICE_SELECT"))
        time.sleep(0.05)
        return [LARGE]

    monkeypatch.delenv("NODEVICE_SELECT", raising=False)
    monkeypatch.setattr("abuffer._core.adapters", slow)
    monkeypatch.setattr(tables, "_found", (None, []))
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda _: list(ab.devices()), range(8)))
    assert found == [["cpu", LARGE["name"]]] * 8
    assert asked == ["1"]
    assert "NODEVICE_SELECT" not in os.environ
    monkeypatch.setattr(os, "getpid", lambda: -1)  # a fork's
    ab.devices()
    assert len(asked) == 2


# ---- what auto means ----


def test_auto_with_more_samples_than_a_gpu_has_is_the_cpu(machine):
    machine(LARGE, SMALL)
    assert chosen(samples=8)[0] == 0
    place, plan = chosen(samples=16)
    assert place is None
    assert plan["device"] == ("cpu", "no real GPU here has 16 samples a pixel")


def test_auto_with_a_blend_that_only_numpy_has_is_the_cpu(machine):
    machine(LARGE)
    place, plan = chosen(numpy=True)
    assert place is None
    assert "wgsl" in plan["device"][1]


def test_auto_is_the_best_real_gpu(machine):
    machine(LARGE, SMALL, SOFTWARE)
    place, plan = chosen()
    assert place == 0
    assert plan["device"] == ("Voodoo 2 SLI", "the best real GPU")
    assert plan["pipeline"] == measured.faster("discrete", "image", 0)


def test_auto_passes_over_a_gpu_that_lacks_what_is_needed(machine):
    machine(OLD, SMALL)
    assert chosen()[0] == 1


def test_auto_is_the_cpu_where_there_is_no_gpu(machine):
    machine()
    assert chosen() == (None, {"device": ("cpu", "no GPU here"), "pipeline": ("tiles", "the CPU's")})


def test_auto_never_picks_a_software_driver_but_says_that_it_would_run(machine):
    machine(SOFTWARE)
    place, plan = chosen()
    assert place is None
    assert plan["device"] == ("cpu", "no real GPU here; softpipe (2 cores) would run if named")


def test_a_real_render_says_the_same(machine):
    machine(SOFTWARE)
    frame = ab.render(TRIANGLE, CAMERA, width=8, height=8)
    assert frame.plan["device"] == "cpu"
    assert "softpipe (2 cores) would run if named" in str(frame.plan)
    assert frame.stats.device == "cpu"


@ON_GPU
def test_auto_with_a_pipeline_that_only_a_gpu_has_is_the_best_adapter_even_a_software_one(machine, pipeline):
    machine(LARGE, SOFTWARE)
    assert chosen(pipeline=pipeline)[0] == 0
    machine(SOFTWARE)
    place, plan = chosen(pipeline=pipeline)
    assert place == 0
    assert plan["device"][0] == "softpipe (2 cores), a software driver"
    assert plan["pipeline"] == (pipeline, "as asked")


@ON_GPU
def test_a_pipeline_of_gpus_outweighs_an_abuffer_device_that_is_the_cpu(machine, pipeline):
    machine(LARGE, environment="cpu")
    assert chosen(pipeline=pipeline)[0] == 0


def test_auto_with_tiles_is_the_best_real_gpu_with_any_number_of_samples_or_the_cpu(machine):
    machine(LARGE)
    assert chosen(pipeline="tiles", samples=16)[0] == 0
    machine(SOFTWARE)
    assert chosen(pipeline="tiles")[0] is None


def test_auto_with_the_cpus_precision_is_the_cpu(machine):
    machine(LARGE)
    place, plan = chosen(precision="float64")
    assert place is None
    assert plan["device"] == ("cpu", "float64 is the CPU's")


# ---- a device by name ----


def test_cpu_is_the_cpu_whatever_else_there_is(machine):
    machine(LARGE)
    assert chosen("cpu") == (None, {"device": ("cpu", "as asked"), "pipeline": ("tiles", "the CPU's")})


def test_gpu_is_the_best_adapter_that_can_render_software_ones_last(machine):
    machine(LARGE, SOFTWARE)
    assert chosen("gpu")[0] == 0
    machine(OLD, SOFTWARE)
    place, plan = chosen("gpu")
    assert place == 1
    assert plan["device"] == ("softpipe (2 cores), a software driver", "the best adapter")


@pytest.mark.parametrize(("name", "place"), [("Rush", 1), ("voodoo", 0), ("SOFTPIPE", 2), ("2 SLI", 0)])
def test_a_part_of_a_name_in_any_case_picks_the_first_that_has_it(machine, name, place):
    machine(LARGE, SMALL, SOFTWARE)
    found, plan = chosen(name)
    assert found == place
    assert plan["device"][1] == f"its name contains {name!r}"


def test_a_name_that_nothing_has_is_an_error_that_lists_all(machine):
    machine(LARGE, SOFTWARE)
    text = refused(ab.DeviceError, device="Rage")
    assert all(part in text for part in ("'Rage'", "cpu", "Voodoo 2 SLI", "softpipe (2 cores)"))


def test_gpu_without_an_adapter_is_an_error(machine):
    machine()
    for kw in ({"device": "gpu"}, {"pipeline": "linked_list"}, {"pipeline": "prefix_sum"}):
        assert "no GPU adapter" in refused(ab.DeviceError, **kw)


# ---- ABUFFER_DEVICE ----


@pytest.mark.parametrize("nothing", ["", "auto"])
def test_an_empty_abuffer_device_says_nothing(machine, nothing):
    machine(LARGE, environment=nothing)
    assert chosen()[1]["device"] == ("Voodoo 2 SLI", "the best real GPU")


@pytest.mark.parametrize(
    ("environment", "device", "why"),
    [
        ("cpu", "cpu", "as asked"),
        ("gpu", "Voodoo 2 SLI", "the best adapter"),
        ("softpipe", "softpipe (2 cores), a software driver", "its name contains 'softpipe'"),
    ],
)
def test_abuffer_device_says_what_auto_means(machine, environment, device, why):
    machine(LARGE, SOFTWARE, environment=environment)
    assert chosen()[1]["device"] == (device, f"ABUFFER_DEVICE is {environment!r}: {why}")


def test_abuffer_device_says_nothing_about_a_device_that_is_given(machine):
    machine(LARGE, environment="cpu")
    assert chosen("gpu")[0] == 0
    machine(LARGE, environment="gpu")
    assert chosen("cpu")[0] is None


def test_float64_is_the_cpus_also_where_abuffer_device_is_the_gpu(machine):
    machine(LARGE, environment="gpu")
    assert chosen(precision="float64")[0] is None


def test_abuffer_device_is_read_at_every_render(machine):
    machine(environment="cpu")
    assert "ABUFFER_DEVICE is 'cpu'" in str(ab.render(TRIANGLE, CAMERA, width=8, height=8).plan)
    machine()
    assert "ABUFFER_DEVICE" not in str(ab.render(TRIANGLE, CAMERA, width=8, height=8).plan)


def test_an_abuffer_device_that_does_not_exist_is_an_error(machine):
    machine(LARGE, environment="Rage")
    assert "'Rage'" in refused(ab.DeviceError)


# ---- what does not go together ----


def test_float64_on_a_gpu_is_a_wrong_argument(machine):
    machine(LARGE)
    for device in ("gpu", "Voodoo"):
        assert 'device="cpu"' in refused(ab.ParameterError, device=device, precision="float64")


@ON_GPU
def test_a_pipeline_of_gpus_on_the_cpu_is_a_wrong_argument(machine, pipeline):
    machine(LARGE)
    for kw in ({"device": "cpu"}, {"precision": "float64"}):
        text = refused(ab.ParameterError, pipeline=pipeline, **kw)
        assert f'"{pipeline}" needs a GPU' in text
        assert 'device="gpu"' in text


# ---- what auto means by a pipeline, on a GPU ----


def test_a_gpu_takes_what_was_faster_on_its_kind(machine, monkeypatch):
    """By the case, and by whether there are few triangles or many; the plan says what was measured, and on what."""
    machine(LARGE, SOFTWARE)
    cases = {case: {"few": 0.5, "many": 2.0} for case in measured.CASES}
    table = {"real": cases | {"device": "Banshee"}, "software": {case: {"few": 3, "many": 0.25} for case in cases}}
    table["software"]["device"] = "refrast"
    monkeypatch.setattr(measured, "TILES_TO_LINKED_LIST", table)
    for case, words in measured.CASES.items():
        found = {
            (device, n): chosen(device, case=case, triangles=n)[1]["pipeline"]
            for device in ("gpu", "softpipe")
            for n in (measured.FEW, measured.FEW + 1)
        }
        few, many, *software = found.values()
        assert few == ("tiles", f"tiles took 0.5 of linked_list's time for {words} of few triangles, on Banshee")
        assert many == (
            "linked_list",
            f"tiles took 2 of linked_list's time for {words} of many triangles, on Banshee",
        )
        assert [name for name, _ in software] == ["linked_list", "tiles"]


def test_options_of_nodes_take_the_pipeline_that_has_nodes(machine):
    machine(LARGE)
    assert chosen("gpu", nodes=True)[1]["pipeline"] == ("linked_list", "it has nodes to store as the options say")


def test_a_pipeline_that_is_asked_for_is_taken(machine):
    machine(LARGE)
    assert chosen("gpu", pipeline="prefix_sum")[1]["pipeline"] == ("prefix_sum", "as asked")


@pytest.mark.parametrize(
    ("case", "arguments"),
    [
        ("image", {}),
        ("image", {"fragments": "count", "cutoff": 0.1}),
        ("lists", {"fragments": True}),
        ("lists", {"fragments": "all"}),
        ("samples", {"samples": 4, "fragments": True}),
        ("stored", {"sort": "heap"}),
        ("stored", {"max_sorted_fragments": 3}),
    ],
)
def test_a_renders_case_is_what_it_asks_for(machine, monkeypatch, case, arguments):
    machine(LARGE)
    asked = []
    monkeypatch.setattr(tables, "faster", lambda kind, *rest: asked.append(rest) or ("tiles", "why"))
    prepared(TRIANGLE, CAMERA, device="gpu", **arguments)
    assert asked == [(case, 1)]


def test_modes_and_listed_opaque_surfaces_are_stored(machine, monkeypatch):
    machine(LARGE)
    asked = []
    monkeypatch.setattr(tables, "faster", lambda kind, *rest: asked.append(rest) or ("tiles", "why"))
    prepared(TRIANGLE.replaced(blend="screen"), CAMERA, device="gpu")
    prepared(TRIANGLE.replaced(opaque=True), CAMERA, device="gpu", fragments="all")
    assert asked == [("stored", 1), ("stored", 1)]


def test_every_case_was_measured_on_both_kinds_of_device():
    for row in measured.TILES_TO_LINKED_LIST.values():
        assert row["device"]
        assert all(set(row[case]) == {"few", "many"} for case in measured.CASES)
        assert all(ratio > 0 for case in measured.CASES for ratio in row[case].values())


def test_a_chosen_pipeline_that_cannot_gives_way_to_one_that_can(needs_gpu, monkeypatch):
    """One row of tiles has more triangles than this memory has room for; lists of single pixels fit."""
    monkeypatch.setattr(tables, "faster", lambda *_: ("tiles", "why"))
    corners = np.random.default_rng(0).uniform(0, 1, (8000, 1, 3)) * (32, 16, 1) + np.eye(3)
    cloud, camera = ab.Mesh(corners, colors=(1, 0, 0, 0.1)), ab.Camera.orthographic((16, 8, 9), (16, 8, 0), height=16)
    arguments = {"width": 32, "height": 16, "device": "gpu", "memory": 40_000}
    frame = ab.render(cloud, camera, **arguments)
    assert frame.plan["pipeline"] == "linked_list"
    (why,) = [why for what, _, why in frame.plan if what == "pipeline"]
    assert why.startswith("tiles cannot: ")
    assert frame.stats.dropped_fragments == 0
    of_many = ab.Renderer("gpu").render_many(cloud, [camera] * 2, width=32, height=16, memory=40_000)
    assert [one.plan["pipeline"] for one in of_many] == ["linked_list"] * 2
    with pytest.raises(ab.CapacityError):
        ab.render(cloud, camera, pipeline="tiles", **arguments)


def test_tiles_run_on_a_gpu_that_is_asked_for(machine):
    machine(LARGE)
    assert chosen("gpu", pipeline="tiles")[0] == 0


# ---- real renders ----


def test_the_plan_of_a_render_has_a_reason_for_each_choice(monkeypatch):
    monkeypatch.delenv("ABUFFER_DEVICE", raising=False)
    plan = ab.render(TRIANGLE, CAMERA, width=8, height=8, device="cpu").plan
    assert [what for what, _, _ in plan][:2] == ["device", "pipeline"]
    assert "bands" in {what for what, _, _ in plan}
    assert all(isinstance(part, str) and part for row in plan for part in row)
    assert str(plan).splitlines()[0] == "device: cpu (as asked)"


def test_a_gpu_render_names_its_adapter_and_whether_it_is_software(needs_gpu):
    frame = ab.render(TRIANGLE, CAMERA, width=8, height=8, device="gpu")
    name = frame.plan["device"].removesuffix(", a software driver")
    software = ab.devices()[name]["kind"] == "software"
    assert frame.plan["device"].endswith(", a software driver") == software
    assert frame.plan["pipeline"] == measured.faster("software" if software else "real", "image", 1)[0]
    cpu = ab.render(TRIANGLE, CAMERA, width=8, height=8, device="cpu")
    np.testing.assert_allclose(frame.image, cpu.image, atol=1e-6)


def test_a_part_of_the_real_name_serves_too(needs_gpu):
    by_gpu = ab.render(TRIANGLE, CAMERA, width=8, height=8, device="gpu")
    name = by_gpu.plan["device"].removesuffix(", a software driver")
    again = ab.render(TRIANGLE, CAMERA, width=8, height=8, device=name[:6].upper())
    assert again.plan["device"] == by_gpu.plan["device"]
