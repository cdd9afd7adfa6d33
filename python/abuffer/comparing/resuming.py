"""Going on with a saved comparison: only where what was measured is what is asked for now."""

import hashlib

import numpy as np

from .. import _check
from ..errors import ParameterError
from ..mesh import Mesh
from .measuring import OTHER

# Of the environment, what rows of one comparison share.
SHARED = ("abuffer", "commit", "processor")


def fingerprint(subject, size, reference) -> dict:
    """What a scene's images are made of and compared with: text by what it tells of.

    Args:
        reference: "float64" or "fragments", or the image.
    """
    meshes = hashlib.sha256()
    for mesh in subject.scene.meshes:
        for name in Mesh.__slots__:
            if name != "name":
                _add(meshes, getattr(mesh, name))
    view = hashlib.sha256()
    for matrix in subject.camera.matrices(*size):
        _add(view, matrix)
    background, image = hashlib.sha256(), hashlib.sha256()
    _add(background, _check.background(subject.background, size[::-1]))
    if not isinstance(reference, str):
        _add(image, reference)
        reference = image.hexdigest()
    hashes = {"meshes": meshes, "camera": view, "background": background}
    size = "×".join(map(str, size))
    return {"size": size, "reference": reference} | {name: each.hexdigest() for name, each in hashes.items()}


def _add(digest, value):
    digest.update(repr((value.shape, value.dtype.str) if isinstance(value, np.ndarray) else value).encode())
    if isinstance(value, np.ndarray):
        digest.update(np.ascontiguousarray(value).tobytes())


def check_same(compared, scene, device, asked, entries):
    """Raises a ParameterError if what `compared` has of a scene and a device is not what is asked for.

    Args:
        asked: the scene's `fingerprint`.
        entries: those asked for.
    """
    if scene not in compared.exact:
        return
    before = compared.asked[scene]
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
        if before.get(name) != now[name]:
            raise ParameterError(
                f"it was measured with {name} {before.get(name)!r}, and this is {now[name]!r}: save to another folder"
            )
