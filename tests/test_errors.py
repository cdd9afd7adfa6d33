"""What can go wrong, each class of error raised by a real call: what, where, what was got, the limit, what to do."""

import os
import pickle
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import abuffer as ab

SHADERS = Path(__file__).parents[1] / "shaders"
CORNERS = [[-1, -1, 0], [1, -1, 0], [0, 1, 0]]
TRIANGLE = ab.Mesh(CORNERS, colors=(1, 0, 0, 0.5))
CAMERA = ab.Camera.look_at((0, 0, 3), (0, 0, 0))

BUILTINS = {
    ab.SceneError: ValueError,
    ab.ParameterError: ValueError,
    ab.DeviceError: RuntimeError,
    ab.UnsupportedError: RuntimeError,
    ab.CapacityError: MemoryError,
    ab.ShaderError: RuntimeError,
}


def render(scene=TRIANGLE, **kw):
    return ab.render(scene, CAMERA, **{"width": 8, "height": 8, "device": "cpu", **kw})


def message(error, call, *args, **kw):
    """What a call says when it raises exactly this class."""
    with pytest.raises(error) as caught:
        call(*args, **kw)
    assert type(caught.value) is error
    return str(caught.value)


def in_another_process(script, **environment):
    """What a script prints that needs an environment of its own. `refused(**kw)` in it prints class and message."""
    prelude = f"""
import abuffer as ab
def refused(**kw):
    try:
        ab.render(ab.Mesh({CORNERS}), width=8, height=8, **kw)
    except ab.AbufferError as error:
        print(type(error).__name__, error, sep=": ")
    else:
        raise SystemExit("nothing was raised")
"""
    environment = {k: v for k, v in os.environ.items() if k != "ABUFFER_DEVICE"} | environment
    command = [sys.executable, "-W", "error", "-c", prelude + script]
    done = subprocess.run(command, capture_output=True, text=True, encoding="utf-8", timeout=120, env=environment)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


# ---- what they all are ----


@pytest.mark.parametrize(("error", "builtin"), BUILTINS.items())
def test_every_class_is_an_abuffer_error_and_the_builtin_one_expects(error, builtin):
    assert issubclass(error, ab.AbufferError)
    assert issubclass(error, builtin)
    assert error.__doc__


def test_there_are_no_other_classes():
    public = {value for value in vars(ab.errors).values() if isinstance(value, type)}
    assert public == {*BUILTINS, ab.AbufferError}
    assert all(getattr(ab, error.__name__) is error for error in public)


@pytest.mark.parametrize("error", BUILTINS)
def test_errors_pickle(error):
    copy = pickle.loads(pickle.dumps(error("what, where")))
    assert (type(copy), str(copy)) == (error, "what, where")


def test_an_error_from_rust_is_of_the_same_class_and_pickles():
    with pytest.raises(ab.CapacityError) as caught:
        render(memory=16)
    copy = pickle.loads(pickle.dumps(caught.value))
    assert (type(copy), str(copy)) == (ab.CapacityError, str(caught.value))
    assert isinstance(copy, MemoryError)


# ---- SceneError: names array, row and value ----


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        ({"positions": [[0, 0, 0], [1, 0, np.nan], [0, 1, 0]]}, ["positions[1, 2]", "nan", "finite"]),
        ({"positions": [[0, 0, 0], [np.inf, 0, 0], [-np.inf, 1, 0]]}, ["positions[1, 0]", "inf", "2 such values"]),
        ({"positions": [[0, 0], [1, 0], [0, 1]]}, ["positions", "(N, 3)", "(3, 2)"]),
        ({"positions": np.zeros((3, 4))}, ["positions", "(3, 4)", "transpose"]),
        ({"positions": CORNERS[:2]}, ["positions", "2 rows", "every three"]),
        ({"positions": [["a", "b", "c"]] * 3}, ["positions", "numbers", "<U1"]),
        ({"faces": [[0, 1, 3]]}, ["faces[0, 2]", "3", "0 to 2"]),
        ({"faces": [[0, 1, -1]]}, ["faces[0, 2]", "-1", "0 to 2"]),
        ({"faces": [[0.0, 1.0, 2.0]]}, ["faces", "integers", "float64"]),
        ({"colors": (1, 1, 1, 1.5)}, ["colors[3]", "1.5", "alpha in [0, 1]"]),
        ({"colors": (0.5, -0.25, 1)}, ["colors[1]", "-0.25", "at least 0"]),
        ({"colors": (255, 0, 0)}, ["colors[0]", "255", "uint8 for 0 to 255"]),
        ({"colors": np.ones((2, 4))}, ["colors", "(2, 4)", "3 positions", "1 faces"]),
        ({"colors": np.ones((3, 2))}, ["colors", "3 or 4 channels", "(3, 2)"]),
    ],
    ids=lambda value: str(value)[:40] if isinstance(value, list) else "",
)
def test_a_mesh_that_cannot_be_drawn_names_array_row_and_value(arguments, parts):
    text = message(ab.SceneError, ab.Mesh, **({"positions": CORNERS} | arguments))
    assert all(part in text for part in parts), text


