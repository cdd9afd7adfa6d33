"""The standard scenes are the same for everybody, have the images that they say they have, and are hard for what they say."""

import hashlib
import importlib.util
import inspect
import itertools
import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import abuffer as ab
from abuffer.own_methods import BUILT_IN

DOCS = Path(__file__).parents[1] / "docs"
SUITE = ab.scenes.suite("standard")
MAKERS = [getattr(ab.scenes, name) for name in (*SUITE, "model")]
EXACT = {"exact", "depth_peeling", "dual_depth_peeling"}
# All depths of coplanar tie, which it is for.
each = pytest.mark.parametrize("standard", SUITE.values(), ids=list(SUITE))
untied = pytest.mark.parametrize("standard", [s for s in SUITE.values() if s.name != "coplanar"], ids=lambda s: s.name)


def rendered(s, scene=None, *, width=160, height=120, **options):
    """Of a standard scene, or of another scene with its camera and background."""
    look = {"width": width, "height": height, "background": s.background, "device": "cpu", "precision": "float64"}
    return ab.render(s.scene if scene is None else scene, s.camera, **look | options)


def image(s, scene=None, **options):
    return rendered(s, scene, **options).image[..., :3]


def off(s, **options):
    """What a method is off by at most, of a channel."""
    return np.abs(image(s, **options) - image(s)).max()


def shuffled(s, seed=0):
    """The scene with meshes and faces in another order."""
    rng = np.random.default_rng(seed)
    meshes = []
    for mesh in s.scene.meshes:
        order, faces = rng.permutation(mesh.face_count), mesh.faces
        faces = np.arange(len(mesh.positions)).reshape(-1, 3) if faces is None else faces
        colors = mesh.colors[order] if mesh.color_mode == "face" else mesh.colors
        meshes.append(mesh.replaced(faces=faces[order], colors=colors, color_mode=mesh.color_mode))
    return ab.Scene([meshes[i] for i in rng.permutation(len(meshes))])


# ---- the same for everybody ----


def checksum(scenes):
    digest = hashlib.sha256()
    for s in scenes.values():
        digest.update(s.name.encode())
        for mesh in s.scene.meshes:
            faces = np.zeros((0, 3), np.uint32) if mesh.faces is None else mesh.faces
            for array in (mesh.positions, faces, mesh.colors):
                digest.update(array.astype(array.dtype.newbyteorder("<")).tobytes())
            digest.update(f"{mesh.color_mode} {mesh.blend} {mesh.opaque}".encode())
        for matrix in (*s.camera.matrices(160, 120), np.array(s.background)):
            digest.update(matrix.astype("<f8").tobytes())
    return digest.hexdigest()


def test_standard_1_is_what_it_always_was():
    """To be changed only with the version's name: papers say it."""
    assert checksum(ab.scenes.suite("standard-1")) == "dec1d19f532e5e3896b96bc71f0790df2838b70b8dafbed18da344ed552b8ecf"


def test_another_bit_would_be_told():
    s = SUITE["cyclic"]
    first, *others = s.scene.meshes
    colors = first.colors.copy()
    colors[0, 0] = np.nextafter(colors[0, 0], np.float32(0))
    changed = SUITE | {"cyclic": replace(s, scene=ab.Scene([first.replaced(colors=colors), *others]))}
    assert checksum(changed) != checksum(SUITE)
    assert checksum(SUITE | {"cyclic": replace(s, background=(0.94, 0.94, 0.95))}) != checksum(SUITE)


def test_standard_1_has_as_many_fragments_as_it_always_had():
    """At 160×120."""
    assert {name: rendered(s, precision="float32").stats.fragments for name, s in SUITE.items()} == {
        "stack": 16 * 160 * 120,
        "intersecting": 13_320,
        "cyclic": 6_306,
        "coplanar": 26_568,
        "nested_spheres": 36_392,
        "random_triangles": 33_350,
        "thin_sheets": 256 * 160 * 120,
        "opaque_and_glass": 13_722,
        "hair": 33_318,
        "smoke": 258_976,
        "hdr_lights": 29_298,
    }


