"""What all tests share: what happens to GPU tests where there is no adapter."""

import os

import pytest

import abuffer as ab

collect_ignore = ["pyrender_worker.py"]  # runs in pyrender's own environment


def require_adapter():
    """Fails under ABUFFER_REQUIRE_GPU=1 where there is no adapter, and skips visibly otherwise."""
    if any("linked_list" in row["pipelines"] for row in ab.devices().values()):
        return
    if os.environ.get("ABUFFER_REQUIRE_GPU") == "1":
        pytest.fail("no GPU adapter, not even a software one, and ABUFFER_REQUIRE_GPU is set", pytrace=False)
    pytest.skip("no GPU adapter: install mesa-vulkan-drivers and libvulkan1")


def pytest_runtest_setup(item):
    parameters = item.callspec.params.values() if hasattr(item, "callspec") else ()
    if any(getattr(value, "device", None) == "gpu" for value in parameters):
        require_adapter()


@pytest.fixture
def needs_gpu():
    require_adapter()


def pytest_report_header():
    return f"abuffer {ab.__version__} on {', '.join(ab.devices())}"
