"""The table of methods, and what is chosen from it.

Argument checks, `abuffer.methods()`, the documentation and the tests of invariants walk the same rows.
"""

import re
from dataclasses import dataclass, field

from . import _check, own_weight
from .blend import BLENDS
from .errors import ParameterError
from .method import Method
from .method_rows import ALL, WEIGHTS

OPERATOR = re.compile(r"[-+*/(.]|z|alpha")  # of an expression; a misspelt choice has none
METHODS = {method.id: method for method in ALL}  # and those that are registered


def parameters() -> tuple:
    """Names of all options that are some method's."""
    return tuple(dict.fromkeys(name for method in METHODS.values() for name in method.options))


@dataclass(frozen=True)
class Chosen:
    """A method with its parameters, checked."""

    method: Method
    parameters: dict
    depth_range: tuple | None = field(default=None)

    def refuse_modes(self, modes):
        """Raises a ParameterError if the method does not take one of some modes other than over, or Blends by any name."""
        for mode in modes:
            if "modes" not in self.method.flags:
                able = [method.id for method in METHODS.values() if "modes" in method.flags]
                raise ParameterError(
                    f'method {self.method.id!r} is for blend="over" alone, and there is {mode!r}: '
                    f"those that take modes are {', '.join(able)}"
                )
            if mode not in BLENDS and self.method.id != "exact":
                raise ParameterError(
                    f"method {self.method.id!r} takes the modes {', '.join(BLENDS)}, and there is {mode!r}: "
                    "Blends are for method 'exact' alone"
                )

    def require(self, pipeline, samples, modes):
        """Raises a ParameterError if a pipeline does not have the method, or not for so many samples or these modes."""
        method = self.method
        if pipeline not in method.pipelines:
            have = " or ".join(f'pipeline="{name}"' for name in method.pipelines)
            raise ParameterError(f"pipeline {pipeline!r} does not have method {method.id!r}: give {have}")
        if pipeline == "hardware" and samples != 1:
            raise ParameterError(f'pipeline "hardware" has 1 sample a pixel, got {samples}: give pipeline="tiles"')
        if pipeline == "hardware" and self.parameters.get("bits", 32) != 32:
            raise ParameterError(
                f'pipeline "hardware" adds to moments, and bits={self.parameters["bits"]} rounds what is there at each: '
                'give pipeline="tiles"'
            )
        if pipeline == "hardware" and len(modes):
            raise ParameterError(
                f'pipeline "hardware" is for blend="over" alone, and there is {modes[0]!r}: give pipeline="tiles"'
            )

    def parts(self, nearest=None, farthest=None) -> dict:
        """As the core takes it. The depths are those of what is rendered, where none were given."""
        depths = self.depth_range or (nearest, farthest)
        own = dict(zip(("nearest", "farthest"), depths, strict=True)) if self.method.takes_range else {}
        # What is sorted before it is submitted needs no more of the core.
        id = "unsorted" if self.method.sorts else self.method.id
        return {"method": id, "parameters": self.parameters | own, "own": self._own()}

    def _own(self):
        """What a GPU runs of a method that was registered."""
        method = self.method
        if method.wgsl is None:
            return None
        passes = method.passes(**self.parameters)
        return {"wgsl": method.wgsl, "constants": self.constants(), "passes": passes, "loops": method.loops}

    def constants(self) -> str:
        """The parameters as WGSL: integers are u32, choices their place among all."""
        text = ""
        for parameter in self.method.parameters:
            value = self.parameters[parameter.name]
            if parameter.choices:
                said = f"{parameter.choices.index(value)}u"
            elif isinstance(value, bool):
                said = str(value).lower()
            else:
                said = f"{value}u" if parameter.is_integer else repr(float(value))
            text += f"const {parameter.name.upper()} = {said};\n"
        return text


EXACT = Chosen(METHODS["exact"], {})


def chosen(name, options, others, function, arguments) -> Chosen:
    """The method `name` with those of `options` that are its own.

    Args:
        others: options that are no method's.
        function, arguments: what is called, and the names of its own arguments.

    Raises:
        ParameterError: an unknown method, an option that neither it nor `others` have, or a value out of range.
    """
    _check.choice("method", name, METHODS)
    method = METHODS[name]
    for option in options:
        if option in parameters() and option not in (*method.options, *others):
            have = [other.id for other in METHODS.values() if option in other.options]
            raise ParameterError(
                f"{option} is no parameter of method {name!r}, which has {', '.join(method.options) or 'none'}; "
                f"it is one of {', '.join(have)}"
            )
    _check.arguments(function, options, (*method.options, *others), f"method {name!r}", arguments)
    weight = options.get("weight")
    if name == "wboit" and isinstance(weight, str) and weight not in WEIGHTS and OPERATOR.search(weight):
        method = own_weight.weighted(method, weight)
        options = {option: value for option, value in options.items() if option != "weight"}
    depth_range = options.get("depth_range")
    return Chosen(method, method.checked(options), None if depth_range is None else _depths(depth_range))


def _depths(value):
    try:
        nearest, farthest = value
    except (TypeError, ValueError):
        raise ParameterError(f"depth_range must be two depths, nearest and farthest, got {value!r}") from None
    limits = -_check.FLOAT32_MAX, _check.FLOAT32_MAX  # most renders compute in it
    nearest, farthest = (_check.number(f"depth_range[{i}]", end, *limits) for i, end in enumerate((nearest, farthest)))
    if not nearest <= farthest:
        raise ParameterError(f"depth_range must rise, got {value!r}")
    if farthest - nearest > _check.FLOAT32_MAX:
        raise ParameterError(
            f"depth_range must span at most {_check.FLOAT32_MAX:.4g}, float32's largest, got {value!r}"
        )
    return nearest, farthest
