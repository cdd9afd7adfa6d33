"""Where a comparison was measured."""

import datetime
import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

from .. import _core, tables


def environment(devices) -> dict:
    """Versions, devices with their drivers, and the commit that the package is of, if it is in a repository."""
    every = tables.devices()
    names = {tables.named(device) for device in devices}
    return {
        "abuffer": _core.VERSION,
        "commit": _commit(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "metrics": {package: _version(package) for package in ("scikit-image", "flip-evaluator")},
        "system": platform.platform(),
        "processor": _processor(),
        "devices": {name: dict(every[name]) for name in sorted(names)},
        "date": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"),
    }


def _version(package):
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _commit():
    folder = Path(__file__).parent
    try:
        git = ["git", "-C", str(folder), "rev-parse", "HEAD"]
        tracked = subprocess.run(
            ["git", "-C", str(folder), "ls-files", "--error-unmatch", __file__], capture_output=True
        )
        done = subprocess.run(git, capture_output=True, text=True)
    except OSError:
        return ""
    # An installed package may lie in the repository of something else.
    return done.stdout.strip() if done.returncode == 0 and tracked.returncode == 0 else ""


def _processor():
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return f"{models[0]}, {len(models)} threads" if models else platform.processor()
