"""The table of methods: what each is, what it is given, what it costs, and what can be relied on.

Argument checks, `abuffer.methods()`, the documentation and the tests of invariants walk the same rows.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, field

from . import _check, own_weight, painter
from .blend import BLENDS
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


def _painted(id, what, source):
    return Method(
        id=id,
        title=f"{what} are painted, the farthest first",
        source=source,
        order="submission",
        passes=lambda key: 1,
        bytes_per_pixel=lambda key: 0,
        exact_when=f"{what} do not cross, nor overlap in a cycle or against their depths",
        # Those of unsorted: there is an order, if a better one.
        flags=_flags("single", "equal_colors", "noop_alpha0", "exact_coverage", "hull", "modes"),
        parameters=(
            Parameter("key", "centroid", f"the depth that {what} go by: their middle's, or a vertex's", painter.KEYS),
        ),
        sorts=what,
        is_native=True,
    )


def _k(default, about):
    return Parameter("k", default, about, low=1, high=64)


def _flags(*names):
    assert set(names) <= set(FLAGS), names
    return frozenset(names)


def _bits_of_others(moments, trigonometric, beta, bits):
    if bits == 16 and (moments != 4 or trigonometric):
        kind = "trigonometric" if trigonometric else "power"
        return f"bits=16 exists for 4 power moments, and there are {moments} {kind} ones: leave bits out, or give moments=4"
    return None


WEIGHTS = ("7", "8", "9", "10", "none")
OPERATOR = re.compile(r"[-+*/(.]|z|alpha")  # of an expression; a misspelt choice has none

ALL = (
    Method(
        id="exact",
        title="every fragment, sorted and composited",
        source="Porter and Duff 1984, SIGGRAPH; Carpenter 1984, SIGGRAPH; Yang et al. 2010, EGSR",
        order="front_to_back",
        passes=lambda: 1,
        bytes_per_pixel=lambda: "4 + 16 a fragment as linked lists, 0 in tiles",
        exact_when="always",
        flags=_flags(*FLAGS),
    ),
    Method(
        id="additive",
        title="the sum of all, as if they only emitted light",
        source="Porter and Duff 1984, SIGGRAPH, plus",
        order="any",
        passes=lambda: 1,
        bytes_per_pixel=lambda: 16,
        exact_when="no fragment",
        flags=_flags("noop_alpha0", "order_free"),
        is_native=True,
    ),
    Method(
        id="depth_peeling",
        title="a pass for each layer, front to back",
        source="Everitt 2001, NVIDIA",
        order="front_to_back",
        passes=lambda layers: layers or "fragments of the deepest pixel + 1",
        bytes_per_pixel=lambda layers: 24,
        exact_when="always, without a limit of layers",
        flags=_flags(*FLAGS),
        parameters=(
            Parameter("layers", 0, "nearest layers that are peeled, the others being dropped; 0: all", high=1024),
        ),
        is_native=True,
    ),
    Method(
        id="dual_depth_peeling",
        title="a pass for each two layers, from both ends",
        source="Bavoil and Myers 2008, NVIDIA",
        order="front_to_back",
        passes=lambda: "half the fragments of the deepest pixel + 1",
        bytes_per_pixel=lambda: 48,
        exact_when="always",
        flags=_flags(*FLAGS),
        is_native=True,
    ),
    Method(
        id="k_buffer",
        title="the k nearest exactly, the others as a tail",
        source="Bavoil et al. 2007, I3D",
        order="submission",
        passes=lambda k, tail: 2 if tail == "blend" else 1,
        bytes_per_pixel=lambda k, tail: 8 * k + {"drop": 4, "blend": 12, "average": 20}[tail],
        exact_when="at most k fragments in a pixel",
        flags=_flags("single", "opaque_front", "order_free", "hull"),
        parameters=(
            _k(8, "fragments that are kept"),
            Parameter("tail", "drop", "what becomes of the others", ("drop", "blend", "average")),
        ),
    ),
    Method(
        id="phenomenological",
        title="a mean colour weighted by window depth, of surfaces that transmit light",
        source="McGuire and Mara 2016, I3D",
        order="any",
        passes=lambda transmission: 1,
        bytes_per_pixel=lambda transmission: 20,
        exact_when="transmission 0, and one fragment or all colours of a pixel equal",
        flags=_flags("single", "equal_colors", "noop_alpha0", "exact_coverage", "order_free", "hull"),
        parameters=(
            Parameter(
                "transmission",
                0.0,
                "the share of what a fragment covers that comes through it all the same",
                high=1,
                is_integer=False,
            ),
        ),
        takes_range=True,
    ),
    _painted("object_sorted", "objects", "Newell, Newell and Sancha 1972, ACM"),
    _painted("triangle_sorted", "triangles", "Newell, Newell and Sancha 1972, ACM"),
    Method(
        id="unsorted",
        title="composited in the order of submission, whatever the depth",
        source="Porter and Duff 1984, SIGGRAPH",
        order="submission",
        passes=lambda: 1,
        bytes_per_pixel=lambda: 0,
        exact_when="fragments come back to front",
        flags=_flags("single", "equal_colors", "noop_alpha0", "exact_coverage", "hull", "modes"),
        is_native=True,
    ),
    Method(
        id="mlab",
        title="k layers, the farthest two merged on overflow",
        source="Salvi and Vaidyanathan 2014, I3D",
        order="submission",
        passes=lambda k: 1,
        bytes_per_pixel=lambda k: 8 * k,
        exact_when="at most k + 1 fragments in a pixel, or all submitted front to back or back to front",
        flags=_flags("single", "equal_colors", "noop_alpha0", "opaque_front", "exact_coverage", "hull"),
        parameters=(_k(4, "layers"),),
    ),
    Method(
        id="hybrid",
        title="the k nearest exactly, the others as their mean",
        source="Maule et al. 2013, I3D",
        order="submission",
        passes=lambda k, coverage: 1,
        bytes_per_pixel=lambda k, coverage: 8 * k + 20,
        exact_when="at most k + 1 fragments in a pixel",
        flags=_flags("single", "equal_colors", "opaque_front", "exact_coverage", "order_free", "hull"),
        parameters=(
            _k(4, "fragments that are kept"),
            Parameter(
                "coverage",
                "exact",
                'of the others: their own, or "average", as published: that of equal layers',
                ("exact", "average"),
            ),
        ),
    ),
    Method(
        id="adaptive",
        title="weighted by a visibility function of k steps",
        source="Salvi, Montgomery and Lefohn 2011, HPG",
        order="submission",
        passes=lambda k, renormalise: 2,
        bytes_per_pixel=lambda k, renormalise: 8 * k,
        exact_when="at most k fragments in a pixel",
        flags=_flags("single", "equal_colors", "noop_alpha0", "opaque_front", "exact_coverage", "hull"),
        parameters=(
            _k(4, "steps"),
            Parameter("renormalise", True, "weights are scaled to the exact coverage"),
        ),
    ),
    Method(
        id="bucket_peeling",
        title="the nearest of each part of a pixel's depth range",
        source="Liu et al. 2009, HPG",
        order="any",
        passes=lambda buckets: 2,
        bytes_per_pixel=lambda buckets: 8 * buckets + 8,
        exact_when="no two fragments of a pixel in one bucket",
        flags=_flags("single", "opaque_front", "order_free", "hull"),
        parameters=(Parameter("buckets", 32, "equal parts of the range", low=1, high=64),),
    ),
    Method(
        id="stencil_routed",
        title="the first k submitted, sorted",
        source="Myers and Bavoil 2007, SIGGRAPH",
        order="submission",
        passes=lambda k: 1,
        bytes_per_pixel=lambda k: 8 * k,
        exact_when="at most k fragments in a pixel",
        flags=_flags("single", "hull"),
        parameters=(_k(8, "fragments that are kept"),),
    ),
    Method(
        id="weighted_average",
        title="the mean colour, as so many layers of the mean alpha",
        source="Bavoil and Myers 2008, NVIDIA",
        order="any",
        passes=lambda: 1,
        bytes_per_pixel=lambda: 20,
        exact_when="all alphas and all colours of a pixel are equal",
        flags=_flags("single", "order_free", "hull"),
        is_native=True,
    ),
    Method(
        id="weighted_sum",
        title="the sum of all, in front of what their alphas leave of the background",
        source="Meshkin 2007, GDC",
        order="any",
        passes=lambda: 1,
        bytes_per_pixel=lambda: 16,
        exact_when="one fragment, or at first order in alpha",
        flags=_flags("single", "noop_alpha0", "order_free"),
    ),
    Method(
        id="wboit",
        title="a mean colour weighted by depth, with exact coverage",
        source="McGuire and Bavoil 2013, JCGT 2(2)",
        order="any",
        passes=lambda weight: 1,
        bytes_per_pixel=lambda weight: 20,
        exact_when="one fragment, or all colours of a pixel equal",
        flags=_flags("single", "equal_colors", "noop_alpha0", "exact_coverage", "order_free", "hull"),
        parameters=(
            Parameter(
                "weight",
                "7",
                'the equation of the paper that weighs fragments, "none": all alike, or WGSL in z and alpha',
                WEIGHTS,
            ),
        ),
        takes_range=True,
        is_native=True,
    ),
    Method(
        id="wavelet",
        title="a mean colour weighted by the transmittance that Haar wavelets over depth give",
        source="Aizenshtein, Smal and McGuire 2022, arXiv 2201.00094",
        order="any",
        passes=lambda rank: 2,
        # 2 ** (rank + 1) coefficients, then Σ Tαc and Σ Tα.
        bytes_per_pixel=lambda rank: 4 * 2 ** (rank + 1) + 16,
        exact_when="one fragment, or all colours of a pixel equal",
        flags=_flags("single", "equal_colors", "noop_alpha0", "exact_coverage", "order_free", "hull"),
        parameters=(Parameter("rank", 3, "the finest level of wavelets: 2^(rank + 1) coefficients", low=1, high=5),),
        takes_range=True,
    ),
    Method(
        id="fourier",
        title="a mean colour weighted by the transmittance that a Fourier series over depth gives",
        source="Jansen and Bavoil 2010, I3D",
        order="any",
        passes=lambda terms: 2,
        # One coefficient and a pair a term, then Σ Tαc and Σ Tα.
        bytes_per_pixel=lambda terms: 4 * (1 + 2 * terms) + 16,
        exact_when="one fragment, or all colours of a pixel equal",
        flags=_flags("single", "equal_colors", "noop_alpha0", "exact_coverage", "order_free", "hull"),
        parameters=(Parameter("terms", 3, "pairs of a cosine and a sine", low=1, high=16),),
        takes_range=True,
    ),
    Method(
        id="stochastic",
        title="random draws, each of which keeps its nearest fragment",
        source="Enderton et al. 2010, I3D; Laine and Karras 2011, EGSR",
        order="any",
        passes=lambda draws, seed, estimator: 2 if estimator == "c" else 1,
        # A depth and a colour a draw, then the exact transmittance, then Σ Vαc and Σ Vα.
        bytes_per_pixel=lambda draws, seed, estimator: 12 * draws + {"a": 0, "b": 4, "c": 20}[estimator],
        exact_when="alphas are 0 or 1; with estimator a in expectation",
        flags=_flags("noop_alpha0", "opaque_front", "hull"),
        parameters=(
            Parameter("draws", 8, "samples that a fragment covers with probability alpha", low=1, high=64),
            Parameter("seed", 0, "another one draws otherwise", low=0, high=2**32 - 1),
            Parameter(
                "estimator",
                "a",
                "a: the mean of the draws; b: with exact alpha; c: all fragments, by how many draws see them",
                ("a", "b", "c"),
            ),
        ),
        deterministic="yes, by seed",
        is_native=True,
    ),
    Method(
        id="mboit",
        title="a mean colour weighted by a transmittance that moments of absorbance give",
        source="Münstermann, Krumpen, Klein and Peters 2018, I3D",
        order="any",
        passes=lambda moments, trigonometric, beta, bits: 2,
        # The absorbance of all, moments, then Σ Tαc and Σ Tα.
        bytes_per_pixel=lambda moments, trigonometric, beta, bits: 4 + bits // 8 * moments + 16,
        exact_when="beta is 0 and a pixel has at most moments / 2 + 1 depths, spread over the range: up to a bias and roundings "
        "under 5e-5, in float32 too",
        flags=_flags("single", "equal_colors", "noop_alpha0", "exact_coverage", "order_free", "hull"),
        parameters=(
            Parameter("moments", 4, "moments of a pixel; of complex ones, the real and imaginary parts", (4, 6, 8)),
            Parameter("trigonometric", False, "complex moments, half as many, in place of power moments"),
            Parameter(
                "beta",
                0.25,
                "where between its bounds the absorbance in front of a fragment is: from 0, the lower, to 1",
                high=1,
                is_integer=False,
            ),
            Parameter("bits", 32, "of a stored moment; 16: of 4 power moments, rounded at each fragment", (32, 16)),
        ),
        takes_range=True,
        is_native=True,
        conflict=_bits_of_others,
    ),
)
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
