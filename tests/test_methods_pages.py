"""The pages of the methods: what they have of the table is current, and what they say of their pictures is true."""

import functools
import re
import runpy
import struct
from pathlib import Path

import numpy as np
import pytest

from abuffer._methods import METHODS
from abuffer.own_methods import BUILT_IN

FOLDER = Path(__file__).parents[1] / "docs" / "methods"
MAKE, FAILURES = (runpy.run_path(str(FOLDER / name)) for name in ("make.py", "failures.py"))
ORANGE, BLUE, GREEN, VEIL, PAPER = (np.array(FAILURES[name]) for name in ("ORANGE", "BLUE", "GREEN", "VEIL", "PAPER"))
SECTIONS = ["Idea", "Equations", "As published, and here", "Cost, and when to take it", "Known failure"]
each = pytest.mark.parametrize("id", sorted(BUILT_IN))


def text_of(id):
    return (FOLDER / f"{id}.md").read_text(encoding="utf-8")


def sections(id):
    parts = re.split(r"^## (.+)$", text_of(id), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


@functools.cache
def failure(id):
    return FAILURES["FAILURES"][id]()


# ---- what they have ----


def test_the_index_is_what_the_table_says():
    """`python docs/methods/make.py` writes it anew."""
    assert (FOLDER / "README.md").read_text(encoding="utf-8") == MAKE["index"]()


@each
def test_a_page_begins_with_what_the_table_says(id):
    """`python docs/methods/make.py` writes it anew."""
    text = text_of(id)
    assert text.startswith(MAKE["block"](METHODS[id]))
    assert MAKE["refreshed"](text, METHODS[id]) == text


def test_another_row_would_make_another_page():
    text = text_of("mlab")
    other = MAKE["refreshed"](text, METHODS["hybrid"])
    assert other != text
    assert MAKE["refreshed"](other, METHODS["mlab"]) == text, "what is written by hand should stay"


@each
def test_a_page_has_its_sections_equations_and_a_picture(id):
    found = sections(id)
    assert list(found) == SECTIONS
    assert re.search(r"^```text\n.+?^```$", found["Equations"], re.DOTALL | re.MULTILINE)
    assert re.findall(r"!\[.{10,}\]\((.+)\)", found["Known failure"]) == [f"pictures/{id}.png"]


@each
def test_links_of_a_page_lead_somewhere(id):
    links = [link.split("#")[0] for link in re.findall(r"\]\(([^)]+)\)", text_of(id))]
    assert links
    assert all((FOLDER / link).is_file() for link in links)


def test_there_are_no_other_pages_or_pictures():
    assert {path.stem for path in FOLDER.glob("*.md")} == BUILT_IN | {"README"}
    assert {path.stem for path in (FOLDER / "pictures").iterdir()} == BUILT_IN == set(FAILURES["FAILURES"])


# ---- pictures ----


@each
def test_a_picture_is_small_and_of_the_size_of_all(id):
    data = (FOLDER / "pictures" / f"{id}.png").read_bytes()
    assert struct.unpack(">II", data[16:24]) == (FAILURES["WIDTH"], FAILURES["HEIGHT"])
    assert len(data) < 60_000


@each
def test_a_picture_shows_what_is_rendered(id):
    """`python docs/methods/pictures.py` draws it anew. Eight bits round by half a step."""
    images = pytest.importorskip("PIL.Image")
    drawn = np.asarray(images.open(FOLDER / "pictures" / f"{id}.png").convert("RGB"), float) / 255
    side, top = FAILURES["SIDE"], FAILURES["TOP"]
    here = [drawn[top : top + side, left : left + side] for left in FAILURES["LEFTS"][:2]]
    for panel, image in zip(here, failure(id).panels(), strict=True):
        np.testing.assert_allclose(panel, image, atol=1 / 255)
    assert np.abs(here[0] - here[1]).max() > 0.1, "the failure should be seen"


# ---- numbers ----


def worst(found):
    return found.off.max()


def rmse(found):
    return np.sqrt(((found.method - found.exact) ** 2).mean())


def where_the_first_disc_meets_the_third(found):
    return found.off[179, 117]


def apart(a, b):
    return np.abs(np.asarray(a) - b).max()


def over(alphas, colors, behind):
    for alpha, color in zip(alphas[::-1], colors[::-1], strict=True):
        behind = alpha * np.asarray(color) + (1 - alpha) * np.asarray(behind)
    return behind


THREE = np.array([ORANGE, GREEN, BLUE])


def of_adaptive():
    """Four veils of weights 0.1 · 0.9ʲ, and the disc behind itself."""
    alpha = 1 - 0.9**4 * 0.1
    veils, disc = 0.1 * sum(0.9**j for j in range(4)), 0.9 * 0.9**4 * 0.1
    return (0.9**4 * 0.9 - alpha * disc / (veils + disc)) * apart(ORANGE, VEIL)


def of_two(first, second, transmittance, alpha):
    """What the share of the first is off by, of two whose alphas weigh as 1 to a transmittance."""
    return abs(alpha * first / (first + second * transmittance) - first) * apart(ORANGE, BLUE)


def of_wboit():
    w = [1 / (1e-5 + (z / 5) ** 2 + (z / 200) ** 6) for z in (5, 6)]
    return w[1] / sum(w)


def of_mboit():
    front, back = 0.5 * 0.5**0.25, 0.5 * 2.0**-6
    return front / (front + back) - 0.5


def of_wavelet():
    v, a = FAILURES["WAVELET_PLACE"], -np.log(0.1)
    return of_two(0.9, 0.9, np.exp(-v * (a + (1 - v) * a)), 0.99)


# For each page the numbers in bold, in their order: what they are of the picture, and their closed form if there is one.
NUMBERS = {
    "exact": [(worst, 0.7**2 * apart(ORANGE, BLUE))],
    "depth_peeling": [(worst, (0.85**4 - 0.85**12) * 0.95)],
    "dual_depth_peeling": [(worst, 0.7 * apart(BLUE, over([0.7], [ORANGE], PAPER)))],
    "k_buffer": [(worst, 0.9**8 * 0.9 * apart(ORANGE, PAPER))],
    "hybrid": [(worst, 0.9**4 * (0.9 - 0.99 / 2) * apart(ORANGE, BLUE))],
    "adaptive": [(worst, of_adaptive())],
    "mlab": [(worst, 0.9**4 * 0.9**2 * apart(ORANGE, BLUE))],
    "bucket_peeling": [(worst, 0.7 * 0.9 * apart(BLUE, over([0.3], [VEIL], PAPER)))],
    "stencil_routed": [(worst, 0.9 * apart(ORANGE, over([0.1] * 8, [VEIL] * 8, PAPER)))],
    "additive": [(worst, apart(0.2 + 0.6 * THREE.sum(axis=0), over([0.6] * 3, THREE, [0.2] * 3)))],
    "weighted_sum": [(worst, apart(0.6 * THREE.sum(axis=0) - 0.8, over([0.6] * 3, THREE, [1.0] * 3)))],
    "weighted_average": [(worst, 0.25 * apart(ORANGE, 1))],
    "wboit": [(worst, of_wboit() * apart(ORANGE, BLUE))],
    "phenomenological": [(worst, 0.5 * apart(ORANGE, BLUE))],
    "mboit": [(worst, of_mboit() * apart(ORANGE, BLUE))],
    "wavelet": [(worst, of_wavelet())],
    "fourier": [(worst, of_two(0.1, 1, 0.9 * 1e-5, 1))],
    "stochastic": [(rmse, None), (worst, None)],
    "unsorted": [
        (worst, 0.7 * (1 - 0.3**2) * apart(ORANGE, BLUE)),
        (where_the_first_disc_meets_the_third, 0.7**2 * apart(ORANGE, BLUE)),
    ],
    "object_sorted": [(worst, 0.7**2 * apart(ORANGE, BLUE))],
    "triangle_sorted": [(worst, 0.8**2 * apart(ORANGE, BLUE))],
}  # fmt: skip


def stated(text):
    return re.findall(r"\*\*(.+?)\*\*", text)


def is_rounded(number, value):
    """To the digits that are printed."""
    digits = len(number.partition(".")[2])
    return abs(float(number) - value) <= 0.5 * 10.0**-digits + 1e-9


@each
def test_what_a_page_says_it_is_off_by_is_what_its_picture_is_off_by(id):
    numbers = stated(sections(id)["Known failure"])
    assert len(numbers) == len(NUMBERS[id]) > 0
    for number, (of, _) in zip(numbers, NUMBERS[id], strict=True):
        assert is_rounded(number, of(failure(id))), number


@each
def test_what_a_picture_is_off_by_has_its_closed_form(id):
    """But for what moments are biased by, and colours are rounded by, to float32."""
    for of, closed in NUMBERS[id]:
        if closed is not None:
            assert of(failure(id)) == pytest.approx(closed, abs=1e-5)


def test_noise_has_no_closed_form_but_a_bound():
    assert 0.1 < rmse(failure("stochastic")) * 2 * np.sqrt(8) < 1


def test_another_number_would_be_told():
    assert is_rounded("0.364", 0.36418) and is_rounded("0.5", 0.5)
    assert not any(is_rounded(number, 0.36418) for number in ("0.363", "0.365", "0.37", "0.3643"))
    assert stated("of **0.1** or *0.2* and **3**") == ["0.1", "3"]


def test_the_images_of_a_picture_are_those_of_its_method():
    """So that what they are off by is another's no more."""
    found = failure("mlab")
    again, other = (FAILURES["shown"](found.meshes, method=method) for method in ("mlab", "hybrid"))
    np.testing.assert_array_equal(again, found.method)
    assert np.abs(other - found.method).max() > 0.1


def off_with(id, meshes, **options):
    shown = FAILURES["shown"]
    return np.abs(shown(meshes, method=id, **options) - shown(meshes)).max()


def test_what_pages_say_would_help_does():
    assert off_with("mboit", failure("mboit").meshes, beta=0) < 1e-5
    *discs, _ = failure("wavelet").meshes
    assert off_with("wavelet", discs) < 1e-12
    *veils, blue, orange = failure("mlab").meshes
    assert off_with("mlab", [*veils, orange, blue]) < 1e-12
    assert off_with("dual_depth_peeling", failure("dual_depth_peeling").meshes) < 1e-12
