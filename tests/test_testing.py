"""`abuffer.testing.assert_matches_reference`: what passes, what fails, and what the failure says."""

import builtins

import numpy as np
import pytest
from PIL import Image

import abuffer as ab
import oracle
import oracle_msaa
import scenes
from abuffer import _core, testing
from abuffer.testing import assert_matches_reference, edge_band

WIDTH, HEIGHT = 48, 40
FOCAL = HEIGHT / 2 / np.tan(np.radians(45) / 2)
WHITE = (1, 1, 1, 1)


def triangles_scene(**look):
    """Random triangles of one colour each that interpenetrate, seen from either side, then some of them once more."""
    positions, colors = scenes.random_triangles(60, 0.5, seed=1, flat=True)
    other = scenes.random_triangles(12, 0.5, seed=7, flat=True)[1]
    return ab.Scene([ab.Mesh(positions, colors=colors, name="first", **look), ab.Mesh(positions[:12], colors=other)])


def pinhole(right=0.0, down=0.0):
    """`scenes.front_camera` as intrinsics, with the image moved by so many pixels."""
    k = [[FOCAL, 0, WIDTH / 2 + right], [0, FOCAL, HEIGHT / 2 + down], [0, 0, 1]]
    world_to_camera = np.diag([1.0, -1.0, -1.0, 1.0])
    world_to_camera[2, 3] = 3
    return ab.Camera.from_intrinsics(k, world_to_camera, width=WIDTH, height=HEIGHT, pixel_center=0.5)


SCENE, CAMERA = triangles_scene(), pinhole()


def rendered(scene=SCENE, camera=CAMERA, **kw):
    return ab.render(scene, camera, width=WIDTH, height=HEIGHT, device="cpu", precision="float64", **kw)


def right_image():
    return rendered().straight


def relisted(change):
    """The straight image that blending `change(fragments)` of each pixel gives, front to back."""
    lists = rendered(fragments=True).fragments
    image = np.zeros((HEIGHT, WIDTH, 4))
    for y in range(HEIGHT):
        for x in range(WIDTH):
            pixel = np.zeros(4)
            for row in reversed(list(change(lists[y, x]))):
                alpha = row.color[3]
                pixel = np.array([*(row.color[:3] * alpha), alpha]) + (1 - alpha) * pixel
            image[y, x] = pixel
    return straight(image)


def straight(image):
    alpha = image[..., 3:]
    return np.concatenate([np.where(alpha > 0, image[..., :3] / np.where(alpha > 0, alpha, 1), 0), alpha], axis=-1)


def decode(encoded):
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def encode(linear):
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)


def with_rgb(image, rgb):
    return np.concatenate([rgb, image[..., 3:]], axis=-1)


def recolored(transfer):
    meshes = [mesh.replaced(colors=with_rgb(mesh.colors, transfer(mesh.colors[..., :3]))) for mesh in SCENE.meshes]
    return ab.Scene(meshes)


def failure(image, scene=SCENE, camera=CAMERA, **kw):
    """What the assertion says of an image that must not pass."""
    with pytest.raises(AssertionError) as caught:
        assert_matches_reference(image, scene, camera, **kw)
    return str(caught.value)


def best(text):
    """The first explanation in a failure's text."""
    lines = text.splitlines()
    at = [i for i, line in enumerate(lines) if line.startswith("what would explain it")]
    assert at, text
    return lines[at[0] + 1].strip()


# ---- what passes


def test_an_8_bit_png_passes(tmp_path):
    rendered().save(tmp_path / "a.png")
    assert_matches_reference(tmp_path / "a.png", SCENE, CAMERA)
    assert_matches_reference(str(tmp_path / "a.png"), SCENE, CAMERA)


@pytest.mark.parametrize("background", [(0, 0, 0, 0), (0.2, 0.4, 0.6, 0.5), WHITE])
@pytest.mark.parametrize("srgb", [False, True])
def test_8_bits_pass_over_any_background(background, srgb):
    image = rendered(background=background).to_uint8(srgb=srgb)
    assert_matches_reference(image, SCENE, CAMERA, background=background, srgb=srgb)


def test_straight_floats_pass_at_a_tight_tolerance():
    assert_matches_reference(rendered().straight, SCENE, CAMERA, tolerance=1e-12)


def test_premultiplied_floats_pass_at_a_tight_tolerance():
    assert_matches_reference(rendered().image, SCENE, CAMERA, premultiplied=True, tolerance=1e-12)


def test_a_float32_render_passes():
    image = ab.render(SCENE, CAMERA, device="cpu").image
    assert image.dtype == np.float32
    assert_matches_reference(image, SCENE, CAMERA, premultiplied=True)


def test_srgb_encodes_the_form_that_the_image_has():
    image = rendered().image
    as_straight = with_rgb(image, encode(rendered().straight[..., :3]))
    assert_matches_reference(as_straight, SCENE, CAMERA, srgb=True, tolerance=1e-9)
    as_premultiplied = with_rgb(image, encode(image[..., :3]))
    assert_matches_reference(as_premultiplied, SCENE, CAMERA, srgb=True, premultiplied=True, tolerance=1e-9)