def test_the_newest_suite_says_its_version():
    assert SUITE.version == "standard-1"
    assert list(SUITE) == list(ab.scenes.suite("standard-1")) == [s.name for s in SUITE.values()]
    assert "standard-1" in repr(SUITE) and "hair" in repr(SUITE)


def test_an_unknown_suite_lists_those_that_there_are():
    with pytest.raises(ab.ParameterError, match=r"'standard', 'standard-1', got 'standrad'; did you mean 'standard'"):
        ab.scenes.suite("standrad")


def test_another_seed_is_another_scene_of_the_kind():
    for make in (ab.scenes.random_triangles, ab.scenes.hair, ab.scenes.smoke, ab.scenes.hdr_lights):
        first, again, other = make(), make(seed=0), make(seed=1)
        assert checksum({"": first}) == checksum({"": again}) != checksum({"": other})
        assert first.scene.triangle_count == other.scene.triangle_count


# ---- what each has ----


@each
def test_a_scene_has_all_that_an_image_needs(standard):
    frame = rendered(standard, precision="float32", fragments="count")
    assert frame.counts.max() >= 2
    assert np.isfinite(frame.image).all()
    assert np.ptp(frame.image[..., :3], axis=(0, 1)).max() > 0.1, "something should be seen"


@each
def test_positions_and_colours_are_what_every_device_takes_as_they_are(standard):
    for mesh in standard.scene.meshes:
        assert mesh.positions.dtype == mesh.colors.dtype == np.float32
        assert mesh.blend == "over"
        assert (mesh.colors[..., 3] == 1).all() if mesh.opaque else (mesh.colors[..., 3] < 1).all()
    brightest = max(mesh.colors[..., :3].max() for mesh in standard.scene.meshes)
    assert brightest == (1e4 if standard.name == "hdr_lights" else min(brightest, 1))


@pytest.mark.parametrize("make", MAKERS, ids=lambda make: make.__name__)
def test_a_docstring_says_what_a_scene_is_hard_for(make):
    assert "\n\nHard for: " in inspect.getdoc(make)
    if make.__name__ in SUITE:
        s = SUITE[make.__name__]
        assert len(s.hard_for) > 20
        assert ("\n\nClosed form" in inspect.getdoc(make)) == (s.expected is not None)


@untied
def test_the_order_of_submission_changes_no_bit(standard):
    np.testing.assert_array_equal(image(standard), image(standard, shuffled(standard)))


@each
def test_the_order_of_submission_would_show_without_sorting(standard):
    unsorted = {"method": "unsorted"}
    assert np.abs(image(standard, **unsorted) - image(standard, shuffled(standard), **unsorted)).max() > 0.01


@pytest.mark.parametrize(
    ("make", "arguments"),
    [
        (ab.scenes.stack, {"n": 0}),
        (ab.scenes.stack, {"n": True}),
        (ab.scenes.stack, {"n": 2.0}),
        (ab.scenes.stack, {"alpha": 1.5}),
        (ab.scenes.thin_sheets, {"n": 1}),
        (ab.scenes.nested_spheres, {"n": -1}),
        (ab.scenes.random_triangles, {"size": 0}),
        (ab.scenes.random_triangles, {"seed": -1}),
        (ab.scenes.hair, {"strands": 0}),
        (ab.scenes.smoke, {"n": 0}),
        (ab.scenes.hdr_lights, {"seed": 0.5}),
    ],
)
def test_an_argument_out_of_range_is_named(make, arguments):
    (name,) = arguments
    with pytest.raises(ab.ParameterError, match=f"^{name} must be"):
        make(**arguments)


# ---- closed forms ----

