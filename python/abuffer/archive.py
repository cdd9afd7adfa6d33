"""Fragment lists as arrays of an .npz, and back."""

import json

import numpy as np

from . import _check
from .blend import Blend
from .errors import ParameterError, SceneError

VERSION = 2  # 1 knew neither samples nor blend modes
PER_FRAGMENT = ("depth", "key", "color", "primitive")
EXTRA = ("coverage", "blend")  # where a scene needs them


def read_npz(path) -> dict:
    """The arrays of an .npz. Only what the system refuses, a missing file say, stays an OSError."""
    try:
        with open(_check.path(path), "rb") as file, np.load(file, allow_pickle=False) as arrays:
            return dict(arrays)
    except (OSError, MemoryError):
        raise
    except Exception as e:  # numpy's, zipfile's and zlib's, whichever notices first
        raise ParameterError(f"{str(path)!r} is not an .npz that abuffer saved") from e


def to_arrays(frags) -> dict:
    """Everything that `Fragments` are made of, but for what numpy callables of Blends do."""
    background = frags.background
    if background.size:
        first = background[(0,) * (background.ndim - 1)]
        background = first if (background == first).all() else background
    about = {"abuffer": "fragments", "version": VERSION, "samples": frags.samples}
    about["blends"] = [{"name": blend.name, "wgsl": blend.wgsl} for blend in frags.blends]
    arrays = {
        "shape": np.array(frags.shape),
        "offsets": frags.offsets,
        "window": np.array(frags._window),
        "background": background,
        "format": np.array(json.dumps(about)),
    }
    arrays |= {field: getattr(frags, field) for field in PER_FRAGMENT}
    return arrays | {field: getattr(frags, field) for field in EXTRA if getattr(frags, field) is not None}


def from_arrays(arrays, path):
    """The arguments of `Fragments`, and where they lie in the whole image."""
    wanted = {"shape", "offsets", "background", "window", *PER_FRAGMENT}
    missing = wanted - set(arrays)
    if missing:
        raise SceneError(f"{str(path)!r} holds no fragment lists: {', '.join(sorted(missing))} missing")
    about = json.loads(str(arrays["format"])) if "format" in arrays else {}
    if about.get("version", 1) > VERSION:
        raise ParameterError(
            f"{str(path)!r} is of a newer abuffer, format {about['version']}: this one reads {VERSION}"
        )
    fields = {field: arrays[field] for field in ("offsets", "background", *PER_FRAGMENT)}
    fields |= {field: arrays[field] for field in EXTRA if field in arrays}
    fields |= {"shape": tuple(int(n) for n in arrays["shape"]), "samples": about.get("samples", 1)}
    fields["blends"] = tuple(Blend._loaded(blend["wgsl"], blend["name"]) for blend in about.get("blends", ()))
    return fields, tuple(int(v) for v in arrays["window"])