def test_the_colour_of_invisible_pixels_does_not_matter():
    image = rendered().straight
    image[image[..., 3] == 0, :3] = 0.7
    assert_matches_reference(image, SCENE, CAMERA)


@pytest.mark.parametrize("premultiplied", [False, True])
def test_three_channels_are_compared_over_an_opaque_background(premultiplied):
    image = rendered(background=WHITE).to_uint8()[..., :3]
    assert_matches_reference(image, SCENE, CAMERA, background=WHITE, premultiplied=premultiplied)
    assert "(RGB)" in failure(image[::-1], background=WHITE)


def test_three_channels_over_a_translucent_background_are_over_black():
    image = rendered(background=(0.5, 0.6, 0.7, 0.5)).image[..., :3]
    assert_matches_reference(image, SCENE, CAMERA, background=(0.5, 0.6, 0.7, 0.5), tolerance=1e-12)


def test_integers_cannot_hold_more_than_1_so_the_reference_does_not_either():
    bright = ab.Mesh(scenes.covering()[0], colors=(4.0, 2.0, 0.1, 0.9))
    image = np.broadcast_to(np.uint8([255, 255, 26, 230]), (HEIGHT, WIDTH, 4))
    assert_matches_reference(image, bright, CAMERA)
    assert "differs" in failure(image / 255, bright)


def test_grey_and_palette_pngs_are_read(tmp_path):
    grey = ab.Mesh(scenes.covering()[0], colors=(0.4, 0.4, 0.4, 1))
    Image.new("L", (WIDTH, HEIGHT), 102).save(tmp_path / "grey.png")
    Image.new("RGB", (WIDTH, HEIGHT), (102, 102, 102)).convert("P").save(tmp_path / "palette.png")
    assert_matches_reference(tmp_path / "grey.png", grey, CAMERA)
    assert_matches_reference(tmp_path / "palette.png", grey, CAMERA)


def test_a_fitted_camera_and_a_plain_mesh_do():
    mesh = ab.Mesh(scenes.covering()[0])
    camera = ab.Camera.fit(mesh)
    image = ab.render(mesh, camera, width=30, height=20, device="cpu").to_uint8()
    assert_matches_reference(image, mesh, camera)


# ---- where the line is


def test_a_difference_of_the_tolerance_passes_and_one_beyond_fails():
    opaque = ab.Mesh(scenes.covering()[0], colors=(0.5, 0.5, 0.5, 1))
    image = rendered(opaque).image
    image[..., 1] += 1 / 255
    assert_matches_reference(image, opaque, CAMERA)
    image[3, 4, 1] += 1e-6
    assert "1 of 1,920 compared pixels" in failure(image, opaque)


def unit_square(left):
    """A square from `left` to the right, for an orthographic camera of a pixel a unit."""
    corners = [(left, -20.25), (30.25, -20.25), (30.25, 5.25), (left, 5.25)]
    return ab.Mesh([(x, y, 0) for x, y in corners], [[0, 1, 2], [0, 2, 3]], colors=(0.9, 0.5, 0.1, 0.6))


def test_pixels_next_to_an_edge_are_not_compared():
    camera = ab.Camera.orthographic((0, 0, 1), (0, 0, 0), height=HEIGHT)
    at, moved = -10.5 - 1 / 400, -10.5 + 1 / 400  # over a column of pixel centres: one has it, the other has not
    image = rendered(unit_square(moved), camera).straight
    assert_matches_reference(image, unit_square(at), camera)
    text = failure(image, unit_square(at), camera, edge=0)
    assert "25 of 1,920 compared pixels" in text
    assert "not compared: 0 pixels (0.00%) are within 0 px of an edge" in text


def test_near_ties_may_come_in_either_order():
    near, far = scenes.covering(0.0)[0] / 40, scenes.covering(-1e-6)[0] / 40
    tied = [ab.Mesh(near, colors=(1, 0, 0, 0.5)), ab.Mesh(far, colors=(0, 0, 1, 0.5))]
    swapped = [ab.Mesh(far, colors=(1, 0, 0, 0.5)), ab.Mesh(near, colors=(0, 0, 1, 0.5))]
    rest = ab.Mesh(scenes.covering(0.5)[0], colors=(0, 1, 0, 0.2))
    image = rendered([*swapped, rest]).straight
    assert_matches_reference(image, [*tied, rest], CAMERA)
    image[0, 0, 0] += 0.5
    assert "have near ties in depth" in failure(image, [*tied, rest])


def test_exact_ties_are_compared():
    twice = [ab.Mesh(scenes.covering()[0], colors=c) for c in ((0.9, 0.3, 0.2, 0.5), (0.1, 0.6, 0.4, 0.5))]
    image = rendered(twice[::-1]).straight
    assert best(failure(image, twice)).startswith(("arrival", "reverse", "back to front", "ties swapped"))
    assert "ties swapped" in failure(image, twice)


def test_what_ties_with_an_opaque_surface_is_not_compared():
    floor = ab.Mesh(scenes.covering(0.0)[0], colors=(0.2, 0.2, 0.2), opaque=True)
    decal = ab.Mesh(scenes.covering(1e-6)[0] / 40, colors=(1, 0, 0, 0.5))
    hidden = rendered(floor).straight
    assert_matches_reference(hidden, [floor, decal], CAMERA)


