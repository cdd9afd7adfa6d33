"""Every pipeline against the oracle: rays through pixel centres in float64, which share no code with us."""

import numpy as np
import pytest

import abuffer as ab
import oracle
import scenes
from comparison import CPU32, CPU64, GPU, assert_frame_matches

# name: (triangles and colours, width, height)
SCENES = {
    "random": (scenes.random_triangles(300, 0.5, seed=1), 96, 64),
    "random_flat": (scenes.random_triangles(2000, 0.2, seed=2, flat=True), 96, 96),
    "nested_icospheres": (scenes.nested_icospheres(4, 3), 96, 96),
    "cyclic_three": (scenes.cyclic_three(), 64, 64),
    "bumpy_sphere": (scenes.bumpy_sphere(), 192, 192),
    "near_crossing": (scenes.near_crossing(), 96, 64),
    "offscreen_and_degenerate": (scenes.offscreen_and_degenerate(), 64, 64),
    "covering": (scenes.covering(), 33, 17),
    "layers": (scenes.layers(2000, 0.01), 16, 16),
    "duplicates": (scenes.duplicates(), 64, 64),
    "far_from_origin": (scenes.far_from_origin(), 64, 64),
}


def views(name, width, height):
    aspect = width / height
    if name == "far_from_origin":
        eye = np.array([1e6, 1e6, 1e6])
        return {"perspective": (*scenes.look_at(eye + (0, 0, 3), eye, aspect=aspect), None, None)}
    found = {"perspective": (*scenes.front_camera(aspect), None, None)}
    if name in ("random", "near_crossing", "nested_icospheres"):
        near, far = 2.4, 3.3
        found["near_far"] = (*scenes.front_camera(aspect, near=near, far=far), near, far)
        found["orthographic"] = (*scenes.orthographic(scenes.EYE, (0, 0, 0), height=2.2, aspect=aspect), None, None)
    return found


CASES = [
    pytest.param(name, view, id=f"{name}-{view}")
    for name, (_, width, height) in SCENES.items()
    for view in views(name, width, height)
]


@pytest.mark.parametrize("precision", [CPU64, CPU32, GPU], ids=str)
@pytest.mark.parametrize(("name", "view"), CASES)
def test_lists_and_image_match_the_oracle(name, view, precision, record_property):
    (triangles, colors), width, height = SCENES[name]
    matrices = views(name, width, height)[view]
    background = (0.2, 0.4, 0.1, 1.0)
    truth = oracle.OracleCamera(*matrices)
    hits = oracle.trace(triangles, colors, truth, width, height)
    edges = oracle.edge_distance(triangles, truth, width, height)
    frame = precision.render(
        ab.Mesh(triangles, colors=colors),
        ab.Camera(*matrices[:2]),
        width=width,
        height=height,
        background=background,
        fragments=True,
    )
    for key, value in assert_frame_matches(frame, hits, edges, precision, background).items():
        record_property(key, value)
