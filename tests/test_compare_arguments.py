"""What a comparison is asked for: methods, sweeps, devices, scenes, and what is wrong with them."""

import math

import numpy as np
import pytest

import abuffer as ab
from abuffer import ParameterError
from abuffer.comparing.entries import entries
from comparisons import CAMERA, QUICK, SHEETS, SIZE


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
        ({"methods": 5}, r"give \[5\]"),
        ({"methods": [{"method": "wboit@hardware", "pipeline": "tiles"}]}, "are two: give one of them"),
        ({"methods": ["wboit@"]}, "pipeline of wboit must be one of"),
        ({"methods": [{"method": "wboit", "label": "reference"}]}, "a label must be text other than 'reference'"),
        ({"methods": [{"method": "wboit", "label": b"x"}]}, "a label must be text"),
        ({"sweep": ["mlab"]}, "sweep must be a dict such as"),
        ({"sweep": {"mlab": {"k": 4}}}, r"must be a list, got 4: give \[4\]"),
        ({"sweep": {"mlab": {"k": []}}}, "has no values"),
        ({"sweep": {"mlab": [2, 4]}}, "must be a dict of parameters and their values"),
        ({"devices": "cpu"}, r"give \['cpu'\]"),
        ({"devices": []}, "devices is empty"),
        ({"background": "red"}, "background"),
        ({"background": (0, 0)}, "background"),
        ({"repeats": 0}, "repeats must be at least 1"),
        ({"repeats": True}, "repeats must be a number"),
        ({"warmup": -5}, "warmup must be at least 0"),
        ({"warmup": math.nan}, "warmup must be"),
        ({"resume": True}, "give the folder as save="),
    ],
)
def test_arguments_that_are_wrong_are_named(arguments, message):
    with pytest.raises(ParameterError, match=message):
        ab.compare(SHEETS, CAMERA, **SIZE, **QUICK | arguments)


def test_what_is_given_once_serves_all_scenes_and_devices():
    found = ab.compare(
        {"a": SHEETS, "b": SHEETS},
        CAMERA,
        **SIZE,
        repeats=np.int64(2),
        devices=(device for device in ["cpu", "cpu"]),
        methods=(method for method in ["exact", "wboit"]),
        sweep={"mlab": {"k": (k for k in np.arange(1, 3))}},
    )
    told = [(row["scene"], row["label"]) for row in found.rows]
    assert told == [(scene, label) for scene in "ab" for label in ("exact", "wboit", "mlab k=1", "mlab k=2")]
    assert [row["frames"] for row in found.rows] == [2] * 8


def test_a_background_is_that_of_scenes_that_have_none():
    scenes = {"own": SHEETS, "standard": ab.scenes.cyclic()}
    found = ab.compare(scenes, CAMERA, **SIZE, **QUICK, methods=["exact"], background=(0, 0, 1))
    assert (found.references["own"][..., 3] == 1).all()
    assert found.references["standard"][0, 0].tolist() == [*ab.scenes.cyclic().background[:3], 1]


def test_scenes_are_named_by_their_keys_or_their_own_names():
    two = [ab.scenes.cyclic(), ab.scenes.coplanar()]
    assert ab.compare(two, **SIZE, **QUICK, methods=["exact"]).scenes == ["cyclic", "coplanar"]
    assert ab.compare({"a": SHEETS, "b": two[0]}, CAMERA, **SIZE, **QUICK, methods=["exact"]).scenes == ["a", "b"]
    with pytest.raises(ParameterError, match="several scenes are named cyclic"):
        ab.compare([two[0], two[0]], **SIZE, **QUICK)
    with pytest.raises(ParameterError, match="there is no scene"):
        ab.compare({}, **SIZE, **QUICK)


def test_labels_have_numbers_as_json_has_them():
    given = {"method": "fourier", "depth_range": (np.float64(1), np.float64(9))}
    assert [entry.label for entry in entries([given], None, is_gpu=False)] == ["fourier depth_range=[1.0, 9.0]"]


def test_a_camera_that_is_none_is_named():
    with pytest.raises(ParameterError, match=r"camera of scene must be an abuffer\.Camera, got str"):
        ab.compare(SHEETS, "front", **SIZE, **QUICK)
