"""Every pipeline against the oracle: rays through pixel centres in float64, which share no code with us."""

import numpy as np
import pytest

import abuffer as ab
import oracle
import scenes
from comparison import CPU32, CPU64, GPU, GPU_TILES, assert_frame_matches

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


@pytest.mark.parametrize("precision", [CPU64, CPU32, GPU, GPU_TILES], ids=str)
@pytest.mark.parametrize(("name", "view"), CASES)
def test_lists_and_image_match_the_oracle(name, view, precision):
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
    measured = assert_frame_matches(frame, hits, edges, precision, background)
    print(", ".join(f"{key} {value:.3g}" for key, value in measured.items()))


@pytest.mark.parametrize("precision", [CPU32, GPU, GPU_TILES], ids=str)
def test_float32_depth_of_20_pixel_triangles_is_good_to_1e_5(precision):
    """The 99th percentile: 5e-4 from snapped vertices, 8e-5 from planes anchored at the image's corner."""
    width, height = 640, 480
    rng = np.random.default_rng(12)
    camera = (*scenes.look_at((0, 0, 0), (0, 0, -1), aspect=width / height), None, None)
    pixel = np.tan(np.radians(22.5)) * 2 / height  # world units at depth 1
    centers = rng.uniform(-0.5, 0.5, (1500, 1, 2)) * (width, height)
    depth = rng.uniform(1, 3, (1500, 3, 1))
    xy = (centers + rng.uniform(-20, 20, (1500, 3, 2))) * pixel * depth
    triangles = np.concatenate([xy, -depth], axis=-1).astype(np.float32).astype(np.float64)
    hits = oracle.trace(triangles, np.ones((1500, 3, 4)), oracle.OracleCamera(*camera), width, height)
    frags = precision.render(
        ab.Mesh(triangles.astype(np.float32)), ab.Camera(*camera[:2]), width=width, height=height, fragments=True
    ).fragments
    theirs = dict(zip(zip(hits.pixel.tolist(), hits.primitive.tolist(), strict=True), hits.depth, strict=True))
    pairs = zip(frags.pixel.tolist(), frags.primitive.tolist(), frags.depth.tolist(), strict=True)
    errors = [abs(d / theirs[p, t] - 1) for p, t, d in pairs if (p, t) in theirs]
    assert len(errors) > 150_000
    print(f"99th percentile of the relative depth error: {np.percentile(errors, 99):.2g}")
    assert np.percentile(errors, 99) < 1e-5


@pytest.mark.parametrize("precision", [CPU64, CPU32, GPU, GPU_TILES], ids=str)
def test_slivers_stay_within_the_range_of_their_vertices(precision):
    """Aspects over 1e4: their planes amplify every rounding, so only the hull of the vertices is promised."""
    rng = np.random.default_rng(13)
    start, along = rng.uniform(-1, 1, (3000, 1, 3)), rng.uniform(-1, 1, (3000, 1, 3))
    across = rng.normal(0, 1, (3000, 1, 3)) * np.linalg.norm(along, axis=-1, keepdims=True) * 5e-5
    triangles = np.concatenate([start, start + along, start + along / 2 + across], axis=1).astype(np.float32)
    colors = rng.uniform(0, 1, (3000, 3, 4)).astype(np.float32)
    camera = ab.Camera(*scenes.front_camera())
    frame = precision.render(ab.Mesh(triangles, colors=colors), camera, width=512, height=512, fragments=True)
    frags = frame.fragments
    assert len(frags) > 500
    assert np.isfinite(frame.image).all()
    corners = 3 - triangles[frags.primitive][..., 2].astype(np.float64)  # the eye is at z = 3
    # Depth comes back from 1/w: two roundings of a vertex's own depth, and one of the transform.
    slack = 4 * 2.0**-24 * 3 if precision is not CPU64 else 1e-12
    assert (frags.depth >= corners.min(axis=1) * (1 - slack) - slack).all()
    assert (frags.depth <= corners.max(axis=1) * (1 + slack) + slack).all()
    own = colors[frags.primitive]
    assert (frags.color >= own.min(axis=1)).all()
    assert (frags.color <= own.max(axis=1)).all()
