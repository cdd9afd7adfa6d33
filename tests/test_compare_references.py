"""What images are compared with, and what the errors are then of."""

import math

import numpy as np
import pytest

import abuffer as ab
from abuffer import ParameterError, comparing
from comparisons import CAMERA, QUICK, SHEETS, SIZE

GREY = np.full((36, 48, 4), 0.5)
# Where float32 and float64 rasterise some pixels otherwise.
EDGES = {
    "hair": ab.scenes.hair,
    "random": lambda: ab.scenes.random_triangles(n=300),
    "glass": ab.scenes.opaque_and_glass,
}
BOUNDED = ["exact", "depth_peeling", "dual_depth_peeling", "weighted_sum", "k_buffer"]


def test_an_image_of_ones_own_is_what_errors_are_of():
    found = ab.compare(SHEETS, CAMERA, **SIZE, **QUICK, methods=["exact"], reference=GREY)
    assert found.rows[0]["max_abs"] == pytest.approx(0.5 - 0.0625)
    np.testing.assert_array_equal(found.references["scene"], GREY)


def test_a_frame_and_a_dict_by_name_are_references():
    frame = ab.render(SHEETS, CAMERA, **SIZE, device="cpu", precision="float64")
    scenes = {"sheets": SHEETS, "again": SHEETS}
    reference = {"sheets": frame, "again": GREY}
    found = ab.compare(scenes, CAMERA, **SIZE, **QUICK, methods=["exact"], reference=reference)
    assert [row["max_abs"] > 1e-6 for row in found.rows] == [False, True]


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ("float32", "must be an image, got 'float32': 'float64' and 'fragments' are for all scenes"),
        ({"scene": "fragments"}, "must be an image, got 'fragments'"),
        ([[1, 2], [3]], "is no array"),
        (GREY[:-1], "must be an image of 36×48×4"),
        (GREY[..., :3], "must be an image of 36×48×4"),
        ((255 * GREY).astype(np.uint8), "floats, premultiplied and linear, got uint8: divide by 255"),
        (np.where(np.arange(4) == 1, np.nan, GREY), "not finite in 1,728 pixels"),
        ({"other": GREY}, "reference has no image of scene: it has other"),
    ],
)
def test_what_is_no_reference_is_refused_before_anything_is_measured(reference, message):
    with pytest.raises(ParameterError, match=message):
        ab.compare(
            SHEETS, CAMERA, **SIZE, **QUICK, reference=reference, progress=lambda *_: pytest.fail("it was measured")
        )


def test_one_image_is_not_the_reference_of_two_scenes():
    with pytest.raises(ParameterError, match="reference is one image, and there are 2 scenes"):
        ab.compare({"a": SHEETS, "b": SHEETS}, CAMERA, **SIZE, **QUICK, reference=GREY)


@pytest.mark.parametrize("name", EDGES)
def test_of_the_same_fragments_errors_are_of_compositing_alone(name):
    """And then within what they are proven to be, pixel for pixel; beside float64's geometry they need not be."""
    arguments = {"width": 120, "height": 90, **QUICK, "methods": BOUNDED}
    found = ab.compare(EDGES[name](), **arguments, reference="fragments")
    (exact,) = found.exact.values()
    assert exact.fragments.depth.dtype == np.float32
    np.testing.assert_array_equal(found.references[found.scenes[0]], exact.fragments.composite())
    assert 0 < found.rows[0]["max_abs"] < 2e-6
    assert all(row["max_abs"] <= row["error_bound"] for row in found.rows)
    assert all(math.isfinite(row["error_bound"]) for row in found.rows)


def test_lists_that_are_too_many_are_not_kept_and_make_the_reference_all_the_same(monkeypatch):
    arguments = {"width": 60, "height": 45, **QUICK, "methods": ["exact"], "reference": "fragments"}
    whole = ab.compare(ab.scenes.hair(), **arguments)
    monkeypatch.setattr(comparing, "MOST_FRAGMENTS", 100)
    found = ab.compare(ab.scenes.hair(), **arguments)
    assert found.exact["hair"].fragments is None
    np.testing.assert_array_equal(found.references["hair"], whole.references["hair"])


def test_a_dict_is_matched_by_names_as_text():
    found = ab.compare({1: SHEETS}, CAMERA, **SIZE, **QUICK, methods=["exact"], reference={1: GREY})
    assert found.scenes == ["1"] and found.rows[0]["max_abs"] > 0.4


def test_beside_float64_geometry_edges_are_among_errors():
    arguments = {"width": 120, "height": 90, **QUICK, "methods": ["exact"]}
    found, same = (ab.compare(ab.scenes.hair(), **arguments, reference=each) for each in ("float64", "fragments"))
    assert found.rows[0]["max_abs"] > 1e-3 > same.rows[0]["max_abs"]
    # A few pixels alone.
    off = np.abs(found.references["hair"] - same.references["hair"]).max(axis=2)
    assert 0 < (off > 1e-5).mean() < 0.01
