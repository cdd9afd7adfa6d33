"""The page of `Comparison.report`, in Chromium: what it shows is what numpy has."""

import dataclasses
import json
import re
import sys

import numpy as np
import pytest

import abuffer as ab
import browser
from abuffer._srgb import encode_srgb
from abuffer.comparing import Comparison, compare
from abuffer.comparing import report as page
from browser import Keys, Page
from conftest import require_browser

pytestmark = pytest.mark.slow

HEIGHT, WIDTH = 30, 40
HOSTILE = "<script>window.hacked = 1</script>"
SCENES = ("sheets", "a & b <i>")
OTHER = "another <b>device</b>"
# A reference to something elsewhere, in HTML or CSS.
LOADS = re.compile(r"""(?:\bsrc|\bhref|\burl)\s*[=(]\s*["']?\s*(?:https?:)?//""")
# Colours of a scale that has no sign.
DARK = 40


def sheets(seed, blend="over"):
    rng = np.random.default_rng(seed)
    centres = rng.uniform(-0.8, 0.8, (12, 1, 3))
    colors = np.concatenate([rng.uniform(0, 1, (12, 3)), rng.uniform(0.3, 0.8, (12, 1))], axis=1)
    return ab.Mesh(centres + rng.uniform(-0.7, 0.7, (12, 3, 3)), colors=colors, blend=blend)


def of_methods(scenes, methods):
    return compare(scenes, width=WIDTH, height=HEIGHT, methods=methods, devices=["cpu"], repeats=2, warmup=3)


@pytest.fixture(scope="module")
def compared():
    """Two scenes, and of the first a second device, whose images are others and one value is no number."""
    fails = {
        "method": "wboit",
        "pipeline": "hardware",
        "label": "<b>fails</b>",
    }  # on a CPU; sorted last from the first place
    methods = [fails, "exact", "additive", "weighted_average", {"method": "wboit", "label": HOSTILE}]
    found = of_methods({name: ab.Scene([sheets(seed)]) for seed, name in enumerate(SCENES)}, methods)
    name = SCENES[0]
    rows = [row | {"rmse": 2 * row["rmse"]} for row in found.select(scene=name) if row["label"] != "exact"]
    images = {label: image / 2 for label, image in found.images_of(name, "cpu").items() if label != "exact"}
    images["additive"][3, 4, 1] = np.nan
    found.add(name, OTHER, rows, images, found.exact[name], found.references[name])
    return found


