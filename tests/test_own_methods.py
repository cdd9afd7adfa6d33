"""Methods that are registered from outside: the one of docs/adding-a-method.md, and what is refused."""

import re
from pathlib import Path

import numpy as np
import pytest

import abuffer as ab
import methods
from abuffer import ParameterError, ShaderError, UnsupportedError
from abuffer._methods import METHODS
from abuffer.method import FLAGS

PAGE = Path(__file__).parents[1] / "docs" / "adding-a-method.md"
CAMERA = ab.Camera.look_at((0, 0, 4), (0, 0, 0))
SIZE = {"width": 61, "height": 45}


@pytest.fixture
def registered():
    """Takes back what a test registers."""
    before = dict(METHODS)
    yield
    METHODS.clear()
    METHODS.update(before)


@pytest.fixture
def strongest(registered):
    """Runs the page as it is written, up to where the method is registered."""
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    space = {}
    for block in blocks[:3]:
        exec(block, space)
    return space


def scene(n=40):
    rng = np.random.default_rng(5)
    triangles = rng.uniform(-1, 1, (n, 1, 3)) + rng.uniform(-0.6, 0.6, (n, 3, 3))
    return ab.Mesh(triangles, colors=rng.uniform(0.05, 1, (n, 4)))


def test_the_page_registers_a_method_that_is_listed(strongest):
    assert ab.methods()["strongest"]["parameters"] == "gain=1.0 from 0 to 4"


@pytest.mark.parametrize("flag", sorted(set(FLAGS) - {"modes"}))
def test_its_flags_say_which_invariants_hold(strongest, flag):
    worst = np.abs(methods.OFF[flag](("strongest", {}))).max()
    assert (worst < 1e-10) == (flag in METHODS["strongest"].flags), worst


@pytest.mark.parametrize("samples", [1, 4])
@pytest.mark.parametrize("options", [{}, {"gain": 0.5}], ids=str)
def test_gpu_cpu_and_lists_agree(strongest, options, samples, needs_gpu):
    given = {**SIZE, "method": "strongest", "samples": samples, "background": (0.1, 0.2, 0.3, 0.5), **options}
    double = ab.render(scene(), CAMERA, **given, precision="float64", fragments=True)
    single = ab.render(scene(), CAMERA, **given, device="cpu")
    gpu = ab.render(scene(), CAMERA, **given, device="gpu")
    np.testing.assert_allclose(double.fragments.composite("strongest", **options), double.image, rtol=1e-12)
    np.testing.assert_allclose(single.image, double.image, atol=methods.DEFAULT_TOLERANCE)
    np.testing.assert_allclose(gpu.image, single.image, atol=methods.DEFAULT_TOLERANCE)
    assert gpu.plan["pipeline"] == "tiles"


def test_a_wgsl_that_differs_from_its_numpy_is_seen(strongest, needs_gpu):
    """The agreement above would fail."""
    wrong = strongest["WGSL"].replace("GAIN * color.a", "0.9 * GAIN * color.a")
    ab.register_method("wrong", wgsl=wrong, numpy=strongest["strongest"], parameters=METHODS["strongest"].parameters)
    images = [ab.render(scene(), CAMERA, **SIZE, method="wrong", device=device).image for device in ("cpu", "gpu")]
    assert np.abs(images[0] - images[1]).max() > 1e-2


def test_what_does_not_compile_is_told_in_its_own_line(strongest):
    for find, instead, word in (
        ("GAIN * color.a", "GAIN * colour.a", "colour"),
        ("fn left_out", "fn left_over", "left_out"),
        ("return 0u;\n", "workgroupBarrier();\n    return 0u;\n", "wait"),
    ):
        text = strongest["WGSL"].replace(find, instead)
        assert text != strongest["WGSL"]
        with pytest.raises(ShaderError, match=word) as raised:
            ab.register_method("broken", wgsl=text, parameters=METHODS["strongest"].parameters)
        if word == "colour":
            line = 1 + text[: text.index(instead)].count("\n")
            assert str(raised.value).startswith(f"broken:{line}: ")
    assert "broken" not in METHODS