def test_nothing_left_to_compare_is_a_failure():
    tied = [ab.Mesh(scenes.covering(z)[0], colors=c) for z, c in ((0.0, (1, 0, 0, 0.5)), (1e-6, (0, 0, 1, 0.5)))]
    assert "no pixel can be compared" in failure(np.zeros((HEIGHT, WIDTH, 4)), tied)


def test_a_comparison_of_few_pixels_warns():
    mesh = ab.Mesh(scenes.random_triangles(400, 0.05, seed=3)[0] * 0.5)
    image = rendered(mesh).straight
    with pytest.warns(UserWarning, match=r"only \d+% of the pixels that show geometry are compared") as caught:
        assert_matches_reference(image, mesh, CAMERA, edge=0.4)
    assert caught[0].filename == __file__  # it points at the caller


# ---- what the failure says


def test_one_wrong_pixel_fails_and_is_named():
    image = rendered(background=WHITE).to_uint8()
    y, x = np.argwhere(rendered(fragments="count").counts == 3)[5]
    image[y, x, 1] ^= 2  # 2/255 up or down
    text = failure(image, background=WHITE, edge=0)
    assert text.startswith("the image differs from the reference: 1 of 1,920 compared pixels (0.05%)")
    assert f"worst pixel [y, x] = [{y}, {x}]: got (" in text
    assert "none of the usual mistakes explains it; tried: flipped rows, flipped columns" in text


def test_the_worst_pixels_fragments_are_listed_front_to_back():
    meshes = [
        ab.Mesh(scenes.covering(z)[0], colors=(0.1, 0.2, 0.3, a), name=n)
        for z, a, n in ((0, 0.25, "far"), (1, 0.5, None))
    ]
    image = rendered(meshes).straight
    image[7, 9, 0] += 0.1
    lines = failure(image, meshes, background=(0, 0, 0.5)).splitlines()
    at = lines.index("its 2 fragments, front to back:")
    assert lines[at + 2].split() == ["2", "(0.1,", "0.2,", "0.3,", "0.5)", "1", "mesh", "1,", "face", "0"]
    assert lines[at + 3].split() == ["3", "(0.1,", "0.2,", "0.3,", "0.25)", "0", "far,", "face", "0"]
    assert lines[at + 4].strip() == "behind them (0, 0, 0.5, 1), straight RGBA, opaque surfaces included"


def test_at_most_12_fragments_are_listed():
    positions, colors = scenes.layers(30, 0.1)
    text = failure(np.zeros((HEIGHT, WIDTH, 4)), ab.Mesh(positions, colors=colors))
    assert "its 30 fragments, front to back:" in text
    assert text.count(", face ") == 12
    assert "and 18 more behind them" in text


def test_a_pixel_without_fragments_shows_its_background():
    image = rendered().straight
    image[0, 0] = 1
    assert "no translucent fragment there; behind it (0, 0, 0, 0)" in failure(image)


def test_rmse_and_largest_difference_are_told():
    opaque = ab.Mesh(scenes.covering()[0], colors=(0.5, 0.5, 0.5, 1))
    image = rendered(opaque).image
    image[..., 0] += 0.25
    assert "largest difference 0.25, RMSE 0.125 (RGBA, premultiplied)" in failure(image, opaque)


# ---- what would explain it

FRONT = (0.9, 0.8, 0.2, 1.0)


def submitted(rows):
    return sorted(rows, key=lambda row: row.primitive)


def depth_tested(rows):
    kept = []
    for row in submitted(rows):
        if not kept or row.depth < kept[-1].depth * (1 + 1e-12):
            kept.append(row)
    return kept[::-1]


def centroid_depth(row):
    return 3 - SCENE.triangles()[row.primitive, :, 2].mean(), -row.primitive  # the eye is at z = 3


