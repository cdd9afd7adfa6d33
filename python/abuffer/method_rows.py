"""The table of methods: a row each."""

from . import painter
from .method import FLAGS, Method, Parameter


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
