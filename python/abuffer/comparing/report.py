"""A comparison as one page of HTML, which loads nothing. Needs jinja2 and matplotlib."""

import base64
import io
import json
import math
import zlib
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .. import _check, _core
from ..blend import BLENDS
from ..errors import ParameterError
from ..extras import needed
from . import plots

PAGE = Path(__file__).with_name("page")
# In the order in which they are read; together they are one module.
SCRIPTS = ("numbers.js", "data.js", "table.js", "viewer.js", "pointer.js", "inspector.js", "page.js")
# Lists of a scene with more fragments are left out.
MOST_FRAGMENTS = 500_000
# Characters of a page; lists and float32 values beyond are left out, images never.
MOST_CHARACTERS = 28_000_000
# Inches of the plot, as wide as a page.
PLOT = (9.0, 5.4)
# int16 of differences: the largest is this, and what is no number is NOT_FINITE.
LARGEST, NOT_FINITE = 32767, -32768


class Column(NamedTuple):
    """A column of the table: of rows, times `factor`."""

    name: str
    title: str
    unit: str
    meaning: str
    factor: float = 1
    more: bool = False  # shown with "all columns"


COLUMNS = (
    Column("gpu_ms", "GPU time", "ms", "median time of a frame on the GPU"),
    Column("gpu_ms_q1", "GPU time, q1", "ms", "quartile of GPU time", more=True),
    Column("gpu_ms_q3", "GPU time, q3", "ms", "quartile of GPU time", more=True),
    Column("wall_ms", "wall time", "ms", "median time of a frame, by the clock, with what the host does"),
    Column("wall_ms_q1", "wall time, q1", "ms", "quartile of wall time", more=True),
    Column("wall_ms_q3", "wall time, q3", "ms", "quartile of wall time", more=True),
    Column("bytes_per_pixel", "memory", "B/px", "bytes a pixel that the published form keeps"),
    Column("passes", "passes", "", "over the geometry"),
    Column("rmse", "RMSE", "", "root of the mean square error of RGB"),
    Column("rmse_relative", "relative RMSE", "", "RMSE of errors divided by the reference + 0.01", more=True),
    Column("max_abs", "max |Δ|", "", "largest error of a channel"),
    Column("p999", "p99.9 |Δ|", "", "error that 99.9 % of channels stay within"),
    Column("over_1_255", "> 1/255", "%", "pixels that are off by more than a step of 8 bits", 100),
    Column("over_1e5", "> 1e-5", "%", "pixels that are off by more than roundings of float32", 100, more=True),
    Column("psnr", "PSNR", "dB", "of RGB"),
    Column("psnr_covered", "PSNR, covered", "dB", "of pixels that have fragments", more=True),
    Column("ssim", "SSIM", "", "structural similarity, 1 of equal images"),
    Column("flip", "FLIP", "", "mean of ꟻLIP, 0 of equal images; cut to 1 where the reference does not exceed it"),
    Column("alpha_rmse", "RMSE of α", "", "root of the mean square error of alpha"),
    Column(
        "error_bound",
        "bound",
        "",
        "what a channel is proven to be off by at most beside the same fragments, exactly composited",
    ),
    Column("nonfinite", "not finite", "", "values of the image that are no numbers", more=True),
    Column("merged", "merged", "", "fragments merged with others", more=True),
    Column("dropped", "dropped", "", "fragments dropped", more=True),
    Column("deterministic", "same bits", "", "whether frames of the same scene were the same to the bit"),
)


def report(compared, path, srgb):
    """What `Comparison.report` writes."""
    jinja2 = needed("jinja2", "report")
    if not compared.rows:
        raise ParameterError("there is nothing to report: the comparison has no rows")
    path = Path(_check.path(path))
    cells = {f"{s}-{d}": (scene, device) for s, d, scene, device in _cells(compared)}
    scenes = [_scene(compared, scene, srgb) for scene in compared.scenes]
    images = {id: _images(compared, *cell, srgb) for id, cell in cells.items()}
    _add_what_fits(compared, scenes, images, cells)
    data = {f"scene-{i}": scene for i, scene in enumerate(scenes)}
    # In pairs: JavaScript's objects have names of their own, and put numbers first.
    pairs = {id: list(own.items()) for id, own in images.items()}
    data |= {f"cell-{id}": {"rows": _rows(compared, *cell), "images": pairs[id]} for id, cell in cells.items()}
    names = [{"id": id, "scene": scene, "device": device} for id, (scene, device) in cells.items()]
    data["page"] = {"columns": [column.name for column in COLUMNS], "cells": names, "srgb": srgb}
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(PAGE), autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True
    )
    environment.policies["json.dumps_kwargs"] = {"sort_keys": False}  # rows and images are in order
    text = environment.get_template("report.html.j2").render(
        environment=compared.environment,
        columns=COLUMNS,
        srgb=srgb,
        scenes=compared.scenes,
        references={scene: compared.asked.get(scene, {}).get("reference", "") for scene in compared.scenes},
        data=data,
        plots={id: _plot(compared, *cell) for id, cell in cells.items()},
        style=_source("report.css"),
        script="\n".join(map(_source, SCRIPTS)),
    )
    path.write_text(text, encoding="utf-8")