MISTAKES = {
    "flipped rows": lambda: (right_image()[::-1], {}),
    "flipped columns": lambda: (right_image()[:, ::-1], {}),
    "turned by 180°": lambda: (right_image()[::-1, ::-1], {}),
    "red and blue swapped": lambda: (right_image()[..., [2, 1, 0, 3]], {}),
    "premultiplied alpha": lambda: (rendered().image, {}),
    "straight alpha": lambda: (right_image(), {"premultiplied": True}),
    "straight alpha of 3": lambda: (right_image()[..., :3], {}),
    "alpha channel": lambda: (with_rgb(np.ones_like(right_image()), rendered().image[..., :3]), {}),
    "sRGB-encoded": lambda: (with_rgb(right_image(), encode(right_image()[..., :3])), {}),
    "not sRGB-encoded": lambda: (right_image(), {"srgb": True}),
    "blended in linear light": lambda: (
        with_rgb(right_image(), encode(rendered(recolored(decode)).straight[..., :3])),
        {},
    ),
    "decoded but not encoded": lambda: (rendered(recolored(decode)).straight, {}),
    "encoded before blending": lambda: (rendered(recolored(encode)).straight, {"srgb": True}),
    "arrival order": lambda: (relisted(lambda rows: submitted(rows)[::-1]), {}),
    "reverse arrival order": lambda: (relisted(submitted), {}),
    "back to front swapped": lambda: (relisted(lambda rows: list(rows)[::-1]), {}),
    "depth writes left on": lambda: (relisted(depth_tested), {}),
    "ties swapped": lambda: (relisted(lambda rows: sorted(rows, key=lambda row: (row.key, row.primitive))), {}),
    "painter's algorithm": lambda: (relisted(lambda rows: sorted(rows, key=centroid_depth)), {}),
    "values up to 255": lambda: (np.rint(right_image() * 255).astype(np.float32), {}),
    "values up to 255 of 3": lambda: (with_rgb(right_image(), right_image()[..., :3] * 255), {}),
    "back faces culled": lambda: (rendered([m.replaced(cull="back") for m in SCENE.meshes]).straight, {}),
    "front faces culled": lambda: (rendered([m.replaced(cull="front") for m in SCENE.meshes]).straight, {}),
    "no background": lambda: (right_image(), {"background": WHITE}),
    "another background": lambda: (rendered(background=FRONT).straight, {"background": (0.1, 0.2, 0.3, 1)}),
    "another background of 3": lambda: (rendered(background=FRONT).straight[..., :3], {}),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_named_first(name):
    image, how = MISTAKES[name]()
    text = best(failure(image, **how))
    assert text.startswith(f"{name.removesuffix(' of 3')}:")
    assert text.endswith("(0.00% off)")


@pytest.mark.parametrize("name", ["flipped rows", "blended in linear light", "arrival order", "another background"])
def test_a_mistake_is_named_in_8_bits_too(name):
    image, how = MISTAKES[name]()
    assert best(failure(np.rint(image * 255).astype(np.uint8), **how)).startswith(f"{name}:")


@pytest.mark.parametrize(
    ("right", "down", "ways"),
    [(0.5, 0.5, "right and down"), (-0.5, 0.5, "left and down"), (0.5, -0.5, "right and up"), (0, -0.5, "up")],
)
def test_half_a_pixel_is_named_with_its_direction(right, down, ways):
    text = best(failure(rendered(camera=pinhole(right, down)).straight))
    assert text.startswith(f"half a pixel off: everything lies half a pixel too far {ways}:")


@pytest.mark.parametrize(("kept", "which"), [(0, "first"), (1, "last")])
def test_a_lost_coincident_layer_is_named(kept, which):
    positions, colors = scenes.random_triangles(9, 0.5, seed=5, flat=True)
    other = scenes.random_triangles(9, 0.5, seed=8, flat=True)[1]
    layers = [ab.Mesh(positions, colors=colors), ab.Mesh(positions, colors=other)]
    text = best(failure(rendered(layers[kept]).straight, layers))
    assert text.startswith("coincident layer lost:")
    assert f"the {which} submitted was kept" in text


def test_alpha_that_was_forgotten_while_blending_is_named():
    lists = rendered(fragments=True).fragments
    image = np.zeros((HEIGHT * WIDTH, 4))
    twice = np.zeros((HEIGHT * WIDTH, 4))
    for pixel in range(HEIGHT * WIDTH):
        for *rgb, alpha in lists.color[lists.offsets[pixel] : lists.offsets[pixel + 1]][::-1]:
            image[pixel] = np.array([*rgb, alpha]) + (1 - alpha) * image[pixel]
            twice[pixel] = np.array([*np.multiply(rgb, alpha**2), alpha]) + (1 - alpha) * twice[pixel]
    shape = (HEIGHT, WIDTH, 4)
    assert best(failure(image.reshape(shape), premultiplied=True)).startswith("alpha never multiplied in:")
    assert best(failure(twice.reshape(shape), premultiplied=True)).startswith("alpha multiplied in twice:")


def test_the_other_background_is_estimated():
    image, how = MISTAKES["another background"]()
    assert "over about (0.9, 0.8, 0.2, 1)" in best(failure(image, **how))


def test_an_opaque_surface_is_no_background():
    wall = ab.Mesh(scenes.covering(-0.5)[0] / 40, colors=(0.2, 0.3, 0.4), opaque=True)
    image = rendered([SCENE, wall], background=WHITE).straight
    assert best(failure(image, [SCENE, wall])).startswith("another background:")


def test_what_nothing_explains_is_said_to_be_so():
    noise = np.random.default_rng(0).uniform(size=(HEIGHT, WIDTH, 4))
    text = failure(noise)
    assert "what would explain it" not in text
    *_, nothing, camera = text.splitlines()
    assert nothing.startswith("none of the usual mistakes explains it; tried: ")
    assert {"half a pixel off", "arrival order", "another background"} <= set(nothing.split("tried: ")[1].split(", "))
    assert camera.endswith(": check the camera")


@pytest.mark.parametrize("background", [(0, 0, 0, 0), WHITE])
def test_another_silhouette_says_to_check_the_camera(background):
    turned = ab.Camera.look_at((2, 1, 2.5), (0.4, 0, 0))
    seen = rendered(camera=turned, background=background).straight
    assert failure(seen, background=background).endswith(": check the camera")
    inside = rendered(background=background).straight
    inside[..., :3] *= 0.9 * (inside[..., :3] < 1) + (inside[..., :3] == 1)  # other colours, same silhouette
    assert "check the camera" not in failure(inside, background=background)


def test_a_mistake_that_explains_only_half_is_not_named():
    image = right_image()[::-1].copy()
    image[: HEIGHT // 2] += 0.1
    assert "none of the usual mistakes explains it" in failure(image)


# ---- what is no image of this scene


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_an_image_that_is_not_finite_fails_with_the_first_pixel(value):
    image = right_image().copy()
    image[5, 6, 2] = image[9, 1, 0] = value
    text = failure(image)
    assert text.startswith("the image is not finite in 2 of 1,920 pixels, first [y, x] = [5, 6]: (")


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (np.zeros((HEIGHT, WIDTH)), r"shape \(H, W, 3\) or \(H, W, 4\), got \(40, 48\)"),
        (np.zeros((4, HEIGHT, WIDTH)), "move the channels to the end"),
        (np.zeros((0, WIDTH, 4)), "image must have shape"),
        (np.zeros((HEIGHT, WIDTH, 4), np.uint16), "uint8 or floats, got dtype uint16"),
        (np.zeros((HEIGHT, 2 * WIDTH, 4)), "aspect ratio"),
    ],
)
def test_an_image_of_another_kind_is_an_error(image, message):
    with pytest.raises(ab.ParameterError, match=message):
        assert_matches_reference(image, SCENE, CAMERA)