def test_colours_that_fit_vertices_and_faces_ask_which():
    corners, faces = np.zeros((3, 3)), [[0, 1, 2]] * 3
    assert 'color_mode="vertex" or color_mode="face"' in message(
        ab.SceneError, ab.Mesh, corners, faces, np.ones((3, 4))
    )


def test_a_file_that_is_not_there_is_named_with_what_can_be_read():
    text = message(ab.SceneError, ab.Scene, "nothing.ply")
    assert "nothing.ply" in text
    assert "PLY, OBJ, STL, OFF, GLB and glTF" in text


def test_an_item_that_is_no_geometry_says_what_is():
    assert "trimesh.Trimesh" in message(ab.SceneError, ab.Scene, 3)


def test_lists_that_are_not_sorted_name_the_pixel():
    lists = (1, 2), [0, 0, 2], [2.0, 1.0], np.ones((2, 4))
    assert "pixel [0, 1] is not sorted" in message(ab.SceneError, ab.Fragments, *lists)


# ---- ParameterError: lists what is valid, suggests the nearest ----


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        ({"method": "exat"}, ["method", "'exat'", "did you mean 'exact'?"]),
        ({"method": "painter"}, ["method must be one of 'exact'", "'painter'"]),
        ({"pipeline": "tile"}, ["'auto', 'tiles', 'linked_list', 'prefix_sum'", "'tile'", "did you mean 'tiles'?"]),
        ({"precision": "double"}, ["'float32', 'float64'", "'double'"]),
        ({"device": 3}, ["device", '"cpu"', "3"]),
        ({"device": None}, ["device", "None"]),
        (
            {"cutof": 0.1},
            ["render() has no argument 'cutof'", "method 'exact' no option", "arguments are scene, camera"],
        ),
        ({"memory": "lots"}, ["memory", '"2GiB"', "'lots'"]),
        ({"memory": "-1GB"}, ["memory", "'-1GB'"]),
        ({"memory": 0}, ["memory", "at least 1 byte", "0"]),
        ({"memory": True}, ["memory", "True"]),
        ({"width": 0}, ["width", "1 to 16384", "0"]),
        ({"height": 16385}, ["height", "1 to 16384", "16385"]),
        ({"width": 8.0}, ["width", "integer", "8.0"]),
        ({"height": None}, ["both width and height"]),
        ({"samples": 0}, ["samples must be one of 1, 2, 4, 8, 16", "0"]),
        ({"samples": 3}, ["samples must be one of 1, 2, 4, 8, 16", "3"]),
        ({"fragments": "yes"}, ["fragments", '"count"', "'yes'"]),
        ({"background": (1, 2)}, ["background", "(2,)"]),
        ({"background": np.ones((4, 4, 3))}, ["background", "(8, 8)", "(4, 4, 3)"]),
        ({"background": (0, 0, 0, 2.0)}, ["background[3]", "2.0"]),
        ({"camera": "front"}, ["camera", "abuffer.Camera", "str"]),
    ],
    ids=lambda value: "-".join(f"{k}={v!r}"[:30] for k, v in value.items()) if isinstance(value, dict) else "",
)
def test_a_wrong_argument_says_what_it_must_be_and_what_it_was(arguments, parts):
    arguments = {"width": 8, "height": 8, "device": "cpu", "camera": CAMERA} | arguments
    text = message(ab.ParameterError, ab.render, TRIANGLE, **arguments)
    assert all(part in text for part in parts), text


@pytest.mark.parametrize(
    ("call", "part"),
    [
        (lambda: ab.Camera.look_at((0, 0, 3), (0, 0, 3)), "eye"),
        (lambda: ab.Camera.look_at((0, 3, 0), (0, 0, 0)), "up"),
        (lambda: ab.Camera.look_at((0, 0, 3), (0, 0, 0), fov_y=180), "fov_y must be between 0 and 180"),
        (lambda: ab.Camera.look_at((0, 0, 3), (0, 0, 0), near=2, far=1), "far must be beyond near"),
        (lambda: ab.Camera(np.zeros((3, 3)), np.eye(4)), "view must have shape (4, 4), got (3, 3)"),
        (lambda: ab.Mesh(CORNERS, cull="both"), "cull must be one of None, 'back', 'front'"),
        (lambda: ab.Mesh(CORNERS, blend="ovr"), "did you mean 'over'?"),
        (lambda: ab.Mesh(CORNERS, opaque=True, blend="screen"), "opaque=False, or blend=\"over\" instead of 'screen'"),
        (lambda: ab.Mesh(CORNERS, alpha=2), "alpha must be between 0 and 1, got 2"),
        (lambda: ab.Mesh(CORNERS, alpha_cutoff=0.5), "opaque=True"),
        (lambda: ab.Scene(TRIANGLE).locate([1]), "primitives run from 0 to 0"),
        (lambda: render(fragments=True).fragments.composite(method="exat"), "did you mean 'exact'?"),
        (lambda: render(fragments=True).fragments.to_padded(k=-1), "k must be an integer, 0 or more, got -1"),
        (lambda: render().save("picture.jpg"), ".png or .npz, got 'picture.jpg'"),
    ],
)
def test_other_wrong_arguments_say_so_too(call, part):
    with pytest.raises(ab.ParameterError) as caught:
        call()
    assert part in str(caught.value)


