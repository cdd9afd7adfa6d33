"""What all tests share: what happens to GPU tests where there is no adapter, and to those of pages without a browser."""

import os
import shutil
import sys
from pathlib import Path

import pytest

import abuffer as ab

BROWSER = ("chromium", "chromedriver")

# Peers are run by what benchmarks run them by. Last: both have a scenes.py.
sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))


def require_adapter():
    """Fails under ABUFFER_REQUIRE_GPU=1 where there is no adapter, and skips visibly otherwise."""
    if any("linked_list" in row["pipelines"] for row in ab.devices().values()):
        return
    if os.environ.get("ABUFFER_REQUIRE_GPU") == "1":
        pytest.fail("no GPU adapter, not even a software one, and ABUFFER_REQUIRE_GPU is set", pytrace=False)
    pytest.skip("no GPU adapter: install mesa-vulkan-drivers and libvulkan1")


def require_browser():
    """Fails under ABUFFER_REQUIRE_BROWSER=1 where there is no Chromium, and skips visibly otherwise."""
    missing = [program for program in BROWSER if shutil.which(program) is None]
    if not missing:
        return
    if os.environ.get("ABUFFER_REQUIRE_BROWSER") == "1":
        pytest.fail(f"no {' and no '.join(missing)}, and ABUFFER_REQUIRE_BROWSER is set", pytrace=False)
    pytest.skip(f"no {' and no '.join(missing)}: install chromium and chromium-driver")


def pytest_runtest_setup(item):
    parameters = item.callspec.params.values() if hasattr(item, "callspec") else ()
    if any(getattr(value, "device", None) == "gpu" for value in parameters):
        require_adapter()


@pytest.fixture
def needs_gpu():
    require_adapter()


def pytest_report_header():
    return f"abuffer {ab.__version__} on {', '.join(ab.devices())}"