@pytest.mark.parametrize("wrong", [{"tolerance": -1}, {"edge": -1}, {"edge": np.nan}, {"background": (1, 2)}])
def test_wrong_arguments_are_errors(wrong):
    with pytest.raises(ab.ParameterError, match=next(iter(wrong))):
        assert_matches_reference(right_image(), SCENE, CAMERA, **wrong)


def test_a_camera_must_be_one():
    with pytest.raises(ab.ParameterError, match=r"abuffer\.Camera, got NoneType"):
        assert_matches_reference(right_image(), SCENE, None)


def test_a_16_bit_png_is_refused(tmp_path):
    Image.fromarray(np.zeros((4, 4), np.uint16)).save(tmp_path / "deep.png")
    with pytest.raises(ab.ParameterError, match=r"deep\.png' has 16 bits a channel.*65535"):
        assert_matches_reference(tmp_path / "deep.png", SCENE, CAMERA)


def test_what_is_not_a_png_is_refused(tmp_path):
    Image.new("RGB", (4, 4)).save(tmp_path / "a.bmp")
    with pytest.raises(ab.ParameterError, match=r"a\.bmp' is not a PNG"):
        assert_matches_reference(tmp_path / "a.bmp", SCENE, CAMERA)


def test_without_pillow_the_error_says_what_to_install(tmp_path, monkeypatch):
    rendered().save(tmp_path / "a.png")
    original = builtins.__import__

    def without_pillow(name, *args, **kw):
        if name.startswith("PIL"):
            raise ImportError(name)
        return original(name, *args, **kw)

    monkeypatch.setattr(builtins, "__import__", without_pillow)
    with pytest.raises(ab.UnsupportedError, match="pip install pillow"):
        assert_matches_reference(tmp_path / "a.png", SCENE, CAMERA)


# ---- the picture of a failure


def test_a_failure_is_saved_as_image_reference_difference(tmp_path):
    image = right_image().copy()
    image[10, 11] = 1 - image[10, 11]
    text = failure(image, save_failure=tmp_path / "bad.png")
    assert text.splitlines()[-1] == f"image | reference | difference: {tmp_path / 'bad.png'}"
    with Image.open(tmp_path / "bad.png") as file:
        picture = np.array(file)
    assert picture.shape == (HEIGHT, 3 * WIDTH + 8, 4)
    left, middle, right = (picture[:, start : start + WIDTH] for start in (0, WIDTH + 4, 2 * WIDTH + 8))
    np.testing.assert_array_equal(left[10, 11], np.rint(image[10, 11] * 255))
    np.testing.assert_array_equal(middle, rendered().to_uint8())
    assert (right[10, 11] == 255).all()
    assert np.count_nonzero(right[..., :3].any(axis=-1)) == 1


def test_two_failures_in_one_directory_are_two_files(tmp_path):
    texts = [failure(right_image()[::-1], save_failure=tmp_path / "new") for _ in range(2)]
    names = [text.splitlines()[-1].split("new/")[1] for text in texts]
    assert names == ["mismatch.png", "mismatch-2.png"]
    assert all((tmp_path / "new" / name).exists() for name in names)


def test_a_success_saves_nothing(tmp_path):
    assert_matches_reference(right_image(), SCENE, CAMERA, save_failure=tmp_path)
    assert not list(tmp_path.iterdir())


# ---- the edge band


@pytest.mark.parametrize("edge", [1 / 64, 0.3, 0.9])
@pytest.mark.parametrize("planes", [{}, {"near": 2.4, "far": 3.3}])
@pytest.mark.parametrize("make", [scenes.near_crossing, scenes.offscreen_and_degenerate, scenes.cyclic_three])
def test_the_edge_band_is_the_oracles(make, planes, edge):
    triangles = make()[0]
    view, projection = scenes.front_camera(WIDTH / HEIGHT, **planes)
    truth = oracle.OracleCamera(view, projection, planes.get("near"), planes.get("far"))
    distance = oracle.edge_distance(triangles, truth, WIDTH, HEIGHT)
    band = edge_band(ab.Scene(ab.Mesh(triangles)), ab.Camera(view, projection), WIDTH, HEIGHT, edge)
    assert band.any()
    sure = np.abs(distance - edge) > 1e-9
    np.testing.assert_array_equal(band[sure], (distance < edge)[sure])


