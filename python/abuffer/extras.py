"""Packages that are used where they are installed: `pip install 'abuffer[compare]'` brings them all."""

import importlib

from .errors import UnsupportedError

PACKAGES = {
    "skimage": "scikit-image",
    "flip_evaluator": "flip-evaluator",
    "pandas": "pandas",
    "matplotlib": "matplotlib",
    "jinja2": "jinja2",
}


def optional(name):
    """The module, or None where its package is missing."""
    try:
        return importlib.import_module(name)
    except ImportError:
        return None


def needed(name, what):
    """The module.

    Raises:
        UnsupportedError: its package is missing.
    """
    module = optional(name)
    if module is None:
        package = PACKAGES[name.partition(".")[0]]
        raise UnsupportedError(f"{what} needs {package}: pip install {package}, or 'abuffer[compare]'")
    return module