@pytest.fixture(scope="module")
def file(compared, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    compared.report(path)
    return path


@pytest.fixture(scope="module")
def chromium(tmp_path_factory):
    require_browser()
    driver = browser.chromium(tmp_path_factory.mktemp("profile"))
    yield driver
    driver.quit()


@pytest.fixture
def opened(chromium, file):
    opened = Page(chromium, file)
    yield opened
    assert opened.errors() == []


def shown(image):
    """What a pixel (4,) of an image is drawn as."""
    return np.rint(np.clip(image[:3].astype(np.float64), 0, 1) * 255).astype(int).tolist()


def deepest(compared, scene=SCENES[0]):
    counts = compared.exact[scene].counts
    return tuple(int(i) for i in np.unravel_index(counts.argmax(), counts.shape))


# ---- the page as a whole ----


def test_the_page_loads_nothing_and_has_no_errors(opened, file):
    assert opened.loaded() == []
    assert not LOADS.search(file.read_text(encoding="utf-8"))
    assert opened.errors() == []


def test_an_error_and_something_that_is_loaded_would_be_seen(chromium, tmp_path):
    path = tmp_path / "bad.html"
    path.write_text(
        '<main aria-busy="false"><img src="http://127.0.0.1:9/missing.png"></main><script>throw Error("x")</script>'
    )
    bad = Page(chromium, path)
    assert any("Error: x" in message for message in bad.errors())
    assert bad.loaded() == ["http://127.0.0.1:9/missing.png"]
    assert LOADS.search(path.read_text(encoding="utf-8"))


def test_the_same_comparison_gives_the_same_page(compared, file, tmp_path):
    compared.report(tmp_path / "again.html")
    assert (tmp_path / "again.html").read_bytes() == file.read_bytes()


def test_names_are_text(opened):
    assert opened.run("return window.hacked") is None
    assert HOSTILE in [row[0].removesuffix("◆") for row in opened.table("rows")]
    assert HOSTILE in opened.run("return Array.from(document.getElementById('right').options, option => option.text)")
    assert opened.run("return document.querySelectorAll('#rows script, #plot script').length") == 0
    opened.choose("device", OTHER)
    assert OTHER in opened.run("return document.getElementById('plot').textContent")


@pytest.mark.parametrize("scene", SCENES)
def test_every_image_is_there_in_its_size(opened, compared, scene):
    opened.choose("scene", scene)
    sizes = opened.driver.execute_async_script(
        "const done = arguments[0], images = Array.from(document.querySelectorAll('#canvas img'));"
        "Promise.all(images.map(image => image.decode()))"
        ".then(() => done(images.map(image => [image.alt, image.naturalWidth, image.naturalHeight])))"
    )
    assert sizes == [[name, WIDTH, HEIGHT] for name in ("reference", *compared.images_of(scene, "cpu"))]


def test_the_environment_is_named(opened, compared):
    text = opened.text("header")
    assert all(name in text for name in (compared.environment["numpy"], compared.environment["abuffer"], "cpu"))


# ---- the table ----


def expected_order(rows, values, sign):
    """Labels as numpy sorts: what is no number last, equal ones as they were."""
    return [rows[i]["label"] for i in np.argsort(sign * np.asarray(values, np.float64), kind="stable")]


def labels(opened):
    return [row[0].removesuffix("◆") for row in opened.table("rows")]


@pytest.mark.parametrize("device", ["cpu", OTHER])
def test_every_column_sorts_as_numpy_does(opened, compared, device):
    opened.choose("device", device)
    opened.click("#all-columns")
    opened.click("[data-column='-1']")
    rows = compared.select(scene=SCENES[0], device=device)
    assert labels(opened) == sorted(row["label"] for row in rows)
    for i, column in enumerate(page.COLUMNS):
        values = [np.nan if row[column.name] is None else row[column.name] for row in rows]
        for sign, direction in ((1, "ascending"), (-1, "descending")):
            opened.run("document.querySelector(`[data-column='${arguments[0]}']`).click()", i)
            assert labels(opened) == expected_order(rows, values, sign), (column.name, direction)
            assert opened.get(f"th:has([data-column='{i}'])").get_attribute("aria-sort") == direction


def test_the_table_has_three_digits_of_every_number(opened, compared):
    found = {cells[0].removesuffix("◆"): cells[1:] for cells in opened.table("rows")}
    for row in compared.select(scene=SCENES[0], device="cpu"):
        if row["failure"]:
            assert found[row["label"]] == [row["failure"]]
            continue
        for column, text in zip(page.COLUMNS, found[row["label"]], strict=True):
            value = row[column.name] * column.factor
            if column.name == "deterministic":
                assert text == "yes"
            elif np.isnan(value):
                assert text == "–"
            elif np.isinf(value):
                assert text == "∞"
            else:
                assert float(text) == pytest.approx(value, rel=5.1e-3)  # half a unit of the third digit, of 100


def test_rows_that_are_not_dominated_are_marked(opened, compared):
    best = [row["label"] for row in compared.pareto() if (row["scene"], row["device"]) == (SCENES[0], "cpu")]
    marked = [row[0].removesuffix("◆") for row in opened.table("rows") if row[0].endswith("◆")]
    assert sorted(marked) == sorted(best)
    assert 0 < len(best) < len(compared.select(scene=SCENES[0], device="cpu"))


def test_a_name_in_the_table_shows_its_image(opened):
    opened.click("[data-label='weighted_average']")
    assert opened.get("#right").get_property("value") == "weighted_average"
    assert opened.get("tr[aria-current] button").text == "weighted_average"


# ---- the two images ----


def test_the_slider_parts_the_two_images(opened, compared):
    opened.choose("right", "additive")
    y, x = deepest(compared)
    reference, other = shown(compared.references[SCENES[0]][y, x]), shown(compared.images_of()["additive"][y, x])
    assert reference != other
    opened.select(0, 0)  # the outline lies elsewhere
    opened.keys("#divider", Keys.HOME)
    assert opened.drawn(y, x) == other
    opened.keys("#divider", Keys.END)
    assert opened.drawn(y, x) == reference
    assert opened.get("#divider").get_attribute("aria-valuenow") == "100"
    opened.keys("#divider", Keys.ARROW_LEFT, Keys.PAGE_DOWN)
    assert opened.get("#divider").get_attribute("aria-valuenow") == "89"


def test_the_slider_is_dragged(opened, compared):
    opened.choose("right", "additive")
    y, x = deepest(compared)
    image = compared.images_of()["additive"]
    opened.select(0, 0)
    grab = opened.pointer(WIDTH / 2, 5).click_and_hold()
    canvas = opened.get("#canvas").size["width"]
    grab.move_by_offset(round((x + 2) / WIDTH * canvas - canvas / 2), 0).release().perform()
    assert opened.drawn(y, x) == shown(compared.references[SCENES[0]][y, x])
    assert opened.drawn(y, x + 3) == shown(image[y, x + 3])


def test_pixels_are_where_numpy_has_them(opened, compared):
    opened.choose("right", "weighted_average")
    opened.select(HEIGHT - 1, WIDTH - 1)
    for key, image in (
        (Keys.END, compared.references[SCENES[0]]),
        (Keys.HOME, compared.images_of()["weighted_average"]),
    ):
        opened.keys("#divider", key)
        for y, x in ((0, 0), (7, 31), (15, 20), (22, 9), *[deepest(compared)]):
            assert opened.drawn(y, x) == shown(image[y, x]), (y, x)


def test_the_wheel_zooms_to_64_about_the_pointer_and_drags_pan(opened, compared):
    y, x = deepest(compared)
    opened.choose("left", "additive")
    opened.keys("#divider", Keys.END)
    opened.select(0, 0)
    opened.wheel(x + 0.5, y + 0.5, -4000)
    assert opened.text("#zoom") == "64×"
    expected = shown(compared.images_of()["additive"][y, x])
    zoom = opened.fitted()
    # All of a pixel is of one colour: 20 pixels of the screen are less than half of 64.
    for dx, dy in ((0, 0), (-20, -20), (20, 20)):
        assert opened.at(x + 0.5 + dx / zoom, y + 0.5 + dy / zoom) == expected
    opened.pointer(x + 0.5, y + 0.5).click_and_hold().move_by_offset(-64, 0).release().perform()
    assert opened.at(x + 0.5, y + 0.5) == shown(compared.images_of()["additive"][y, x + 1])
    opened.click("#fit")
    assert opened.drawn(y, x) == expected


# ---- differences ----


def test_a_difference_shows_its_sign(opened, compared):
    opened.choose("right", "weighted_average")
    opened.click("[value=difference] + span")
    off = compared.images_of()["weighted_average"][..., :3] - compared.references[SCENES[0]][..., :3]
    signed = np.take_along_axis(off, np.abs(off).argmax(axis=2)[..., None], axis=2)[..., 0]
    opened.select(0, 0)
    (above, below), none = (divmod(int(pick), WIDTH) for pick in (signed.argmax(), signed.argmin())), (0, 39)
    assert signed[above] > 0.05 and signed[below] < -0.05 and signed[none] == 0
    red, _, blue = opened.drawn(*above)
    assert red > blue + 10
    red, _, blue = opened.drawn(*below)
    assert blue > red + 10
    assert max(opened.drawn(*none)) < DARK


def test_the_gain_is_on_the_scale_and_in_the_image(opened, compared):
    opened.choose("right", "exact")
    opened.click("[value=difference] + span")
    off = np.abs(compared.images_of()["exact"][..., :3] - compared.references[SCENES[0]][..., :3]).max(axis=2)
    assert 0 < off.max() < 1e-5  # which ×1000 shows as a hundredth at most
    y, x = deepest(compared)
    opened.select(0, 0)
    assert (opened.text("#least"), opened.text("#most"), opened.text("#gain-value")) == ("−1", "+1", "×1")
    opened.keys("#gain", Keys.END)
    assert (opened.text("#least"), opened.text("#most"), opened.text("#gain-value")) == (
        "−0.00100",
        "+0.00100",
        "×1000",
    )
    assert max(opened.drawn(y, x)) < DARK
    opened.choose("right", "additive")
    assert max(opened.drawn(y, x)) > 200  # more than a thousandth: all that the scale has


def test_beside_another_method_the_slider_parts_two_differences(opened):
    opened.click("[value=difference] + span")
    assert not opened.get("#divider").is_displayed()
    opened.choose("left", "additive")
    opened.choose("right", "weighted_average")
    assert opened.get("#divider").is_displayed()
    assert opened.text("#left-name") == "additive − reference"
    assert opened.text("#right-name") == "weighted_average − reference"


# ---- a pixel ----


def test_a_click_shows_the_fragment_list_that_numpy_has(opened, compared):
    y, x = deepest(compared)
    opened.select(y, x)
    assert [opened.get(f"#pixel-{axis}").get_property("value") for axis in "yx"] == [str(y), str(x)]
    fragments = compared.exact[SCENES[0]].fragments[y, x]
    *layers, behind = opened.table("layers")
    assert len(layers) == len(fragments) >= 3
    alpha, color = fragments.color[:, 3], fragments.color[:, :3]
    through = np.concatenate([[1], np.cumprod(1 - alpha)])
    weights = through[:-1] * alpha
    so_far = np.cumsum(weights[:, None] * color, axis=0)
    for i, cells in enumerate(layers):
        assert cells[0] == str(i + 1)
        assert float(cells[1]) == pytest.approx(fragments.depth[i], rel=5.1e-6)  # six digits
        assert int(cells[4]) == fragments.primitive[i]
        for cell, value in ((2, alpha[i]), (5, through[i]), (6, weights[i])):
            assert float(cells[cell]) == pytest.approx(value, rel=5.1e-3)  # three digits
        assert [float(text) for text in cells[3].split()] == pytest.approx(color[i], abs=5.1e-4)  # three decimals
        assert [float(text) for text in cells[8].split()] == pytest.approx(so_far[i], abs=5.1e-4)
    # All layers and what is behind them are the reference.
    assert [float(text) for text in behind[8].split()] == pytest.approx(
        compared.references[SCENES[0]][y, x, :3], abs=5.1e-4
    )


def test_a_click_shows_the_values_of_both_images(opened, compared):
    opened.choose("right", "additive")
    y, x = deepest(compared)
    opened.select(y, x)
    reference, image = compared.references[SCENES[0]][y, x], compared.images_of()["additive"][y, x]
    rows = {name: [float(text) for text in values] for name, *values in opened.table("values")}
    assert rows["reference"] == pytest.approx(reference, rel=5.1e-6)
    assert rows["additive"] == pytest.approx(image, rel=5.1e-6)
    assert rows["additive − reference"] == pytest.approx(image - reference, rel=5.1e-3)


def test_arrow_keys_move_the_pixel_and_stop_at_the_edge(opened):
    opened.select(0, 5)
    opened.keys("#canvas", Keys.ARROW_RIGHT, Keys.ARROW_UP)
    assert [opened.get(f"#pixel-{axis}").get_property("value") for axis in "yx"] == ["0", "6"]


def test_the_pixel_that_is_most_off_can_be_found(opened, compared):
    opened.choose("right", "weighted_average")
    opened.click("#worst")
    off = np.abs(compared.images_of()["weighted_average"][..., :3] - compared.references[SCENES[0]][..., :3])
    place = [int(opened.get(f"#pixel-{axis}").get_property("value")) for axis in "yx"]
    # To half a step of int16.
    assert off[tuple(place)].max() == pytest.approx(off.max(), abs=off.max() / page.LARGEST)


def test_an_empty_list_says_so(opened, compared):
    y, x = (int(i) for i in np.argwhere(compared.exact[SCENES[0]].counts == 0)[0])
    opened.select(y, x)
    assert "empty" in opened.text("#layers-note")
    assert not opened.get("#layers").is_displayed()


def test_another_scene_and_device_are_shown(opened, compared):
    y, x = deepest(compared)
    opened.choose("device", OTHER)
    opened.choose("right", "weighted_average")
    opened.select(y, x)
    values = {name: values for name, *values in opened.table("values")}["weighted_average"]
    halved = compared.images_of(SCENES[0], OTHER)["weighted_average"][y, x]
    assert [float(text) for text in values] == pytest.approx(halved, rel=5.1e-6)
    assert "exact" not in labels(opened)
    opened.choose("scene", SCENES[1])
    assert opened.run("return Array.from(document.getElementById('device').options, o => o.text)") == ["cpu"]
    assert "exact" in labels(opened)
    y, x = deepest(compared, SCENES[1])
    opened.select(y, x)
    fragments = compared.exact[SCENES[1]].fragments[y, x]
    assert [int(cells[4]) for cells in opened.table("layers")[:-1]] == fragments.primitive.tolist()


def test_what_is_no_number_is_magenta_and_named_so(opened):
    opened.choose("device", OTHER)
    opened.choose("right", "additive")
    opened.select(0, 0)
    opened.keys("#divider", Keys.HOME)
    assert opened.drawn(3, 4) == [255, 0, 255]
    opened.click("[value=difference] + span")
    assert opened.drawn(3, 4) == [255, 0, 255]
    opened.select(3, 4)
    assert {name: values for name, *values in opened.table("values")}["additive"][1] == "–"


# ---- what a page has no room for ----


def test_lists_that_are_too_many_are_left_out_and_why(compared, chromium, tmp_path, monkeypatch):
    monkeypatch.setattr(page, "MOST_FRAGMENTS", 10)
    compared.report(tmp_path / "short.html")
    opened = Page(chromium, tmp_path / "short.html")
    count = len(compared.exact[SCENES[0]].fragments)
    assert f"{count:,} fragments are more than the 10" in opened.text("#layers-note")
    assert not opened.get("#layers").is_displayed()


def test_without_room_for_floats_values_are_of_8_bits_and_say_so(compared, chromium, tmp_path, monkeypatch):
    monkeypatch.setattr(page, "MOST_CHARACTERS", 10)
    compared.report(tmp_path / "short.html")
    opened = Page(chromium, tmp_path / "short.html")
    assert "images of 8 bits" in opened.text("#values-note")
    assert "longer than 10 characters" in opened.text("#layers-note")
    y, x = deepest(compared)
    opened.select(y, x)
    reference = compared.references[SCENES[0]][y, x]
    *rgb, alpha = opened.table("values")[0][1:]
    # Half a step, and three digits.
    assert [float(text) for text in rgb] == pytest.approx(reference[:3], abs=1 / 510 + 5e-4)
    assert alpha == "–"


def test_asked_for_images_are_encoded_and_values_are_not(compared, chromium, tmp_path, monkeypatch):
    """Those of 8 bits too, which are decoded."""
    y, x = deepest(compared)
    reference = compared.references[SCENES[0]][y, x]
    for most in (page.MOST_CHARACTERS, 10):
        monkeypatch.setattr(page, "MOST_CHARACTERS", most)
        compared.report(tmp_path / "encoded.html", srgb=True)
        opened = Page(chromium, tmp_path / "encoded.html")
        opened.select(y, x)
        opened.keys("#divider", Keys.END)
        assert "encoded with the sRGB curve" in opened.text("#images")
        assert opened.drawn(y, x) == np.rint(encode_srgb(reference[:3]) * 255).astype(int).tolist()
        # Half a step, where the curve is 2.3 at its steepest below 1, and three digits.
        values = [float(text) for text in opened.table("values")[0][1:4]]
        assert values == pytest.approx(reference[:3], abs=2.3 / 510 + 5e-4)


def test_lists_that_the_comparison_did_not_keep_are_named(compared):
    frame = dataclasses.replace(compared.exact[SCENES[0]], fragments=None)
    lists, why = page._lists(frame)
    assert lists is None
    assert "kept no lists" in why


def test_of_other_blend_modes_no_transmittance_is_claimed(chromium, tmp_path):
    scene = ab.Scene([sheets(1, "additive")])
    found = of_methods({"light": scene}, ["exact"])
    found.report(tmp_path / "light.html")
    opened = Page(chromium, tmp_path / "light.html")
    opened.select(*deepest(found, "light"))
    assert "modes other than over" in opened.text("#layers-note")
    first = opened.table("layers")[0]
    assert first[4].endswith(" additive")
    assert first[5:7] == ["–", "–"]


@pytest.mark.parametrize("package", ["jinja2", "matplotlib"])
def test_a_package_that_is_missing_is_named(compared, tmp_path, monkeypatch, package):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ab.UnsupportedError, match=rf"needs {package}: pip install {package}, or 'abuffer\[compare\]'"):
        compared.report(tmp_path / "report.html")