def test_a_wide_edge_band_reaches_all_pixels_in_reach():
    a, b, c = np.array([(8.2, 7.1), (30.7, 12.9), (21.3, 33.6)])
    triangle = [(x - WIDTH / 2, HEIGHT / 2 - y, 0) for x, y in (a, b, c)]
    camera = ab.Camera.orthographic((0, 0, 1), (0, 0, 0), height=HEIGHT)
    band = edge_band(ab.Scene(ab.Mesh(triangle)), camera, WIDTH, HEIGHT, 3.5)
    centers = np.stack(np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5), axis=-1)
    distance = np.full((HEIGHT, WIDTH), np.inf)
    for p, q in ((a, b), (b, c), (c, a)):
        at = np.clip((centers - p) @ (q - p) / ((q - p) @ (q - p)), 0, 1)[..., None]
        distance = np.minimum(distance, np.linalg.norm(centers - p - at * (q - p), axis=-1))
    np.testing.assert_array_equal(band, distance < 3.5)


# ---- several samples

SQUARES = ab.Camera.orthographic((0, 0, 1), (0, 0, 0), height=HEIGHT)  # a pixel is a unit


def half(x, side, z=0.0, color=(0.9, 0.5, 0.1, 0.5), **kw):
    """All of the image that lies left (side -1) or right (1) of x."""
    return ab.Mesh([(x, -99, z), (x, 99, z), (x + side * 99, 0, z)][::side], None, color, **kw)


def test_sample_positions_are_the_standard_ones():
    for samples, positions in oracle_msaa.PATTERNS.items():
        assert _core.sample_positions(samples) == list(positions)


def few_triangles(**look):
    rng = np.random.default_rng(0)
    return ab.Mesh(rng.uniform(-1, 1, (8, 3, 3)), colors=rng.random((8, 4)), color_mode="face", **look)


def not_compared(scene, camera, samples, edge):
    """(H, W) bool, and what is said of it."""
    settings = {"width": WIDTH, "height": HEIGHT, "device": "cpu", "precision": "float64", "samples": samples}
    reference, text = testing._reference(ab.Scene(scene), camera, settings, edge)
    return ~reference.compared, text


@pytest.mark.parametrize("samples", [2, 4, 8, 16])
def test_with_samples_edges_are_compared_too(samples):
    wall = few_triangles().replaced(opaque=True).transformed(np.diag([-1.0, 1, 1, 1]))
    for scene in (few_triangles(), [few_triangles(), wall]):
        smooth = rendered(scene, samples=samples)
        assert_matches_reference(smooth, scene, CAMERA, samples=samples, tolerance=1e-12)
        assert_matches_reference(smooth.to_uint8(), scene, CAMERA, samples=samples)
        assert "differs" in failure(rendered(scene), scene, samples=samples)


@pytest.mark.parametrize("samples", [2, 4, 8, 16])
def test_with_samples_pixels_are_left_out_where_an_edge_is_near_a_sample_or_the_centre(samples):
    mesh, edge = few_triangles(), 1 / 64
    camera = oracle.OracleCamera(*scenes.front_camera(WIDTH / HEIGHT))
    distance = oracle_msaa.edge_distance(mesh.triangles(), camera, WIDTH, HEIGHT, samples)
    left_out, text = not_compared(mesh, CAMERA, samples, edge)
    assert (
        f"{left_out.sum()} pixels ({left_out.mean():.2%}) are within 0.0156 px of an edge, at a sample or the" in text
    )
    assert "0 (0.00%) have near ties" in text
    sure = np.abs(distance - edge) > 1e-9
    np.testing.assert_array_equal(left_out[sure], (distance < edge)[sure])


@pytest.mark.parametrize("resolve", ["per_pixel", "per_sample", "none"])
@pytest.mark.parametrize("opaque", [False, True])
def test_a_gpus_samples_pass(resolve, opaque, needs_gpu):
    wall = few_triangles().replaced(opaque=True).transformed(np.diag([-1.0, 1, 1, 1]))
    scene = [triangles_scene(), wall] if opaque else few_triangles()
    frame = ab.render(scene, CAMERA, width=WIDTH, height=HEIGHT, device="gpu", samples=4, msaa_resolve=resolve)
    assert_matches_reference(frame, scene, CAMERA, samples=4, tolerance=1e-4)
    assert "differs" in failure(frame, scene)


def test_samples_of_a_frame_are_averaged_and_those_of_an_array_are_not():
    frame = rendered(few_triangles(), samples=4, msaa_resolve="none")
    assert frame.image.shape == (HEIGHT, WIDTH, 4, 4)
    assert_matches_reference(frame, few_triangles(), CAMERA, samples=4, tolerance=1e-12)
    for image in (frame.image, frame.straight):
        with pytest.raises(ab.ParameterError, match=r"got \(40, 48, 4, 4\): average samples first, as premultiplied"):
            assert_matches_reference(image, few_triangles(), CAMERA, samples=4)
    mean = frame.image.mean(axis=2)
    assert_matches_reference(mean, few_triangles(), CAMERA, premultiplied=True, samples=4, tolerance=1e-12)


def test_antialiasing_that_the_reference_lacks_is_named():
    smooth = rendered(few_triangles(), samples=16)
    *_, line = failure(smooth, few_triangles()).splitlines()
    assert line.startswith("all of them are next to edges, and the ")
    assert line.endswith("another way than by samples=1, so give the image's own samples=, or edge=0.75")
    assert "than by samples=4, so give" in failure(smooth, few_triangles(), samples=4)
    assert_matches_reference(smooth, few_triangles(), CAMERA, samples=16)
    image = smooth.straight
    y, x = np.argwhere((smooth.image[..., 3] > 0) & ~edge_band(ab.Scene(few_triangles()), CAMERA, WIDTH, HEIGHT, 0.75))[
        0
    ]
    image[y, x] = 1 - image[y, x]
    assert "next to edges" not in failure(image, few_triangles())
    few = rendered(few_triangles()).straight
    y, x = np.argwhere(edge_band(ab.Scene(few_triangles()), CAMERA, WIDTH, HEIGHT, 0.25))[0]
    few[y, x] = 1 - few[y, x]
    assert "next to edges" not in failure(few, few_triangles())


def test_alphas_weighed_by_coverage_are_no_samples():
    """The shortcut of a mask's popcount: it makes a seam of a shared edge, and that must not pass."""
    halves = [half(0.25, -1), half(0.25, 1)]
    right = rendered(halves, SQUARES, samples=4, fragments=True)
    assert_matches_reference(right, halves, SQUARES, samples=4, tolerance=1e-12)
    lists = right.fragments
    alpha = lists.color[:, 3:] * oracle_msaa.popcount(lists.coverage)[:, None] / 4
    color = np.concatenate([lists.color[:, :3], alpha], axis=1)
    lists = ab.Fragments(lists.shape, lists.offsets, lists.depth, color, lists.key, lists.primitive)
    lines = failure(lists.composite(), halves, SQUARES, premultiplied=True, samples=4).splitlines()
    at = lines.index("its 2 fragments, front to back:")
    assert lines[at + 1].split() == ["depth", "straight", "RGBA", "samples", "primitive", "mesh"]
    assert lines[at + 2].split() == ["1", "(0.9,", "0.5,", "0.1,", "0.5)", "1011", "1", "mesh", "1,", "face", "0"]
    assert lines[at + 3].split() == ["1", "(0.9,", "0.5,", "0.1,", "0.5)", "0100", "0", "mesh", "0,", "face", "0"]


