"""What is compared: a method with its parameters, on a pipeline."""

import itertools
import json
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from .. import _check, _methods
from .._methods import METHODS
from ..errors import ParameterError
from ..options import EXACT_OPTIONS, OPTIONS

# Of a dict, what is no parameter.
OWN = ("method", "pipeline", "label")
# What the report calls what methods are compared with.
REFERENCE = "reference"


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
    sweep = sweep or {}
    found = [_entry(given) for given in (_all(is_gpu, sweep) if methods is None else methods)]
    for name, values in sweep.items():
        found += _swept(name, values)
    if not found:
        raise ParameterError("methods is empty: give at least one, or None for all")
    labels = [entry.label for entry in found]
    twice = sorted({label for label in labels if labels.count(label) > 1})
    if twice:
        raise ParameterError(f"{', '.join(twice)}: compared twice; give dicts with a label of their own each")
    return found


def listed(methods, sweep):
    """`methods` and `sweep` with a list for all that can be iterated, since it may be so but once.

    Raises:
        ParameterError: something is no list, or one of a sweep is empty.
    """
    if methods is not None:
        methods = as_list("methods", methods)
    if sweep is None:
        return methods, {}
    if not isinstance(sweep, dict):
        raise ParameterError(f"sweep must be a dict such as {{'mlab': {{'k': [2, 4, 8]}}}}, got {sweep!r}")
    lists = {}
    for name, values in sweep.items():
        if not isinstance(values, dict) or not values:
            raise ParameterError(f"sweep[{name!r}] must be a dict of parameters and their values, got {values!r}")
        lists[name] = {each: as_list(f"sweep[{name!r}][{each!r}]", of) for each, of in values.items()}
        if not all(lists[name].values()):
            raise ParameterError(f"sweep[{name!r}] has no values: give at least one of each parameter, got {values!r}")
    return methods, lists


def as_list(what, values) -> list:
    if isinstance(values, str | dict) or not isinstance(values, Iterable):
        raise ParameterError(f"{what} must be a list, got {values!r}: give [{values!r}]")
    return list(values)


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
    if "@" in str(given["method"]) and given.get("pipeline", pipeline) != pipeline:
        raise ParameterError(f"{given['method']!r} and pipeline {given['pipeline']!r} are two: give one of them")
    pipeline = given.get("pipeline", pipeline)
    parameters = {name: value for name, value in given.items() if name not in OWN}
    return _made(given.get("label"), id, pipeline, parameters)


def _split(name):
    id, at, pipeline = str(name).partition("@")
    return id, pipeline if at else "tiles"


def _label(id, pipeline, parameters):
    where = "" if pipeline == "tiles" else f"@{pipeline}"
    return " ".join([id + where, *(f"{name}={value}" for name, value in parameters.items())])


def _swept(name, values):
    id, pipeline = _split(name)
    for combination in itertools.product(*values.values()):
        parameters = dict(zip(values, combination, strict=True))
        yield _made(None, id, pipeline, parameters, curve=name)


def _made(label, id, pipeline, parameters, curve=None) -> Entry:
    """An Entry whose method, pipeline and parameters there are; these as JSON has them. label None: by them."""
    method = chosen_of(id, parameters).method
    _check.choice(f"pipeline of {id}", pipeline, method.pipelines)
    try:
        parameters = json.loads(json.dumps(parameters, default=_plain))
    except TypeError as e:
        raise ParameterError(f"parameters of {id} must be numbers or text, got {parameters!r}") from e
    label = _label(id, pipeline, parameters) if label is None else label
    check_label(label)
    return Entry(label, id, pipeline, parameters, curve)


def chosen_of(id, parameters):
    """A method with its parameters, checked."""
    others = EXACT_OPTIONS if id == "exact" else OPTIONS
    return _methods.chosen(id, parameters, others, "compare", ())


def check_label(label):
    if not isinstance(label, str) or not label or label == REFERENCE:
        raise ParameterError(f"a label must be text other than {REFERENCE!r}, got {label!r}")


def _plain(value):
    """A number or an array of numpy, for JSON."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError
