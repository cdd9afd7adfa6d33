"""The layout holds: who may name what, what belongs to a method, and what importing costs."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from abuffer._methods import METHODS
from abuffer.own_methods import BUILT_IN

ROOT = Path(__file__).parents[1]
SRC, PACKAGE = ROOT / "src", ROOT / "python" / "abuffer"

# Lowest first. A file may name its own room and those below, never one above; but for the lowest, rooms of one rank do
# not know each other.
RANKS = [
    {"error", "real"},
    {"memory", "scene", "png", "samples", "shader", "threads"},
    {"blend", "camera", "clip", "fragments", "node_format"},
    {"methods"},
    {"frame"},
    {"resolve"},
    {"cpu", "gpu", "composite"},
    {"render"},
    {"python"},
]


def rust_files():
    return sorted(SRC.rglob("*.rs"))


def code(path):
    """A Rust file without comments, text and its tests."""
    return code_of(path.read_text(encoding="utf-8"))


def code_of(text):
    text = text.split("#[cfg(test)]\nmod tests")[0]
    text = re.sub(r'"(?:[^"\\]|\\.)*"', '""', text)
    return re.sub(r"//.*", "", text)


def room(path):
    return path.relative_to(SRC).parts[0].removesuffix(".rs")


def named_rooms(text):
    """(room, what of it) for every path from the crate's root in a file's code."""
    found = []
    for name, rest in re.findall(r"\bcrate::(\w+)(?:::(\{[^}]*\}|\w+))?", code_of(text)):
        items = re.findall(r"\w+", rest) or [""]
        found += [(name, item) for item in items]
    return found


def users_of(*crates):
    pattern = re.compile(rf"\b({'|'.join(crates)})\b")
    return {path.relative_to(SRC).as_posix() for path in rust_files() if pattern.search(code(path))}


def test_only_the_python_room_names_pyo3_and_numpy():
    users = users_of("pyo3", "numpy")
    assert "python/mod.rs" in users
    assert all(user.startswith("python/") for user in users)


def test_only_gpu_and_shader_name_wgpu_and_naga():
    users = users_of("wgpu", "naga")
    assert "gpu/device.rs" in users
    assert all(user.startswith(("gpu/", "shader/")) for user in users)


def test_every_room_has_a_rank():
    assert {room(path) for path in rust_files()} - {"lib"} == set().union(*RANKS)


def upward(name, text):
    """What a file in the room `name` names that is above it or beside it."""
    rank = {each: height for height, rooms in enumerate(RANKS) for each in rooms}
    # The lowest rooms, errors and arithmetic, may be named from everywhere, also by each other.
    return [(other, item) for other, item in named_rooms(text) if other != name and rank[other] >= max(rank[name], 1)]


@pytest.mark.parametrize("path", rust_files(), ids=lambda path: path.relative_to(SRC).as_posix())
def test_rust_looks_downwards_only(path):
    if room(path) != "lib":
        assert upward(room(path), path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("cpu", "use crate::python;"),
        ("cpu", "use crate::gpu::device::Gpu;"),
        ("gpu", "use crate::render::on_cpu;"),
        ("methods", "let x = crate::composite::composite(1);"),
        ("scene", "use crate::camera::Camera;"),
    ],
)
def test_looking_up_or_aside_would_be_seen(name, line):
    assert len(upward(name, f"// crate::error\n{line}\n")) == 1


# What sorts triangles is another method to the core.
CORE = [id for id in BUILT_IN if not METHODS[id].sorts]


def method_files():
    return [path for path in sorted((SRC / "methods").glob("*.rs")) if path.stem != "mod"]


def other_methods(own, text, methods):
    """The other methods that a method's file names."""
    return set(re.findall(r"\b(?:super|methods)::\{?\s*(\w+)", code_of(text))) & (set(methods) - {own})


def test_methods_do_not_import_each_other():
    stems = [path.stem for path in method_files()]
    for path in method_files():
        assert other_methods(path.stem, path.read_text(encoding="utf-8"), stems) == set()
    assert other_methods("mlab", "use super::exact::State;", ["exact", "mlab"]) == {"exact"}
    assert other_methods("mlab", "use crate::methods::{exact};", ["exact", "mlab"]) == {"exact"}


def test_a_method_is_two_files_of_its_name_and_a_row():
    shaders = ROOT / "shaders" / "methods"
    files = {*CORE, "bounds"}  # which is what is known of some
    assert {path.stem for path in method_files()} == files
    assert {path.stem for path in shaders.glob("*.wgsl")} == files


def test_a_method_has_the_same_functions_in_rust_and_wgsl():
    for method in CORE:
        rust = code(SRC / "methods" / f"{method}.rs")
        wgsl = code_of((ROOT / "shaders" / "methods" / f"{method}.wgsl").read_text(encoding="utf-8"))
        for function in ("begin", "insert", "end", *(() if method == "exact" else ("turn",))):
            assert re.search(rf"\bfn {function}\b", rust), (method, function)
            assert re.search(rf"\bfn {function}\b", wgsl), (method, function)


def test_in_python_only_the_top_names_render():
    pattern = re.compile(r"^\s*(?:from \.render import|from \. import .*\brender\b|import abuffer\b)", re.MULTILINE)
    users = {path.name for path in PACKAGE.glob("*.py") if pattern.search(path.read_text(encoding="utf-8"))}
    assert users == {"__init__.py", "__main__.py", "testing.py"}


def imported_by(statement):
    """Top-level modules that a fresh interpreter holds after a statement."""
    script = f"{statement}\nimport sys\nprint(*sorted({{name.split('.')[0] for name in sys.modules}}))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=True)
    return set(done.stdout.split())


def test_importing_abuffer_imports_no_optional_package():
    optional = {
        "trimesh",
        "pandas",
        "matplotlib",
        "rich",
        "PIL",
        "skimage",
        "flip_evaluator",
        "jinja2",
        "IPython",
        "scipy",
    }
    modules = imported_by("import abuffer")
    assert {"abuffer", "numpy"} <= modules
    assert not modules & optional
    assert "PIL" in imported_by("import PIL.Image")  # as it would show


def test_rendering_on_the_cpu_imports_no_optional_package_either():
    modules = imported_by("import abuffer as ab; ab.render(ab.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), device='cpu')")
    assert not modules & {"trimesh", "pandas", "matplotlib", "rich", "PIL"}


def test_tests_have_all_packages_that_extras_name():
    """Else what needs them is skipped where tests are set up from scratch, as scikit-image's comparisons were."""
    tomllib = pytest.importorskip("tomllib", reason="Python 3.11")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    extras = project["project"]["optional-dependencies"]
    wanted = {package for name, packages in extras.items() if name != "docs" for package in packages}
    assert "scikit-image>=0.22" in wanted
    assert {re.split("[<>=]", package)[0] for package in wanted} <= {
        re.split("[<>=]", package)[0] for package in project["dependency-groups"]["test"]
    }