CLOSED = [
    *(s for s in SUITE.values() if s.expected is not None),
    *(ab.scenes.stack(n, alpha) for n in (1, 2, 9) for alpha in (0, 1e-7, 0.3, 1)),
    *(ab.scenes.thin_sheets(n, alpha) for n, alpha in ((2, 0.5), (40, 0), (40, 1), (1000, 1e-3))),
]


@pytest.mark.parametrize("size", [(160, 120), (211, 37), (40, 91)], ids=str)
def test_an_image_is_its_closed_form(size):
    """Up to the roundings of float64; left out is a small part of the pixels, at edges."""
    width, height = size
    for s in CLOSED:
        wanted = s.expected(width, height)
        found = rendered(s, width=width, height=height).image
        known = np.isfinite(wanted).all(axis=-1)
        assert known.mean() > 0.7
        np.testing.assert_allclose(found[known], wanted[known], atol=1e-12, err_msg=s.name)


def test_a_closed_form_tells_another_image():
    for s in (s for s in SUITE.values() if s.expected is not None):
        assert np.nanmax(np.abs(image(s)[:, ::-1] - s.expected(160, 120)[..., :3])) > 0.05, s.name


def test_a_pixel_that_k_spheres_cover_has_2k_fragments():
    for n in (1, 3, 5):
        counts = rendered(ab.scenes.nested_spheres(n), fragments="count").counts
        assert set(np.unique(counts)) == {2 * k for k in range(n + 1)}
        assert (counts[58:62, 78:82] == 2 * n).all()


# ---- hard for what it says ----


def test_stack_is_hard_for_a_limit_of_layers():
    s = SUITE["stack"]
    short = image(s, method="k_buffer", k=8) - image(s)
    assert short[60, 10] == pytest.approx(np.full(3, 0.5**16 - 0.5**8), abs=1e-12)  # the white sheets that are dropped


@pytest.mark.parametrize("name", ["intersecting", "cyclic"])
def test_no_order_of_triangles_paints_it_right(name):
    s = SUITE[name]
    triangles = [
        ab.Mesh(corners[None], colors=color)
        for mesh in s.scene.meshes
        for corners, color in zip(mesh.triangles(), mesh.colors, strict=True)
    ]
    small = {"width": 40, "height": 30}
    exact = image(s, **small)
    painted = [image(s, list(order), method="unsorted", **small) for order in itertools.permutations(triangles)]
    assert len(painted) == 720
    assert min(np.abs(one - exact).max() for one in painted) > 0.2
    assert off(s, method="triangle_sorted") > 0.2 and off(s, method="object_sorted") > 0.2


def test_coplanar_is_hard_for_methods_that_keep_one_fragment_of_a_depth():
    s = SUITE["coplanar"]
    assert off(s, method="bucket_peeling") > 0.2
    assert np.abs(image(s, list(s.scene.meshes)[::-1]) - image(s)).max() > 0.2, "of ties the later one is in front"


def test_nested_spheres_are_hard_without_sorting_and_for_sorting_objects():
    s = SUITE["nested_spheres"]
    assert off(s, method="unsorted") > 0.1 and off(s, method="object_sorted") > 0.1


def test_random_triangles_have_lists_of_every_length_and_no_approximation_is_right():
    s = SUITE["random_triangles"]
    counts = rendered(s, fragments="count").counts
    assert set(range(15)) <= set(np.unique(counts))
    for method in BUILT_IN - EXACT:
        assert off(s, method=method) > 0.02, method


def test_thin_sheets_are_worse_with_weights_by_depth_than_with_none():
    s = SUITE["thin_sheets"]
    none, *weighted = (off(s, method="wboit", weight=weight) for weight in ("none", "7", "8", "10"))
    assert min(weighted) > none > 0.1
    assert off(s, method="wboit", weight="10") > 0.5


