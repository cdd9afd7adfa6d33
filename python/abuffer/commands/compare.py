"""`abuffer compare`."""

import math
import sys
from pathlib import Path

import abuffer as ab

from .. import _check
from .._methods import METHODS
from ..comparing import measuring, store
from ..comparing.entries import OWN
from ..extras import needed
from .arguments import SCENES, SUITES, add_models, add_size, numbers, scenes_of
from .progress import status, steps

DPI = 110  # of the plot


def add(commands):
    compare = commands.add_parser(
        "compare",
        help="measure what methods cost on scenes, and how far off their images are",
        description="Measures methods, and writes report.html, plot.png and all that was measured into a folder.",
    )
    compare.set_defaults(run=_run)
    add = compare.add_argument
    add(
        "scenes",
        nargs="+",
        metavar="MODEL_OR_SUITE",
        help=f"PLY, OBJ, STL, OFF, GLB or glTF file, a suite ({', '.join(SUITES)}) or a standard scene ({', '.join(SCENES)})",
    )
    add("-o", "--output", required=True, metavar="FOLDER", help="made if it is not there")
    add(
        "--methods",
        nargs="+",
        metavar="METHOD",
        help="after the scenes: see `abuffer methods`; wboit@hardware is on another pipeline than tiles, mlab:k=8 with a "
        "parameter, and a comma goes before the next one (default: every method, on every pipeline of the device)",
    )
    add(
        "--sweep",
        action="append",
        default=[],
        metavar="METHOD:PARAMETER=VALUES",
        help="mlab:k=2,4,8,16: a row for each value, beside --methods or without them beside all other methods; may be given "
        "several times, and of two parameters of one method all combinations are compared",
    )
    add(
        "--device",
        action="append",
        dest="devices",
        metavar="DEVICE",
        help="cpu, gpu (the best adapter), part of a name that `abuffer devices` prints, or auto (default); may be given "
        "several times",
    )
    add_size(compare)
    add(
        "--background",
        metavar="COLOR",
        help="grey, r,g,b or r,g,b,a, 0 to 1, behind models from files (default: transparent)",
    )
    add("--repeats", type=int, metavar="N", help="frames that are timed (default: 30 on a real GPU, 5 on others)")
    add("--resume", action="store_true", help="leave what the folder holds as it is, and measure the rest")
    add_models(compare)


def _run(given):
    methods = None if given.methods is None else [_method(text) for text in given.methods]
    sweep = _sweeps(given.sweep)
    background = None if given.background is None else numbers("--background", given.background)
    scenes = {}
    for word in given.scenes:
        for name, scene in scenes_of(word, given, SUITES).items():
            if name in scenes:
                raise ab.ParameterError(f"there are two scenes named {name}: leave one out, or rename a file")
            scenes[name] = scene
    folder = Path(_check.path(given.output))
    for device in given.devices or ():
        measuring.device_name(device)  # which is wrong before a folder is full
    if store.holds(folder) and not given.resume:
        raise ab.ParameterError(
            f"{given.output!r} holds a comparison already: --resume goes on with it, else name another folder"
        )
    for package in ("matplotlib.figure", "jinja2"):  # which nothing needs before the end
        needed(package, "compare")
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with steps() as step:
            compared = ab.compare(
                scenes,
                width=given.width,
                height=given.height,
                methods=methods,
                sweep=sweep,
                devices=given.devices,
                repeats=given.repeats,
                background=background,
                save=folder,
                resume=given.resume,
                progress=step,
            )
        with status("writing the report"):
            compared.plot().savefig(folder / "plot.png", dpi=DPI)
            compared.report(folder / "report.html")
    except KeyboardInterrupt:
        kept = f"finished scenes are in {given.output!r}" if store.holds(folder) else "no scene was finished"
        print(f"abuffer: stopped: {kept}; the same command with --resume goes on from there", file=sys.stderr)
        raise
    print(_table(compared))
    print(folder / "report.html")


def _method(text) -> dict:
    """ "mlab:k=8,…" as an entry of `ab.compare`'s methods."""
    name, colon, rest = text.partition(":")
    pairs = [pair.partition("=") for pair in _parts(rest)] if colon else []
    names = [parameter for parameter, *_ in pairs]
    if not all(map(all, pairs)) or len(set(names)) < len(names) or set(names) & set(OWN):
        raise ab.ParameterError(f"--methods gives each parameter once, as in mlab:k=8, got {text!r}")
    return {"method": name} | {parameter: _value(name, parameter, value) for parameter, _, value in pairs}


def _parts(text) -> list:
    """What commas part, but for those in parentheses: a weight may be clamp(1/z, 0.1, 10)."""
    parts, depth = [""], 0
    for letter in text:
        depth += (letter == "(") - (letter == ")")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return parts


def _sweeps(texts) -> dict:
    """ "mlab:k=2,4,8", … as `ab.compare`'s sweep."""
    found = {}
    for text in texts:
        name, _, rest = text.partition(":")
        parameter, _, values = rest.partition("=")
        if not (name and parameter and values):
            raise ab.ParameterError(f"--sweep must be as in mlab:k=2,4,8, got {text!r}")
        own = found.setdefault(name, {}).setdefault(parameter, [])
        own += [_value(name, parameter, value) for value in _parts(values)]
    return found


def _value(name, parameter, text):
    """What `text` means as that parameter: text where that takes text, else True, False or a number where it is one."""
    method = METHODS.get(name.partition("@")[0])
    defaults = {each.name: each.default for each in method.parameters} if method else {}
    if isinstance(defaults.get(parameter), str):
        return text
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    for number in (int, float):
        try:
            return number(text)
        except ValueError:
            pass
    return text


def _table(compared) -> str:
    """A line for each row, in columns."""
    time = compared.time_column()
    head = [
        "scene",
        "method",
        "device",
        f"{'GPU' if time == 'gpu_ms' else 'wall'} ms",
        "RMSE",
        "largest",
        "bytes/pixel",
    ]
    lines = [head, *(_cells(row, time) for row in compared.rows)]
    widths = [max(len(line[i]) for line in lines if len(line) == len(head)) for i in range(len(head))]
    return "\n".join(
        "  ".join(
            # Names to the left, numbers to the right; why a row failed takes the place of its numbers.
            cell.ljust(width) if i < 3 or len(line) < len(head) else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=False))
        ).rstrip()
        for line in lines
    )


def _cells(row, time):
    names = [row["scene"], row["label"], row["device"]]
    if row["failure"]:
        return [*names, row["failure"]]
    bytes = row["bytes_per_pixel"]
    return [
        *names,
        f"{row[time]:.2f}",
        f"{row['rmse']:.3g}",
        f"{row['max_abs']:.3g}",
        "" if math.isnan(bytes) else f"{bytes:.0f}",
    ]