def test_a_comparison_without_rows_is_refused(tmp_path):
    with pytest.raises(ab.ParameterError, match="nothing to report"):
        Comparison([], {}).report(tmp_path / "report.html")


def test_where_every_method_failed_the_reference_is_left(chromium, tmp_path):
    found = of_methods({"sheets": ab.Scene([sheets(1)])}, ["wboit@hardware"])
    (row,) = found.rows
    found.report(tmp_path / "failed.html")
    opened = Page(chromium, tmp_path / "failed.html")
    assert opened.table("rows") == [["wboit@hardware", row["failure"]]]
    assert opened.text("#right-name") == "reference"
    assert opened.errors() == []


def test_labels_are_text_whatever_javascript_thinks_of_them(chromium, tmp_path):
    """Names that its objects have, and numbers, which they would put first."""
    labels = ["constructor", "10", "__proto__", "2"]
    methods = [{"method": "additive", "label": label} for label in labels]
    fails = {"method": "wboit@hardware", "label": "toString"}
    found = of_methods({"sheets": ab.Scene([sheets(1)])}, [fails, *methods])
    found.report(tmp_path / "labels.html")
    opened = Page(chromium, tmp_path / "labels.html")
    options = opened.run("return Array.from(document.getElementById('right').options, option => option.text)")
    assert options == ["reference", *labels]
    for label in labels:
        opened.choose("right", label)
        assert opened.text("#right-name") == label
    assert opened.errors() == []


