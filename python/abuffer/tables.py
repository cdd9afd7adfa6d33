"""What there is to choose from: methods, pipelines and devices, as dicts that print as tables."""

import os
import threading
from typing import NamedTuple

from . import _core
from ._methods import METHODS
from .errors import DeviceError, ParameterError
from .measured import faster


class Table(dict):
    """Rows by id: each a dict with the same columns."""

    def __str__(self):
        if not self:
            return "(none)"
        columns = ["id", *next(iter(self.values()))]
        rows = [columns] + [[key, *(str(v) for v in row.values())] for key, row in self.items()]
        widths = [max(len(row[i]) for row in rows) for i in range(len(columns))]
        lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
        return "\n".join([lines[0], "  ".join("-" * width for width in widths), *lines[1:]])

    __repr__ = __str__


PIPELINES = Table(
    {
        "tiles": {
            "runs on": "cpu, gpu",
            "how": "triangles binned to 16×16 tiles, each pixel's fragments sorted in cache",
        },
        "linked_list": {"runs on": "gpu", "how": "hardware rasteriser, a linked list of fragments for each pixel"},
        "prefix_sum": {
            "runs on": "gpu",
            "how": "hardware rasteriser, count, scan, scatter: each pixel's fragments side by side",
        },
        "hardware": {
            "runs on": "gpu",
            "how": "hardware rasteriser, a method as published: blended into targets, or peeled",
        },
    }
)
ON_GPU = tuple(key for key, row in PIPELINES.items() if row["runs on"] == "gpu")  # and nowhere else

_LOCK = threading.Lock()
_found = None, []  # the process that asked, and the adapters that it found


def _adapters():
    """All adapters, best first, as this process found them first.

    Mesa's device-select layer would look for a Wayland display and complain on stderr that there is none. It
    only reorders adapters, which are sorted by kind anyway.
    """
    global _found
    with _LOCK:  # two threads must not take back each other's variable
        process, adapters = _found
        if process != os.getpid():  # a fork has no driver yet
            ours = "NODEVICE_SELECT" not in os.environ
            if ours:
                os.environ["NODEVICE_SELECT"] = "1"
            try:
                adapters = _core.adapters()
            finally:
                if ours:
                    os.environ.pop("NODEVICE_SELECT", None)
            _found = os.getpid(), adapters
        return adapters


def methods() -> Table:
    """The methods, by id: how fragments become a colour, what that takes, and when it is exact.

    Passes and bytes are those of the defaults, and of some other parameters.

    >>> methods()["k_buffer"]["parameters"]
    "k=8 from 1 to 64; tail='drop' of 'drop', 'blend', 'average'"
    """
    return Table({method.id: method.row() for method in METHODS.values()})


def pipelines() -> Table:
    """The pipelines, by id: how triangles become fragments.

    >>> list(pipelines())
    ['tiles', 'linked_list', 'prefix_sum', 'hardware']
    """
    return Table(PIPELINES)


def devices() -> Table:
    """The devices, by name, best first among GPUs. Any part of a name serves as ``device=``.

    >>> "cpu" in devices()
    True
    """
    table = Table({"cpu": {"kind": "processor", "backend": "", "driver": "", "pipelines": "tiles"}})
    for adapter in _adapters():
        name = adapter["name"]
        while name in table:
            name += " (again)"
        runs = f"none: lacks {adapter['lacks']}" if adapter["lacks"] else ", ".join(("tiles", *ON_GPU))
        row = {"kind": adapter["kind"], "backend": adapter["backend"], "driver": adapter["driver"], "pipelines": runs}
        table[name] = row
    return table


def named(device) -> str:
    """The name in `devices()` of what `device=` means."""
    adapter, _ = choose("auto", device, "float32", os.environ.get("ABUFFER_DEVICE"), [])
    return list(devices())[0 if adapter is None else adapter + 1]


class Wants(NamedTuple):
    """What a render asks of a device."""

    samples: int = 1  # a pixel
    numpy: bool = False  # a Blend that has nothing for GPUs
    case: str = "image"  # of measured.CASES
    triangles: int = 0  # of the scene
    nodes: bool = False  # an option of how nodes are stored
    streams: bool = False  # a method that tiles alone have


