"""What is compared: a method with its parameters, on a pipeline."""

import itertools
from dataclasses import dataclass, field

from .. import _check, _methods
from .._methods import METHODS
from ..errors import ParameterError
from ..options import EXACT_OPTIONS, OPTIONS

# Of a dict, what is no parameter.
OWN = ("method", "pipeline", "label")


@dataclass(frozen=True)
class Entry:
    """A row's method.

    Attributes:
        label: as tables and plots name it.
        parameters: those given; the others are the method's defaults.
        curve: of entries of one sweep, their name, else None.
    """

    label: str
    method: str
    pipeline: str
    parameters: dict = field(default_factory=dict)
    curve: str | None = None


def entries(methods, sweep, is_gpu) -> list:
    """An Entry for each of `methods`, and for all values of `sweep`.

    Args:
        methods: ids, "id@pipeline", or dicts of "method", parameters, and perhaps "pipeline" and "label". None: all, each on
            all pipelines that the device has.
        sweep: {method or "id@pipeline": {parameter: values}}; of several parameters all combinations. A method that is swept
            is not compared beside that with its defaults, unless it is given as well.
        is_gpu: the device is one.

    Raises:
        ParameterError: an unknown method, pipeline or parameter, or two entries of one label.
    """
    sweep = dict(sweep or {})
    found = [_entry(given) for given in (_all(is_gpu, sweep) if methods is None else _listed(methods))]
    for name, values in sweep.items():
        found += _swept(name, values)
    if not found:
        raise ParameterError("methods is empty: give at least one, or None for all")
    labels = [entry.label for entry in found]
    twice = sorted({label for label in labels if labels.count(label) > 1})
    if twice:
        raise ParameterError(f"{', '.join(twice)}: compared twice; give dicts with a label of their own each")
    return found


def _listed(methods):
    if isinstance(methods, str | dict):
        raise ParameterError(f"methods must be a list, got {methods!r}: give [{methods!r}]")
    return methods


def _all(is_gpu, sweep):
    for id, method in METHODS.items():
        for pipeline in method.pipelines if is_gpu else ("tiles",):
            name = id if pipeline == "tiles" else f"{id}@{pipeline}"
            if name not in sweep:
                yield name


def _entry(given):
    if isinstance(given, str):
        given = {"method": given}
    if not isinstance(given, dict) or "method" not in given:
        raise ParameterError(f'an entry of methods must be an id, "id@pipeline" or a dict with "method", got {given!r}')
    id, pipeline = _split(given["method"])
    pipeline = given.get("pipeline", pipeline)
    parameters = {name: value for name, value in given.items() if name not in OWN}
    return _checked(Entry(given.get("label") or _label(id, pipeline, parameters), id, pipeline, parameters))


def _split(name):
    id, _, pipeline = str(name).partition("@")
    return id, pipeline or "tiles"


def _label(id, pipeline, parameters):
    where = "" if pipeline == "tiles" else f"@{pipeline}"
    return " ".join([id + where, *(f"{name}={value}" for name, value in parameters.items())])


def _swept(name, values):
    id, pipeline = _split(name)
    if not isinstance(values, dict) or not values:
        raise ParameterError(f"sweep[{name!r}] must be a dict of parameters and their values, got {values!r}")
    for combination in itertools.product(*values.values()):
        parameters = dict(zip(values, combination, strict=True))
        yield _checked(Entry(_label(id, pipeline, parameters), id, pipeline, parameters, curve=name))


def _checked(entry):
    """The entry, whose method, pipeline and parameters there are."""
    others = EXACT_OPTIONS if entry.method == "exact" else OPTIONS
    chosen = _methods.chosen(entry.method, entry.parameters, others, "compare", ("methods", "sweep"))
    _check.choice(f"pipeline of {entry.method}", entry.pipeline, chosen.method.pipelines)
    return entry
