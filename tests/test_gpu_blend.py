"""A user's blend on a GPU: what WGSL gives is what numpy gives, wherever a fragment is stored and resolved."""

import numpy as np
import pytest

import abuffer as ab
import scenes
from comparison import GPU, GPU_PREFIX, GPU_TILES

FRONT = ab.Camera(*scenes.front_camera())
BOTH = pytest.mark.parametrize("pipeline", [GPU, GPU_PREFIX, GPU_TILES], ids=str)

OVER = ab.Blend("dst * (1.0 - src.a) + src.rgb * src.a", lambda d, s, z: d * (1 - s[:, 3:]) + s[:, :3] * s[:, 3:])
FOG = ab.Blend(
    "let near = 1.0 / (1.0 + depth);\nreturn mix(dst, src.rgb, near * src.a);",
    lambda d, s, z: d + (s[:, :3] - d) * (s[:, 3] / (1 + z))[:, None],
    "fog",
)
COVER = ab.Blend("vec4f(max(dst, src.rgb), 0.5)", lambda d, s, z: np.c_[np.maximum(d, s[:, :3]), np.full(len(d), 0.5)])


def scene(*blends, count=40, seed=5):
    triangles, colors = scenes.random_triangles(count, 0.6, seed=seed)
    parts = np.array_split(np.arange(count), len(blends))
    return [ab.Mesh(triangles[p], colors=colors[p], blend=b) for p, b in zip(parts, blends, strict=True)]


def assert_matches_numpy(frame, **options):
    """The image is its own lists, composited by the callables in float64."""
    wanted = frame.fragments.composite(**options)
    n = frame.fragments.counts.max()
    # Each layer rounds its few operations in float32, on values up to 1: the blends here do not amplify what is behind.
    assert np.abs(frame.image - wanted).max() <= 16 * (n + 1) * 2.0**-24
    assert n > 4


OPTIONS = [
    {},
    {"samples": 4},
    {"samples": 4, "msaa_resolve": "per_sample"},
    {"samples": 4, "msaa_resolve": "hdr"},
    {"resolve": "fragment"},
    {"resolve": "fragment", "samples": 4},
    {"resolve_classes": (2,)},
    {"resolve_classes": (2,), "samples": 4},
    {"sort": "heap"},
    {"memory": "200kB"},
    {"node_format": "rgba8_depth24_coverage8", "samples": 4},
]


# Tiles have no say in how lists are stored and resolved.
OF_LISTS = {"resolve", "resolve_classes", "node_format"}
PAIRS = [(p, o) for p in (GPU, GPU_PREFIX, GPU_TILES) for o in OPTIONS if p is not GPU_TILES or not OF_LISTS & set(o)]


@pytest.mark.parametrize(("pipeline", "options"), PAIRS, ids=str)
def test_wgsl_gives_what_numpy_gives(pipeline, options):
    meshes = scene("over", FOG, "screen", COVER, OVER, "additive")
    frame = pipeline.render(
        meshes, FRONT, width=48, height=48, fragments=True, background=(0.2, 0.4, 0.6, 1), **options
    )
    assert_matches_numpy(frame, msaa_resolve=options.get("msaa_resolve", "per_pixel"))


def test_a_perturbed_callable_would_be_seen(needs_gpu):
    frame = GPU.render(scene("over", FOG), FRONT, width=48, height=48, fragments=True)
    frame.fragments.blends = (ab.Blend(numpy=lambda d, s, z: FOG.numpy(d, s, z * 1.01)),)
    with pytest.raises(AssertionError):
        assert_matches_numpy(frame)


@BOTH
def test_lists_longer_than_any_array_are_blended_too(pipeline):
    triangles, colors = scenes.layers(200, 0.1)
    frame = pipeline.render(ab.Mesh(triangles, colors=colors, blend=FOG), FRONT, width=8, height=8, fragments=True)
    assert frame.stats.max_depth_complexity == 200
    assert_matches_numpy(frame)


def test_a_blend_that_is_written_over_is_over(needs_gpu):
    own, named = (
        GPU.render(scene(blend), FRONT, width=48, height=48, background=(0.2, 0.4, 0.6)).image
        for blend in (OVER, "over")
    )
    np.testing.assert_allclose(own[..., :3], named[..., :3], atol=1e-5)


@pytest.mark.parametrize(
    ("text", "line", "what"),
    [
        ("dst * colour", 1, "colour"),
        ("let a = 1.0;\nreturn dst * missing;", 2, "missing"),
        ("dst.r", 1, "vec3f"),
        ("dst *", 1, "an expression has no `;`"),
        ("dst + dpdx(src.rgb)", 1, "derive"),
        ("discard;\nreturn dst;", 1, "discard"),
        ("return f(dst);\n}\nfn f(x: vec3f) -> vec3f {\nreturn x;", 1, "one function"),
    ],
)
def test_what_is_wrong_is_told_in_the_users_own_lines_where_the_blend_is_made(text, line, what):
    with pytest.raises(ab.ShaderError, match=rf"^glass:{line}: .*{what}"):
        ab.Blend(text, name="glass")


def test_software_drivers_refuse_loops_which_they_may_end_early(needs_gpu):
    looping = ab.Blend("var d = dst;\nfor (var i = 0; i < 3; i++) { d *= 0.5; }\nreturn d;")
    try:
        frame = GPU.render(scene(looping), FRONT, width=8, height=8)
    except ab.UnsupportedError as error:
        assert "loop" in str(error)  # on a software driver
    else:
        assert ab.devices()[frame.stats.device]["kind"] != "software"


def test_text_that_no_compiler_should_see_is_refused():
    for text in ("dst" + "+dst" * 15_000, "\ud800"):
        with pytest.raises(ab.ParameterError, match="at most 4000"):
            ab.Blend(text)


def test_a_mesh_without_faces_brings_no_blend(needs_gpu):
    empty = ab.Mesh(np.zeros((0, 3)), blend=ab.Blend("dst"))
    frame = GPU.render([*scene("over"), empty], FRONT, width=8, height=8)
    assert frame.plan["direction"] == "front to back"
    ab.render([*scene("over"), empty], FRONT, width=8, height=8, device="cpu")


def test_the_hdr_resolve_bears_colours_below_0(needs_gpu):
    dark = ab.Blend("src.rgb * 0.0 - vec3f(1.0)", lambda d, s, z: d * 0 - 1)
    frame = GPU.render(scene(dark), FRONT, width=16, height=16, samples=4, msaa_resolve="hdr")
    assert np.isfinite(frame.image).all()
    assert frame.image.min() == -1