# ---- DeviceError: lists what was tried, how to install a driver, says that the CPU works ----


def test_a_device_of_no_such_name_lists_those_there_are():
    text = message(ab.DeviceError, render, device="Voodoo 2")
    assert "'Voodoo 2'" in text
    assert all(name in text for name in ab.devices())
    assert 'device="cpu" always works' in text


@pytest.mark.skipif(
    sys.platform != "linux", reason="elsewhere there is more than Vulkan, whose drivers these variables hide"
)
def test_without_an_adapter_gpu_says_what_was_tried_and_auto_is_the_cpu(tmp_path):
    nothing = str(tmp_path / "no driver.json")
    script = """
refused(device="gpu")
refused(pipeline="linked_list")
print(list(ab.devices()))
frame = ab.render(ab.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), width=8, height=8)
print(frame.plan["device"], frame.stats.fragments > 0)
"""
    for_gpu, for_list, devices, auto = in_another_process(
        script, VK_DRIVER_FILES=nothing, VK_ICD_FILENAMES=nothing
    ).splitlines()
    for line in (for_gpu, for_list):
        assert line.startswith("DeviceError: ")
        for part in ("Vulkan, Metal or DX12", "apt install mesa-vulkan-drivers", 'device="cpu"'):
            assert part in line
    assert devices == "['cpu']"
    assert auto == "cpu True"


# ---- UnsupportedError: names the feature ----


def test_tiles_on_a_gpu_say_how_large_an_image_has_opaque_surfaces(needs_gpu):
    scene = ab.Mesh([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], opaque=True)
    size = {"width": 16384, "height": 16384}
    text = message(ab.UnsupportedError, ab.render, scene, pipeline="tiles", device="gpu", **size)
    assert "opaque surfaces of 16384×16384 pixels" in text
    assert 'device="cpu"' in text
    assert 'pipeline="linked_list"' in text


@pytest.mark.parametrize(
    ("package", "script"),
    [
        ("trimesh", 'ab.Scene("model.obj")'),
        ("pandas", "frame.fragments.to_pandas()"),
        (
            "PIL",
            'ab.testing.assert_matches_reference("image.png", ab.Scene(), ab.Camera.look_at((0, 0, 1), (0, 0, 0)))',
        ),
    ],
)
def test_a_package_that_is_not_installed_is_named_with_its_command(package, script, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("model.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    frame = render(fragments=True)
    frame.save("image.png")
    monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.setitem(sys.modules, f"{package}.Image", None)
    text = message(ab.UnsupportedError, eval, script, {"ab": ab, "frame": frame})
    assert "pip install" in text


# ---- CapacityError: the bytes needed, the limit, and what to lower or raise ----


@pytest.mark.parametrize("device", ["cpu", "gpu"])
def test_what_does_not_fit_says_the_bytes_the_limit_and_what_to_do(device, request):
    if device == "gpu":
        request.getfixturevalue("needs_gpu")
    layers = ab.Mesh([[[-9, -9, z], [27, -9, z], [-9, 27, z]] for z in np.linspace(-1, 1, 500)])
    text = message(ab.CapacityError, render, layers, device=device, memory=2000)
    needed, limit = (int(word) for word in text.split() if word.isdigit())
    assert needed > limit
    assert limit <= 2000
    assert "raise memory=" in text
    assert render(layers, device=device, memory=4_000_000).stats.fragments == 500 * 64


# ---- ShaderError: file and line of the user's own text ----


@pytest.mark.parametrize(
    "broken",
    ["    let oops = nothing_of_this_name;", "    let oops = ;", "    var oops: f32 = 1u;"],
    ids=["unknown name", "syntax", "type"],
)
def test_a_shader_that_does_not_compile_names_its_file_and_line(broken, tmp_path, needs_gpu):
    name = "methods/exact.wgsl"  # no render on a GPU goes without
    lines = (SHADERS / name).read_text(encoding="utf-8").splitlines()
    row = next(i for i, line in enumerate(lines) if re.match(r"fn end\(.*{$", line))
    lines.insert(row + 1, broken)
    file = tmp_path / name
    file.parent.mkdir()
    file.write_text("\n".join(lines), encoding="utf-8")
    printed = in_another_process('refused(device="gpu")', ABUFFER_SHADER_DIR=str(tmp_path))
    assert printed.startswith(f"ShaderError: {file}:{row + 2}: ")
    assert "oops" in printed  # the line itself


def test_a_shader_folder_without_that_file_changes_nothing(tmp_path, needs_gpu):
    script = (
        'print(ab.render(ab.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), width=8, height=8, device="gpu").plan["pipeline"])'
    )
    assert in_another_process(script, ABUFFER_SHADER_DIR=str(tmp_path)) == "linked_list\n"


# ---- what is wrong, and what to do about it ----


@pytest.mark.parametrize(
    ("call", "parts"),
    [
        (lambda: render(size=8), ["no argument 'size'", "method 'exact' no option", "arguments are scene, camera"]),
        (lambda: render(widht=8), ["no argument 'widht'", "did you mean 'width'?"]),
        (lambda: render(background=None), ["background", "got None", "(0, 0, 0, 0) is transparent"]),
        (lambda: ab.Mesh(np.zeros((5, 3)), np.zeros((3, 5), int)), ["(3, 5)", "transpose it?"]),
        (lambda: ab.Mesh(CORNERS, [[0, 1, 2, 0]]), ["(1, 4)", "split quads into triangles"]),
        (lambda: ab.Mesh(CORNERS, cull="none"), ["cull", "did you mean None?"]),
        (lambda: ab.Scene(np.zeros((3, 3))), ["this ndarray", "wrap it: ab.Mesh(positions, faces)"]),
        (lambda: ab.Scene((np.zeros((3, 3)), np.zeros((1, 3)))), ["this ndarray", "wrap it: ab.Mesh"]),
        (lambda: ab.Scene(TRIANGLE).locate(7), ["from 0 to 0, got 7"]),
        (lambda: ab.Scene(TRIANGLE).locate([3, 7]), ["from 0 to 0, got 3 to 7"]),
        (lambda: render(fragments=True).fragments[0], ["[y, x]", "got 0"]),
        (lambda: render(fragments=True).fragments[0, 1, 2], ["[y, x]", "got (0, 1, 2)"]),
        (lambda: ab.Mesh(CORNERS, colors=(1e39, 0, 0)), ["colors[0]", "1e+39", "float32"]),
        (lambda: render(background=(0, 0, 4e38)), ["background[2]", "4e+38", "float32"]),
    ],
)
def test_messages_say_what_to_do(call, parts):
    with pytest.raises(ValueError) as caught:
        call()
    assert isinstance(caught.value, ab.AbufferError)
    assert all(part in str(caught.value) for part in parts), str(caught.value)


def test_an_index_that_is_no_integer_is_named():
    with pytest.raises(TypeError, match=r"integers or slices, got 0\.5"):
        render(fragments=True).fragments[0.5, 0]


def test_the_largest_colours_of_float32_stay_finite():
    largest = float(np.finfo(np.float32).max)
    image = render(ab.Mesh(CORNERS, colors=(largest, 0, 0, 0.5)), background=(largest, 0, 0)).image
    assert np.isfinite(image).all()
    assert image[..., 0].max() == pytest.approx(largest, rel=1e-6)


# ---- arguments of numpy's types ----


@pytest.mark.parametrize(
    "memory", [1e22, 10**400, np.float32(1e9), np.int64(10**9), float("inf"), "9" * 400, "1e9", [1], 0.5, float("nan")]
)
def test_memory_of_any_number(memory):
    if memory in ("1e9", [1], 0.5) or memory != memory:
        with pytest.raises(ab.ParameterError, match="memory must be"):
            render(memory=memory)
    else:
        assert render(memory=memory).stats.bands == 1


@pytest.mark.parametrize(
    "samples", [np.array(1), np.array([1, 2]), "4", 1.5, 4.0, None, True, np.True_, np.int64(-1), 5, 32, [4], {}]
)
def test_samples_that_are_refused(samples):
    with pytest.raises(ab.ParameterError, match="samples must be one of 1, 2, 4, 8, 16, got"):
        render(samples=samples)


def test_numpys_own_types_are_taken():
    assert render(samples=np.int64(4), fragments=np.True_).fragments.samples == 4
    assert render(fragments=np.False_).fragments is None
    for precision in (np.float64, np.float32, np.dtype("float64")):
        assert render(precision=precision).image.dtype == precision
    with pytest.raises(ab.ParameterError, match="'float16'"):
        render(precision=np.float16)
