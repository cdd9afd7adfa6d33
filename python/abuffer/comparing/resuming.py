"""Going on with a saved comparison: only where what was measured is what is asked for now."""

import hashlib
from types import CodeType

import numpy as np

from .. import _check
from .._methods import METHODS
from ..blend import Blend
from ..errors import ParameterError
from ..mesh import Mesh
from .measuring import OTHER

# Of the environment, what rows of one comparison share.
SHARED = ("abuffer", "commit", "processor", "metrics")
OWN = "an image of your own"


def fingerprint(subject, size, reference, entries) -> dict:
    """What a scene's images are made of and compared with: text by what it tells of.

    Args:
        reference: "float64" or "fragments", or the image.
        entries: of all devices.
    """
    methods = {METHODS[entry.method] for entry in entries if entry.method in METHODS}
    told = {
        "size": "×".join(map(str, size)),
        "reference": reference if isinstance(reference, str) else OWN,
        "image as reference": _digest([] if isinstance(reference, str) else [reference]),
        "meshes": _digest(
            getattr(mesh, name) for mesh in subject.scene.meshes for name in Mesh.__slots__ if name != "name"
        ),
        "camera": _digest(subject.camera.matrices(*size)),
        "background": _digest([_check.background(subject.background, size[::-1])]),
    }
    own = sorted((method.id, method.wgsl, method.numpy) for method in methods if method.wgsl or method.numpy)
    return told | {"code of methods": _digest(part for method in own for part in method)}


def _digest(values) -> str:
    digest = hashlib.sha256()
    for value in values:
        if isinstance(value, np.ndarray):
            digest.update(repr((value.shape, value.dtype.str)).encode())
            digest.update(np.ascontiguousarray(value).tobytes())
        elif isinstance(value, Blend):
            digest.update(repr((value.name, value.wgsl, _code(value.numpy))).encode())
        else:
            digest.update(repr(_code(value)).encode())
    return digest.hexdigest()


def _code(value):
    """What a function computes, as far as its own code and what it holds on to say; all else as it is."""
    if isinstance(value, CodeType):
        return value.co_code, value.co_names, [_code(constant) for constant in value.co_consts]
    if not callable(value) or not hasattr(value, "__code__"):
        return value
    held = [_code(cell.cell_contents) for cell in value.__closure__ or ()]
    return _code(value.__code__), value.__defaults__, held


def check_same(compared, scene, device, asked, entries):
    """Raises a ParameterError if what `compared` has of a scene and a device is not what is asked for.

    Args:
        asked: the scene's `fingerprint`.
        entries: those asked for.
    """
    if scene not in compared.exact:
        return
    before = compared.asked[scene]
    if not before:
        raise ParameterError(f"it is not known what {scene} was measured with: save to another folder")
    other = [what for what in asked if asked[what] != before.get(what)]
    if other:
        told = f" ({before['size']}, and {asked['size']} is asked for)" if "size" in other else ""
        raise ParameterError(f"{scene} was measured with another {', '.join(other)}{told}: save to another folder")
    rows = compared.select(scene=scene, device=device)
    measured = {_told(row) for row in rows if row["method"] != OTHER}
    wanted = {_told(entry.__dict__) for entry in entries}
    if measured and measured != wanted:
        labels = sorted({label for label, *_ in measured ^ wanted})
        raise ParameterError(f"{scene} was measured with other methods ({', '.join(labels)}): save to another folder")


def _told(row):
    return row["label"], row["method"], row["pipeline"], repr(sorted(row["parameters"].items()))


def check_environment(before, now):
    """Raises a ParameterError if rows of both do not belong into one table."""
    for name in SHARED:
        _check_one(name, before.get(name), now[name])
    for name in set(before["devices"]) & set(now["devices"]):
        _check_one(f"the driver of {name}", before["devices"][name]["driver"], now["devices"][name]["driver"])


def _check_one(name, before, now):
    if before != now:
        raise ParameterError(f"it was measured with {name} {before!r}, and this is {now!r}: save to another folder")