def test_loops_are_refused_on_software_drivers_unless_they_are_counted(strongest, needs_gpu):
    looping = strongest["WGSL"].replace(
        "    (*s).alpha =", "    for (var i = 0u; i < 3u; i++) { (*s).sum += vec4f(0.0); }\n    (*s).alpha ="
    )
    given = {"wgsl": looping, "numpy": strongest["strongest"], "parameters": METHODS["strongest"].parameters}
    wanted = ab.render(scene(), CAMERA, **SIZE, method="strongest", device="cpu").image
    ab.register_method("looping", **given, loops=3)
    image = ab.render(scene(), CAMERA, **SIZE, method="looping", device="gpu").image
    np.testing.assert_allclose(image, wanted, atol=methods.DEFAULT_TOLERANCE)
    if any(row["kind"] == "software" for row in ab.devices().values()):
        ab.register_method("looping", **given)
        with pytest.raises(UnsupportedError, match=r"register_method\(…, loops=…\)"):
            ab.render(scene(), CAMERA, **SIZE, method="looping", device="llvmpipe")
        ab.register_method("looping", **given, loops=50_000)
        with pytest.raises(UnsupportedError, match="ends loops after"):
            ab.render(scene(), CAMERA, **SIZE, method="looping", device="llvmpipe")


def test_a_method_that_asks_for_passes_without_end_has_those_that_it_was_registered_with(strongest, needs_gpu):
    text = strongest["WGSL"].replace("return pass_index == 0u;", "return true;")
    given = {"numpy": strongest["strongest"], "parameters": METHODS["strongest"].parameters}
    ab.register_method("endless", wgsl=text, **given)
    image = ab.render(scene(), CAMERA, **SIZE, method="endless", device="gpu").image
    wanted = ab.render(scene(), CAMERA, **SIZE, method="strongest", device="gpu").image
    np.testing.assert_array_equal(image, wanted)


def test_a_method_runs_where_it_has_something_to_run(strongest, needs_gpu):
    given = {"parameters": METHODS["strongest"].parameters}
    ab.register_method("one", wgsl=strongest["WGSL"], **given)
    with pytest.raises(ParameterError, match="the CPU needs numpy of method 'one'"):
        ab.render(scene(), CAMERA, **SIZE, method="one", device="cpu")
    ab.register_method("one", numpy=strongest["strongest"], **given)
    with pytest.raises(ParameterError, match="a GPU needs wgsl of method 'one'"):
        ab.render(scene(), CAMERA, **SIZE, method="one", device="gpu")


def test_k_brings_the_k_nearest(registered, needs_gpu):
    """What nearest.wgsl does for k_buffer, a method of one's own has too."""
    text = """
        struct State { any: u32 }
        fn begin(place: Place) -> State { nearest_begin(); return State(0u); }
        fn turn(s: ptr<private, State>, pass_index: u32) -> bool { return pass_index == 0u; }
        fn insert(s: ptr<private, State>, fragment: Fragment, pass_index: u32) { _ = nearest_insert(fragment); }
        fn end(s: ptr<private, State>, behind: vec4f) -> vec4f { return layer_over(nearest_layer(), behind); }
        fn left_out(s: ptr<private, State>, count: u32) -> u32 { return 0u; }
    """
    ab.register_method("mine", wgsl=text, parameters=[ab.MethodParameter("k", 2, "kept", low=1, high=8)])
    for k in (1, 3):
        mine, wanted = (
            ab.render(scene(), CAMERA, **SIZE, method=id, k=k, device="gpu", pipeline="tiles").image
            for id in ("mine", "k_buffer")
        )
        np.testing.assert_array_equal(mine, wanted)


