"""Comparisons on disk: a JSON file, and for each scene its exact frame and the images of all methods."""

import json
import math
import os
from pathlib import Path

import numpy as np

from .. import _check, archive
from ..errors import ParameterError
from ..frame import Frame
from .measuring import COLUMNS

NAME = "comparison.json"
FORMAT = "abuffer-comparison-1"
# Columns of rows that are text, or hold some: all others are numbers.
TEXTS = ("label", "method", "pipeline", "parameters", "curve", "device", "scene", "failure")


def holds(folder) -> bool:
    """Whether a comparison was saved there."""
    return (Path(_check.path(folder)) / NAME).exists()


def made(folder) -> Path:
    """The folder, which can be written to.

    Raises:
        ParameterError: it cannot.
    """
    folder = Path(_check.path(folder))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        aside = folder / f"new-{NAME}"
        aside.touch()
        aside.unlink()
    except OSError as e:
        raise ParameterError(f"{str(folder)!r} cannot be written to: {e}") from e
    return folder


def save(compared, folder, only=None):
    """Writes a comparison.

    Args:
        only: a scene, of which alone files are written: those of others are there.
    """
    folder, scenes = made(folder), []
    if only is None:
        (folder / NAME).unlink(missing_ok=True)  # of another comparison, which half of this one would not go with
    for i, scene in enumerate(compared.scenes):
        if scene not in compared.exact:
            raise ParameterError(f"the comparison has rows of {scene}, and no images: it cannot be saved")
        keys = [key for key in compared.rendered if key[0] == scene]
        if only in (None, scene):
            arrays = {str(place): compared.rendered[key] for place, key in enumerate(keys)}
            arrays["reference"] = compared.references[scene]
            _replaced(folder / f"images-{i}.npz", lambda path, arrays=arrays: _write(path, arrays))
            _replaced(folder / f"exact-{i}.npz", lambda path, scene=scene: compared.exact[scene].save(path))
        images = [list(key[1:]) for key in keys]
        scenes.append({"name": scene, "images": images, "asked": compared.asked.get(scene, {})})
    rows = [{name: _said(value) for name, value in row.items()} for row in compared.rows]
    head = {"format": FORMAT, "environment": compared.environment, "scenes": scenes, "rows": rows}
    text = json.dumps(head, indent=1, allow_nan=False)
    # Last: what it names is there.
    _replaced(folder / NAME, lambda path: path.write_text(text, encoding="utf-8"))


def _said(value):
    """JSON has no numbers that are not finite: they are said as text."""
    if isinstance(value, dict):
        return {name: _said(each) for name, each in value.items()}
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def _write(path, arrays):
    with open(path, "wb") as file:
        np.savez_compressed(file, **arrays)


def _replaced(path, write):
    """Written aside, so that an interruption leaves the old one."""
    aside = path.with_name(f"new-{path.name}")
    write(aside)
    os.replace(aside, path)


def load(folder):
    folder = Path(_check.path(folder))
    if not holds(folder):
        raise ParameterError(f"{str(folder)!r} holds no comparison: {NAME} is missing")
    try:
        return _loaded(folder, json.loads((folder / NAME).read_text(encoding="utf-8")))
    except ParameterError:
        raise
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as e:  # whichever notices first
        raise ParameterError(f"{str(folder)!r} is damaged: {type(e).__name__}: {e}") from e


def _loaded(folder, head):
    from .comparison import Comparison  # which saves itself by this

    if head.get("format") != FORMAT:
        raise ParameterError(f"{str(folder / NAME)!r} is of format {head.get('format')!r}: this reads {FORMAT!r}")
    rows = [
        {name: value if name in TEXTS or not isinstance(value, str) else float(value) for name, value in row.items()}
        for row in head["rows"]
    ]
    scenes = {scene["name"] for scene in head["scenes"]}
    for row in rows:
        if row["scene"] not in scenes or set(row) != set(COLUMNS):
            raise ValueError(f"the row of {row['label']} on {row['scene']} has other columns, or no images")
    compared = Comparison(rows, head["environment"])
    for i, scene in enumerate(head["scenes"]):
        name, arrays = scene["name"], archive.read_npz(folder / f"images-{i}.npz")
        compared.references[name] = arrays["reference"]
        compared.exact[name] = Frame.load(folder / f"exact-{i}.npz")
        compared.rendered |= {(name, *key): arrays[str(place)] for place, key in enumerate(scene["images"])}
        compared.asked[name] = scene.get("asked", {})
    return compared