def choose(pipeline, device, precision, environment, plan, wants=None):
    """The adapter's place in `_core.adapters()`, None for the CPU, and the pipeline; what and why goes into `plan`.

    Args:
        environment: what ABUFFER_DEVICE says "auto" means.
        wants: Wants; "auto" takes a GPU only if it can do all of it.
    """
    wants = wants or Wants()
    if not isinstance(device, str) or not device:
        raise ParameterError(f'device must be "auto", "cpu", "gpu" or a part of a name, got {device!r}')
    if precision == "float64" and device.lower() == "gpu":
        raise ParameterError(FLOAT64)
    adapter, why = _auto(pipeline, precision, environment, wants) if device.lower() == "auto" else _named(device)
    if adapter is None:
        plan.append(("device", "cpu", why))
        if pipeline in ON_GPU:
            raise ParameterError(
                f'pipeline "{pipeline}" needs a GPU: give device="gpu", or pipeline="tiles" on the CPU'
            )
        plan.append(("pipeline", "tiles", "the CPU's" if pipeline == "auto" else "as asked"))
        return None, "tiles"
    if precision == "float64":
        raise ParameterError(FLOAT64)
    found = _adapters()[adapter]
    software = ", a software driver" if found["kind"] == "software" else ""
    plan.append(("device", f"{found['name']}{software}", why))
    if pipeline != "auto":
        reason = "as asked"
    elif wants.streams:
        pipeline, reason = "tiles", "it has every method"
    elif wants.nodes:
        pipeline, reason = "linked_list", "it has nodes to store as the options say"
    else:
        pipeline, reason = faster(found["kind"], wants.case, wants.triangles)
    plan.append(("pipeline", pipeline, reason))
    return adapter, pipeline


FLOAT64 = 'precision "float64" is the CPU\'s: give device="cpu" or "auto"'


def _auto(pipeline, precision, environment, wants):
    """What precision and pipeline leave open, the environment decides; what it leaves open, the hardware."""
    if precision == "float64":
        return None, "float64 is the CPU's"
    environment = environment or "auto"
    if environment.lower() != "auto" and not (environment.lower() == "cpu" and pipeline in ON_GPU):
        try:
            adapter, why = _named(environment)
        except DeviceError as e:
            raise DeviceError(f"ABUFFER_DEVICE is {environment!r}: {e}") from None
        return adapter, f"ABUFFER_DEVICE is {environment!r}: {why}"
    if pipeline in ON_GPU:
        return _named("gpu")
    real = [i for i, a in enumerate(_adapters()) if a["kind"] != "software" and not a["lacks"]]
    # Tiles find samples for themselves.
    enough = [i for i in real if pipeline == "tiles" or wants.streams or wants.samples in _adapters()[i]["samples"]]
    if real and wants.numpy:
        return None, "a Blend or the method has no wgsl for GPUs"
    if enough:
        return enough[0], "the best real GPU"
    if real:
        return None, f"no real GPU here has {wants.samples} samples a pixel"
    software = ", ".join(a["name"] for a in _adapters())
    return None, f"no real GPU here; {software} would run if named" if software else "no GPU here"


def _named(device):
    if device.lower() == "cpu":
        return None, "as asked"
    adapters = _adapters()
    if device.lower() == "gpu":
        if adapters:
            usable = [i for i, a in enumerate(adapters) if not a["lacks"]]
            return (usable or [0])[0], "the best adapter"
        raise DeviceError(
            "no GPU adapter was found by Vulkan, Metal or DX12. Install a driver (on Debian a software one: "
            'apt install mesa-vulkan-drivers libvulkan1), or give device="cpu", which needs nothing'
        )
    for i, adapter in enumerate(adapters):
        if device.lower() in adapter["name"].lower():
            return i, f"its name contains {device!r}"
    names = ["cpu", *(a["name"] for a in adapters)]
    raise DeviceError(
        f'no device\'s name contains {device!r}. There are: {", ".join(names)}; device="cpu" always works'
    )