@pytest.mark.parametrize(
    ("id", "arguments", "message"),
    [
        ("wboit", {}, "built in"),
        ("No Name", {}, "a name in lower case"),
        ("mine", {"numpy": None}, "needs wgsl, which GPUs run, or numpy"),
        ("mine", {"numpy": 3}, "must be a function"),
        ("mine", {"order": "back"}, "order must be one of"),
        ("mine", {"flags": ["modes"]}, "flags must be one of"),
        ("mine", {"parameters": ["k"]}, "must be abuffer.MethodParameter"),
        ("mine", {"passes": 0}, "passes"),
        ("mine", {"wgsl": 5}, "wgsl must be text"),
        *(
            ("mine", {"parameters": [ab.MethodParameter(name, 1, "")]}, "a name of its own")
            for name in ("cutoff", "device", "color", "G", "g h")
        ),
        ("mine", {"parameters": [ab.MethodParameter("g", 1, "")] * 2}, "a name of its own"),
        ("mine", {"parameters": [ab.MethodParameter("g", 99, "", high=4)]}, "g must be between 0 and 4"),
        ("mine", {"parameters": [ab.MethodParameter("g", -1, "", low=-2)]}, "u32"),
        ("mine", {"parameters": [ab.MethodParameter("k", 100, "", low=1)]}, "high=64"),
    ],
    ids=str,
)
def test_what_is_no_method_is_refused(registered, id, arguments, message):
    with pytest.raises(ParameterError, match=message):
        ab.register_method(id, **{"numpy": lambda color, depth, primitive, behind: behind} | arguments)


def test_a_function_that_returns_another_shape_is_told_so(registered):
    ab.register_method("flat", numpy=lambda color, depth, primitive, behind: behind[:, :3])
    with pytest.raises(ParameterError, match=r"numpy of method 'flat', .*, must return \(\d+, 4\), premultiplied"):
        ab.render(scene(), CAMERA, **SIZE, method="flat", device="cpu")


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        (lambda behind: behind + 1j, "for pixels of 2 fragments, must be numbers, got dtype complex128"),
        (lambda behind: behind.astype(str), "for pixels of 2 fragments, must be numbers, got dtype <U"),
        (lambda behind: behind > 0, "for pixels of 2 fragments, must be numbers, got dtype bool"),
        (lambda behind: [[0, 0, 0, 0], [0]], "for pixels of 2 fragments, is not an array"),
        (lambda behind: behind * [1, 1, np.nan, 1], r"for pixels of 2 .*finite numbers, got \[1.0, 1.0, nan, 1.0\] in pixel \[1, 2\]"),
        (lambda behind: behind * [1, np.inf, 1, 1], r"for pixels of 2 .*finite numbers, got \[1.0, inf, 1.0, 1.0\] in pixel \[1, 2\]"),
    ],
    ids=["complex", "text", "bool", "ragged", "nan", "inf"],
)  # fmt: skip
def test_a_function_that_returns_no_colors_is_told_where(registered, returned, message):
    """Two fragments in pixel [1, 2] of 2 × 3, none elsewhere."""
    frags = ab.Fragments((2, 3), [0, 0, 0, 0, 0, 0, 2], [1.0, 2.0], np.ones((2, 4)), background=1)

    def bad_where_deep(color, depth, primitive, behind):
        return returned(behind) if color.shape[1] else behind

    ab.register_method("bad", numpy=bad_where_deep)
    with pytest.raises(ParameterError, match="numpy of method 'bad', " + message):
        frags.composite("bad")


def test_a_function_may_return_floats_of_any_size_or_integers(registered):
    frags = ab.Fragments((1, 1), [0, 1], [1.0], np.ones((1, 4)))
    for dtype in (np.float16, np.float32, np.uint8):
        ab.register_method("ones", numpy=lambda color, depth, primitive, behind, d=dtype: np.ones((len(behind), 4), d))
        np.testing.assert_array_equal(frags.composite("ones")[0, 0], (1, 1, 1, 1))
