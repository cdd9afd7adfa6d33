"""Comparisons on disk: a JSON file, and for each scene its exact frame and the images of all methods."""

import json
import os
from pathlib import Path

import numpy as np

from .. import _check, archive
from ..errors import ParameterError
from ..frame import Frame

NAME = "comparison.json"
FORMAT = "abuffer-comparison-1"


def holds(folder) -> bool:
    """Whether a comparison was saved there."""
    return (Path(_check.path(folder)) / NAME).exists()


def save(compared, folder):
    folder = Path(_check.path(folder))
    folder.mkdir(parents=True, exist_ok=True)
    scenes = []
    for i, scene in enumerate(compared.scenes):
        keys = [key for key in compared.rendered if key[0] == scene]
        arrays = {str(place): compared.rendered[key] for place, key in enumerate(keys)}
        _replaced(folder / f"images-{i}.npz", lambda path, a=arrays, s=scene: _write(path, a, compared.references[s]))
        exact = folder / f"exact-{i}.npz"
        if (exact.resolve(), scene) not in compared.written:  # it does not change
            _replaced(exact, lambda path, s=scene: compared.exact[s].save(path))
            compared.written.add((exact.resolve(), scene))
        scenes.append({"name": scene, "images": [list(key[1:]) for key in keys]})
    head = {"format": FORMAT, "environment": compared.environment, "scenes": scenes, "rows": compared.rows}
    # Last: what it names is there.
    _replaced(folder / NAME, lambda path: path.write_text(json.dumps(head, indent=1), encoding="utf-8"))


def _write(path, images, reference):
    with open(path, "wb") as file:
        np.savez_compressed(file, reference=reference, **images)


def _replaced(path, write):
    """Written aside, so that an interruption leaves the old one."""
    aside = path.with_name(f"new-{path.name}")
    write(aside)
    os.replace(aside, path)


def load(folder):
    from .comparison import Comparison  # which saves itself by this

    folder = Path(_check.path(folder))
    if not holds(folder):
        raise ParameterError(f"{str(folder)!r} holds no comparison: {NAME} is missing")
    head = json.loads((folder / NAME).read_text(encoding="utf-8"))
    if head.get("format") != FORMAT:
        raise ParameterError(f"{str(folder / NAME)!r} is of format {head.get('format')!r}: this reads {FORMAT!r}")
    compared = Comparison(head["rows"], head["environment"])
    for i, scene in enumerate(head["scenes"]):
        name, arrays = scene["name"], archive.read_npz(folder / f"images-{i}.npz")
        compared.references[name] = arrays["reference"]
        exact = folder / f"exact-{i}.npz"
        compared.exact[name] = Frame.load(exact)
        compared.written.add((exact.resolve(), name))
        compared.rendered |= {(name, *key): arrays[str(place)] for place, key in enumerate(scene["images"])}
    return compared