def _source(name):
    return (PAGE / name).read_text(encoding="utf-8")


def _cells(compared):
    """(scene's number, device's number, scene, device) of what was measured."""
    for s, scene in enumerate(compared.scenes):
        for d, device in enumerate(compared.devices):
            if (scene, device) in compared.cells:
                yield s, d, scene, device


def _rows(compared, scene, device):
    best = compared.pareto(scene=scene, device=device)
    return [
        {
            "label": row["label"],
            "failure": row["failure"],
            "undominated": row in best,
            "values": [_number(row[column.name], column.factor) for column in COLUMNS],
        }
        for row in compared.select(scene=scene, device=device)
    ]


def _number(value, factor):
    """For JavaScript's Number: JSON has no name for what is not finite."""
    value = float("nan") if value is None else value * factor
    if math.isfinite(value):
        return value
    return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"


def _plot(compared, scene, device):
    """The SVG alone, without what XML puts before it; its text is text."""
    matplotlib = needed("matplotlib", "report")
    file = io.StringIO()
    nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    # The salt makes ids the same each time.
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "abuffer"}):
        figure = plots.plot(compared, None, "rmse", scene, device, panel=PLOT)
        figure.savefig(file, format="svg", transparent=True, metadata=nothing)
    svg = file.getvalue()
    return svg[svg.index("<svg") :]


# ---- images ----


def _scene(compared, scene, srgb):
    reference = compared.references[scene]
    height, width = reference.shape[:2]
    return {"height": height, "width": width, "png": _png(reference, srgb), "values": None, "lists": None, "why": {}}


def _images(compared, scene, device, srgb):
    """Of each row that has one."""
    if all(row["failure"] for row in compared.select(scene=scene, device=device)):
        return {}
    return {
        label: {"png": _png(image, srgb), "difference": _difference(image, compared.references[scene]), "values": None}
        for label, image in compared.images_of(scene, device).items()
    }


def _png(image, srgb):
    """(H, W, 4) premultiplied, over black, cut to [0, 1]."""
    opaque = np.full((*image.shape[:2], 4), 255, np.uint8)
    opaque[..., :3] = np.rint(plots.shown(image, srgb) * 255)
    return _base64(_core.encode_png(opaque))


def _difference(image, reference):
    """Of each pixel that of the channel that is most off, in steps of the largest there is."""
    off = plots.signed(image, reference)
    finite = off.compressed()
    step = float(np.abs(finite).max(initial=0)) / LARGEST
    steps = np.full(off.shape, NOT_FINITE, "<i2")
    steps[~np.ma.getmaskarray(off)] = np.rint(finite / step) if step else 0
    return {"step": step, "steps": _packed(steps)}


def _packed(array):
    return _base64(zlib.compress(array.tobytes(), 6))


def _base64(data):
    return base64.b64encode(data).decode("ascii")


# ---- what there is room for ----


def _add_what_fits(compared, scenes, images, cells):
    """Adds lists, then float32 values, of one scene after the other, while the page stays within MOST_CHARACTERS."""
    used = len(json.dumps([scenes, images]))
    for scene, name in zip(scenes, compared.scenes, strict=True):
        lists, why = _lists(compared.exact[name])
        if lists is not None and used + len(json.dumps(lists)) > MOST_CHARACTERS:
            lists, why = None, f"the page would be longer than {MOST_CHARACTERS:,} characters"
        scene["lists"], scene["why"]["lists"] = lists, why
        used += len(json.dumps(lists))
    for scene, name in zip(scenes, compared.scenes, strict=True):
        values = _packed(compared.references[name].astype("<f4"))
        own = [
            (id, label, image)
            for id, cell in cells.items()
            if cell[0] == name
            for label, image in _floats(compared, images[id], *cell)
        ]
        length = len(values) + sum(len(image) for *_, image in own)
        if used + length > MOST_CHARACTERS:
            scene["why"]["values"] = f"the page would be longer than {MOST_CHARACTERS:,} characters"
            continue
        used += length
        scene["values"] = values
        for id, label, image in own:
            images[id][label]["values"] = image


def _floats(compared, shown, scene, device):
    """(label, packed image) of those shown."""
    if not shown:
        return []
    return [(label, _packed(image.astype("<f4"))) for label, image in compared.images_of(scene, device).items()]


def _lists(frame):
    """Arrays of all lists of a scene, and why there are none."""
    frags = frame.fragments
    if frags is None:
        return None, f"the comparison kept no lists: {frame.stats.fragments:,} fragments were too many"
    if len(frags) > MOST_FRAGMENTS:
        return None, f"{len(frags):,} fragments are more than the {MOST_FRAGMENTS:,} that a page has room for"
    return {
        "counts": _packed(frags.counts.astype("<u4")),
        "depth": _packed(frags.depth.astype("<f4")),
        "color": _packed(frags.color.astype("<f4")),
        "primitive": _packed(frags.primitive.astype("<i4")),
        "background": _packed(frags.background.astype("<f4")),
        "blend": None if frags.blend is None else _packed(frags.blend),
        "blends": [*BLENDS, *(blend.name or "own" for blend in frags.blends)],
    }, ""