def test_thin_sheets_stall_in_8_bits():
    """Blended back to front, as hardware does, with each sum rounded to 1/255."""
    s = SUITE["thin_sheets"]
    front_to_back = rendered(s, width=4, height=3, fragments=True).fragments[1, 0].color.astype(np.float64)
    assert len(front_to_back) == 256
    whole, rounded = np.zeros(3), np.zeros(3)
    for *rgb, alpha in front_to_back[::-1]:
        whole = whole * (1 - alpha) + alpha * np.array(rgb)
        rounded = np.round(255 * (rounded * (1 - alpha) + alpha * np.array(rgb))) / 255
    np.testing.assert_allclose(whole, image(s, width=4, height=3)[1, 0], atol=1e-12)
    assert np.abs(rounded - whole).max() > 10 / 255


def test_opaque_bodies_hide_what_is_behind_them():
    s = SUITE["opaque_and_glass"]
    glass = [mesh for mesh in s.scene.meshes if not mesh.opaque]
    counts, without = (rendered(s, scene, fragments="count").counts for scene in (s.scene, glass))
    assert (counts <= without).all()
    assert 0.02 < (counts < without).mean() < 0.5, "some glass is behind the bodies"
    assert (counts > 0).mean() > 0.3, "and some in front or beside"
    as_glass = [mesh.replaced(opaque=False) for mesh in s.scene.meshes]
    np.testing.assert_allclose(image(s, as_glass), image(s), atol=1e-12)  # alpha 1 hides as well
    assert np.abs(image(s, as_glass, method="wboit") - image(s)).max() > 0.1


def test_hair_is_thinner_than_a_pixel_and_crowds():
    s = SUITE["hair"]
    one, many = (image(s, width=480, height=360, samples=n) for n in (1, 16))
    assert np.abs(one - many).mean() > 0.02
    assert off(s, method="stencil_routed") > 0.1


def test_smoke_is_hard_for_short_lists_and_easy_for_sums():
    s = SUITE["smoke"]
    assert off(s, method="k_buffer") > 0.2 > 5 * off(s, method="wboit", weight="none")


def test_hdr_lights_overflow_half_floats_make_fireflies_and_hide_the_errors_of_what_is_dim():
    s = SUITE["hdr_lights"]
    lists = rendered(s, fragments=True).fragments
    weighted = 3e3 * lists.color[:, 3] * lists.color[:, :3].max(axis=1)  # the largest weight of wboit
    assert weighted.max() > 100 * float(np.finfo(np.float16).max)
    assert off(s, method="stochastic") > 500
    bright = image(s).max(axis=-1)
    assert bright.max() > 5000 and np.median(bright) < 0.2


# ---- the model ----


@pytest.fixture
def model():
    pytest.importorskip("trimesh")
    if importlib.util.find_spec("pymeshfix") is None:
        pytest.skip("the bunny comes with pymeshfix")
    return ab.scenes.model()


def test_the_model_is_hard_without_sorting(model):
    assert model.scene.triangle_count == 99_785
    assert off(model, method="unsorted") > 0.05
    assert model.name not in SUITE


def test_without_the_package_that_has_the_file_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ab.UnsupportedError, match="pip install --no-deps 'pymeshfix"):
        ab.scenes.model()


# ---- the page ----

PAGE = runpy.run_path(str(DOCS / "scenes.py"))


def test_the_table_of_the_page_is_what_the_scenes_are():
    """`python docs/scenes.py` writes it anew."""
    text = (DOCS / "scenes.md").read_text(encoding="utf-8")
    assert PAGE["refreshed"](text) == text
    assert all(f"| `{name}` |" in text for name in SUITE)


def test_the_picture_of_the_page_shows_what_is_rendered(model):
    """`python docs/scenes.py` draws it anew."""
    images = pytest.importorskip("PIL.Image")
    drawn = np.asarray(images.open(DOCS / "scenes.png").convert("RGB"), int)
    for i, s in enumerate([*SUITE.values(), model]):
        left, top = PAGE["corner"](i)
        there = drawn[top : top + PAGE["HEIGHT"], left : left + PAGE["WIDTH"]]
        assert np.abs(there - PAGE["tile"](s)).max() <= 1, s.name