def test_markup_in_names_and_scenes_is_escaped(tmp_path, compared):
    """Where the page's template writes them, not its script: its title."""
    evil = "</title><script>window.hacked = 1</script>"
    found = of_methods({evil: ab.Scene([sheets(1)])}, ["exact"])
    found.report(tmp_path / "evil.html")
    text = (tmp_path / "evil.html").read_text(encoding="utf-8")
    assert "</title><script>window" not in text and "&lt;/title&gt;&lt;script&gt;window" in text


def test_an_image_of_one_pixel_is_shown(chromium, tmp_path):
    arguments = {"width": 1, "height": 1, "methods": ["exact", "additive"], "devices": ["cpu"], "repeats": 1}
    compare(ab.Scene([sheets(1)]), **arguments).report(tmp_path / "one.html")
    opened = Page(chromium, tmp_path / "one.html")
    assert opened.table("values")[0][0] == "reference"
    assert opened.errors() == []


def test_lists_are_added_while_there_is_room(compared, monkeypatch):
    """With room for the first scene's, the second has none."""
    scenes = [page._scene(compared, name, False) for name in SCENES]
    used = len(json.dumps([scenes, {}]))
    lists, _ = page._lists(compared.exact[SCENES[0]])
    monkeypatch.setattr(page, "MOST_CHARACTERS", used + len(json.dumps(lists)))
    page._add_what_fits(compared, scenes, {}, {})
    assert [scene["lists"] is not None for scene in scenes] == [True, False]
    assert "longer than" in scenes[1]["why"]["lists"]
    assert [scene["values"] for scene in scenes] == [None, None]