def test_the_background_of_each_sample_is_told():
    wall = half(0.25, 1, -0.5, (0.1, 0.2, 0.3), opaque=True)
    scene = [half(-30, 1), wall]
    image = rendered(scene, SQUARES, samples=4).straight
    image[3, WIDTH // 2] = 0
    text = failure(image, scene, SQUARES, samples=4)
    assert "behind them (0, 0, 0, 0) in 1 sample, (0.1, 0.2, 0.3, 1) in 3 samples, straight RGBA" in text


def test_near_ties_are_those_of_one_sample():
    color = np.full((3, 4), 0.5)
    for masks, tied in (((1, 2, 1), True), ((1, 2, 4), False), ((3, 4, 2), True), ((15, 15, 15), True)):
        lists = ab.Fragments((1, 1), [0, 3], [1, 1 + 1e-7, 1 + 2e-7], color, coverage=masks, samples=4)
        assert testing._near_ties(lists).item() == tied
    halves = [half(0.25, -1), half(0.25, 1, -1e-6)]  # next to each other, not in front
    assert "0 (0.00%) have near ties" in not_compared(halves, SQUARES, 4, 1 / 64)[1]


def test_what_ties_with_an_opaque_surface_at_a_sample_is_not_compared():
    at = 0.5 - 2 / 16  # of the first of 4 samples, right of the image's middle
    film = half(-30, 1)

    def wall(offset):  # it cuts the film there, a little further left or right
        corners = [(x, y, (x - at) / 20 + offset) for x, y in ((-30, -30), (30, -30), (30, 30), (-30, 30))]
        return ab.Mesh(corners, [[0, 1, 2], [0, 2, 3]], (0.1, 0.2, 0.3), opaque=True)

    one, other = ([film, wall(offset)] for offset in (-1e-7, 1e-7))
    images = [rendered(scene, SQUARES, samples=4).image for scene in (one, other)]
    assert np.abs(images[0] - images[1]).max() > 0.05
    assert_matches_reference(images[1], one, SQUARES, premultiplied=True, samples=4)


@pytest.mark.parametrize("behind", [[], [half(-30, 1, -0.9, (0.1, 0.2, 0.3), opaque=True)]], ids=["nothing", "wall"])
def test_what_ties_where_its_depth_is_taken_is_not_compared(behind):
    """The tilted one at the pixel's centre, the flat one, which does not cover that, at a sample."""
    corners = [(x, y, (x - 0.5) / 50) for x, y in ((-30, -30), (30, -30), (30, 30), (-30, 30))]
    tilted = ab.Mesh(corners, [[0, 1, 2], [0, 2, 3]], (0.1, 0.2, 0.9, 0.5))
    one, other = ([tilted, half(0.7, 1, z), *behind] for z in (-1e-7, 1e-7))
    images = [rendered(scene, SQUARES, samples=4).image for scene in (one, other)]
    assert np.abs(images[0] - images[1]).max() > 0.02
    assert_matches_reference(images[1], one, SQUARES, premultiplied=True, samples=4)


@pytest.mark.parametrize("samples", [0, 3, 4.0, "4", None, True])
def test_wrong_samples_are_errors(samples):
    with pytest.raises(ab.ParameterError, match="samples must be one of 1, 2, 4, 8, 16"):
        assert_matches_reference(right_image(), SCENE, CAMERA, samples=samples)


# ---- blends

LIGHTEN = ab.Blend(
    "max(dst, src.a * src.rgb)", lambda dst, src, depth: np.maximum(dst, src[:, 3:] * src[:, :3]), name="lighten"
)


def blended_scene(*blends):
    meshes = [ab.Mesh(SCENE.triangles()[k::8], colors=few_triangles().colors[k]) for k in range(8)]
    return [mesh.replaced(blend=blends[k % len(blends)]) for k, mesh in enumerate(meshes)]


@pytest.mark.parametrize("device", ["cpu", "gpu"])
@pytest.mark.parametrize("samples", [1, 4])
@pytest.mark.parametrize("blends", [ab.BLENDS, ("over", "multiply", LIGHTEN)], ids=["modes", "own"])
def test_blends_are_the_references_too(device, samples, blends, request):
    if device == "gpu":
        request.getfixturevalue("needs_gpu")
    scene, behind = blended_scene(*blends), (0.2, 0.5, 0.8, 0.5)
    frame = ab.render(scene, CAMERA, width=WIDTH, height=HEIGHT, device=device, samples=samples, background=behind)
    assert_matches_reference(frame, scene, CAMERA, background=behind, samples=samples, tolerance=1e-4)
    plain = [mesh.replaced(blend="over") for mesh in scene]
    assert "differs" in failure(frame, plain, background=behind, samples=samples)


@pytest.mark.parametrize("blends", [ab.BLENDS, ("multiply", LIGHTEN), ("screen", "over", LIGHTEN)])
@pytest.mark.parametrize("name", ["flipped rows", "straight alpha"])
def test_a_mistake_is_named_whatever_the_blends(blends, name):
    """Also where a hypothesis makes colours that a mode, or a Blend of one's own, does not take."""
    scene, behind = blended_scene(*blends), (0.2, 0.5, 0.8, 0.5)
    frame = rendered(scene, background=behind)
    image = frame.straight if name == "straight alpha" else frame.image[::-1]
    assert best(failure(image, scene, background=behind, premultiplied=True)).startswith(f"{name}:")


def test_a_blend_that_raises_for_colours_of_its_own_scene_only_is_no_obstacle():
    def strict(dst, src, depth):
        if (src > 1).any():
            raise ValueError("colours are up to 1 here")
        return 0.5 * dst + 0.5 * src[:, :3]

    scene = blended_scene(ab.Blend(numpy=strict), "over")
    assert best(failure(rendered(scene).image[::-1], scene, premultiplied=True)).startswith("flipped rows:")


# ---- a reference that shows nothing


def test_nothing_in_view_fails_even_if_the_image_is_the_background():
    """A camera_to_world given for a world_to_camera must not pass two empty images."""
    away = ab.Camera(np.linalg.inv(CAMERA.view), CAMERA.matrices(WIDTH, HEIGHT)[1])
    blank = np.full((HEIGHT, WIDTH, 3), 0.25)
    text = failure(blank, SCENE, away, background=0.25)
    assert text.startswith("no triangle is in view of this camera")
    assert "check world_to_camera against camera_to_world" in text
    assert "the scene has no triangles" in failure(blank, ab.Scene(), CAMERA, background=0.25)


@pytest.mark.parametrize("look", [{"opaque": True}, {"colors": (1, 1, 1, 0)}])
def test_an_opaque_or_invisible_surface_is_in_view(look):
    wall = ab.Mesh(scenes.covering()[0], **look)
    assert_matches_reference(rendered(wall).straight, wall, CAMERA)


def test_a_frame_is_compared_as_it_is():
    assert_matches_reference(ab.render(SCENE, CAMERA, device="cpu"), SCENE, CAMERA)
    assert "differs" in failure(rendered(SCENE.meshes[0]))


@pytest.mark.parametrize(
    ("by", "number"),
    [
        ("the depth of their nearest corner", lambda corners: 3 - corners[:, 2].max()),
        ("the distance of their centroid", lambda corners: np.linalg.norm(corners.mean(axis=0) - (0, 0, 3))),
    ],
)
def test_other_ways_to_sort_triangles_are_told_apart(by, number):
    corners = SCENE.triangles()
    image = relisted(lambda rows: sorted(rows, key=lambda row: (number(corners[row.primitive]), -row.primitive)))
    assert f"whole triangles were sorted by {by}" in best(failure(image))
