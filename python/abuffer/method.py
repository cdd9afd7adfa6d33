"""What the table of methods is made of: parameters, and rows."""

from collections.abc import Callable
from dataclasses import dataclass

from . import _check
from .errors import ParameterError

# What holds for a method's image, or does not: tests show both.
FLAGS = {
    "single": "one fragment is composited exactly",
    "equal_colors": "fragments of one colour, the alphas whatever they are, are composited exactly",
    "noop_alpha0": "fragments of alpha 0 change nothing",
    "opaque_front": "nothing shows from behind a nearest fragment of alpha 1",
    "exact_coverage": "alpha is 1 − Π (1 − αᵢ)",
    "order_free": "the order of submission changes nothing but roundings",
    "hull": "each channel lies between the least and the greatest of the fragments' and the background's",
    "modes": "the five blend modes are taken, not over alone",
}


@dataclass(frozen=True)
class Parameter:
    """A parameter of methods: one of `choices`, True or False, or a number from `low` to `high`."""

    name: str
    default: object
    about: str
    choices: tuple = ()
    low: float = 0
    high: float = float("inf")
    is_integer: bool = True

    def checked(self, value):
        if self.choices:
            return _check.choice(self.name, value, self.choices)
        if isinstance(self.default, bool):
            return _check.flag(self.name, value)
        number = _check.number(self.name, value, self.low, self.high)
        if self.is_integer and number != int(number):
            raise ParameterError(f"{self.name} must be an integer from {self.low} to {self.high}, got {value!r}")
        return int(number) if self.is_integer else number

    def examples(self) -> tuple:
        """Some of its values."""
        if self.choices:
            return self.choices
        if isinstance(self.default, bool):
            return False, True
        values = {self.low, self.default // 2, self.default, self.default * 2, self.high}
        return tuple(sorted(value for value in values if self.low <= value <= self.high and value < float("inf")))

    def __str__(self):
        if self.choices:
            return f"{self.name}={self.default!r} of {', '.join(map(repr, self.choices))}"
        range_of = "" if isinstance(self.default, bool) else f" from {self.low:g} to {self.high:g}"
        return f"{self.name}={self.default!r}{range_of}"


@dataclass(frozen=True)
class Method:
    """A row.

    Attributes:
        source: authors, year and venue.
        order: "front_to_back", "submission", or "any": the order in which fragments are composited.
        passes: over the geometry, from the parameters.
        bytes_per_pixel: what the published form keeps, from the parameters: a number, or text where that depends on
            the scene.
        exact_when: where its image is that of `exact`.
        flags: names of FLAGS.
        takes_range: depths are normalised by a `depth_range`.
        is_native: it also runs as `pipeline="hardware"`, in the form that it was published in.
        conflict: of all parameters: what is wrong with them together, or None.
        sorts: "objects" or "triangles", which are painted in the order of a depth (painter.py).
        wgsl, numpy, loops: of a method that was registered (own_methods.py).
    """

    id: str
    title: str
    source: str
    order: str
    passes: Callable
    bytes_per_pixel: Callable
    exact_when: str
    flags: frozenset
    parameters: tuple = ()
    deterministic: str = "yes"
    takes_range: bool = False
    is_native: bool = False
    conflict: Callable | None = None
    sorts: str | None = None
    wgsl: str | None = None
    numpy: Callable | None = None
    loops: int | None = 0

    def checked(self, given) -> dict:
        """All parameters: those `given`, the others' defaults."""
        parameters = {p.name: p.checked(given.get(p.name, p.default)) for p in self.parameters}
        conflict = self.conflict and self.conflict(**parameters)
        if conflict:
            raise ParameterError(conflict)
        return parameters

    @property
    def options(self) -> tuple:
        """Names of all that may be given."""
        return (*(p.name for p in self.parameters), *(("depth_range",) if self.takes_range else ()))

    @property
    def pipelines(self) -> tuple:
        """Those that have it, on one device or another."""
        if self.id == "exact":
            return "tiles", "linked_list", "prefix_sum"
        return ("tiles", "hardware") if self.is_native else ("tiles",)

    def by_parameters(self, cost) -> str:
        """A cost with the defaults, and where a parameter changes it, with some of its values."""
        defaults = self.checked({})
        usual = cost(**defaults)
        text = [str(usual)]
        for parameter in self.parameters:
            costs = {value: cost(**defaults | {parameter.name: value}) for value in parameter.examples()}
            text += [f"{other} with {parameter.name}={value!r}" for value, other in costs.items() if other != usual]
        return "; ".join(text)

    def row(self) -> dict:
        return {
            "title": self.title,
            "order": self.order,
            "passes": self.by_parameters(self.passes),
            "bytes per pixel": self.by_parameters(self.bytes_per_pixel),
            "parameters": "; ".join(map(str, self.parameters)) or "none",
            "exact": self.exact_when,
            "pipelines": ", ".join(self.pipelines),
            "deterministic": self.deterministic,
            "source": self.source,
        }
