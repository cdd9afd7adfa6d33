"""The options of render: what they may be, who has them, and what the core is told."""

import inspect
from types import SimpleNamespace

import numpy as np
import pytest

import abuffer as ab
from abuffer import options, tables

TRIANGLE = ab.Mesh([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], colors=(1, 0, 0, 0.5))
CAMERA = ab.Camera.look_at((0, 0, 3), (0, 0, 0))
ADAPTER = {
    "name": "Voodoo 2",
    "kind": "discrete",
    "backend": "vulkan",
    "driver": "",
    "max_binding": 2**27,
    "lacks": None,
}


class AskedError(Exception):
    """Carries the request that would have gone to the core."""


@pytest.fixture
def asked(monkeypatch):
    """What the core would be asked for by a render with these arguments."""

    def refuse(request):
        raise AskedError(request)

    monkeypatch.setattr("abuffer._core.adapters", lambda: [ADAPTER])
    monkeypatch.setattr(tables, "_found", (None, []))
    monkeypatch.setattr("abuffer._core.render_cpu", lambda meshes, camera, request, *_: refuse(request))
    upload = SimpleNamespace(render=lambda meshes, camera, request, *_: refuse(request))
    monkeypatch.setattr("abuffer._core.Upload", lambda adapter: upload)

    def ask(**arguments):
        with pytest.raises(AskedError) as caught:
            render(**arguments)
        return caught.value.args[0]

    return ask


def render(item=TRIANGLE, **arguments):
    return ab.render(item, CAMERA, **{"width": 8, "height": 6, "device": "cpu"} | arguments)


DEFAULTS = {
    "msaa_resolve": "per_pixel",
    "sort": "auto",
    "max_sorted_fragments": None,
    "limit_policy": "nearest",
    "blend_order": "front_to_back",
    "cutoff": 0.0,
    "node_format": "float32",
    "resolve": "compute",
    "resolve_classes": [1, 4, 8, 16, 32, 64],
}


def test_without_options_the_core_is_asked_for_the_defaults(asked):
    request = asked()
    assert {name: request[name] for name in DEFAULTS} == DEFAULTS
    assert (request["samples"], request["pipeline"], request["blends"]) == (1, "tiles", [])
    assert asked(device="gpu", sort="auto", resolve="compute")["pipeline"] == "linked_list"
    assert asked(device="gpu")["pipeline"] == "tiles"
    assert asked(pipeline="prefix_sum", device="auto")["pipeline"] == "prefix_sum"


@pytest.mark.parametrize(
    ("option", "values"),
    [
        ("samples", (1, 2, 4, 8, 16)),
        ("msaa_resolve", ("per_pixel", "per_sample", "hdr", "none")),
        ("sort", ("auto", "insertion", "selection", "bitonic", "merge", "heap")),
        ("max_sorted_fragments", (None, 1, 18, 64)),
        ("limit_policy", ("nearest", "last_submitted")),
        ("blend_order", ("front_to_back", "back_to_front")),
        ("cutoff", (0.0, 0.25, 30.0)),
    ],
)
@pytest.mark.parametrize("pipeline", ["tiles", "linked_list", "prefix_sum"])
def test_options_of_every_pipeline(asked, pipeline, option, values):
    for value in values:
        assert asked(pipeline=pipeline, device="auto", **{option: value})[option] == value


@pytest.mark.parametrize(
    ("option", "given", "kept"),
    [
        *(("node_format", name, name) for name in ("float32", "rgba8_depth32", "rgba8_depth24_coverage8")),
        *(("node_format", name, name) for name in ("rgb565_depth16", "rgb9e5_alpha8_depth24")),
        ("resolve", "compute", "compute"),
        ("resolve", "fragment", "fragment"),
        ("resolve_classes", (1,), [1]),
        ("resolve_classes", [2, 64], [2, 64]),
        ("resolve_classes", np.array([1, 2, 3, 4, 5, 6, 7, 8]), [1, 2, 3, 4, 5, 6, 7, 8]),
    ],
)
def test_options_of_pipelines_with_nodes(asked, option, given, kept):
    for pipeline in ("linked_list", "prefix_sum"):
        assert asked(pipeline=pipeline, device="auto", **{option: given})[option] == kept
    assert asked(device="gpu", **{option: given})[option] == kept
    for arguments in ({"device": "cpu"}, {"pipeline": "tiles", "device": "auto"}, {"precision": "float64"}):
        with pytest.raises(ab.ParameterError) as caught:
            render(**arguments, **{option: given})
        assert f"{option} is an option of pipelines linked_list and prefix_sum" in str(caught.value)
        assert "this render's is tiles" in str(caught.value)


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("msaa_resolve", "per_pixle", "msaa_resolve must be one of 'per_pixel', 'per_sample', 'hdr', 'none'.*did you"),
        ("sort", "quick", "sort must be one of 'auto', 'insertion', .*got 'quick'"),
        ("sort", None, "sort must be one of"),
        ("limit_policy", "last", "limit_policy must be one of 'nearest', 'last_submitted'"),
        ("blend_order", "back to front", "did you mean 'back_to_front'"),
        ("max_sorted_fragments", 0, "max_sorted_fragments must be an integer, 1 or more, or None for all, got 0"),
        ("max_sorted_fragments", 18.0, "max_sorted_fragments must be .* got 18.0"),
        ("max_sorted_fragments", True, "max_sorted_fragments must be .* got True"),
        ("max_sorted_fragments", "18", "max_sorted_fragments must be .* got '18'"),
    ],
)
def test_values_that_are_refused(option, value, message):
    with pytest.raises(ab.ParameterError, match=message):
        render(**{option: value})


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("node_format", "rgba8", "node_format must be one of 'float32', 'rgba8_depth32', .* got 'rgba8'"),
        ("resolve", "vertex", "resolve must be one of 'compute', 'fragment', got 'vertex'"),
        *(
            ("resolve_classes", value, "resolve_classes must be 1 to 8 rising integers, each from 1 to 64, got")
            for value in (
                (),
                (4, 4),
                (4, 2),
                (0, 4),
                (1, 65),
                (1.0, 2),
                (True, 2),
                range(1, 10),
                4,
                "1248",
                None,
                [[1]],
            )
        ),
    ],
)
def test_values_of_node_options_that_are_refused(asked, option, value, message):
    with pytest.raises(ab.ParameterError, match=message):
        render(device="gpu", **{option: value})


def test_numpys_integers_become_pythons(asked):
    request = asked(
        device="gpu", samples=np.int8(4), max_sorted_fragments=np.uint16(7), resolve_classes=np.arange(1, 4)
    )
    values = [request["samples"], request["max_sorted_fragments"], *request["resolve_classes"]]
    assert values == [4, 7, 1, 2, 3]
    assert {type(value) for value in values} == {int}


def test_a_limit_beyond_any_list_is_no_error():
    assert render(max_sorted_fragments=10**12).stats.dropped_fragments == 0


def test_a_name_that_is_no_option_lists_those_there_are():
    with pytest.raises(ab.ParameterError, match=r"no argument 'msaa'.*options are msaa_resolve, sort, limit_policy"):
        render(msaa="hdr")
    with pytest.raises(ab.ParameterError, match="did you mean 'node_format'"):
        render(nodeformat="float32")


def test_no_option_is_named_like_an_argument():
    arguments = set(inspect.signature(ab.render).parameters)
    assert not arguments & set(options.EXACT_OPTIONS)
    assert set(options.EXACT_OPTIONS) == set(DEFAULTS)


def test_render_documents_every_option():
    for name in (*options.OPTIONS, "samples"):
        assert f"\n        {name}: " in ab.render.__doc__, name
