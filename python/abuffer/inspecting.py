"""What lists are like: how deep pixels are, and what lies in one."""

from dataclasses import dataclass

import numpy as np

from ._srgb import encode_srgb
from .blend import BLENDS
from .errors import ParameterError
from .extras import needed

# Square boxes behind translucent colours, in shares of a layer's width; on the last ones the colour is opaque.
CHECKS, OPAQUE_CHECKS = 16, 2
# Layers of a plot: of more, the nearest.
MOST_LAYERS = 64


@dataclass(frozen=True, repr=False, eq=False)
class Inspection:
    """Distributions of a frame's lists.

    Attributes:
        counts: (H, W) int32, fragments of each pixel.
        histogram: (deepest + 1,) int64, pixels by their number of fragments.
        fragments: of all pixels.
        deepest: fragments of the deepest pixel.
        deepest_pixel: its (y, x), the first of several.
        covered: the share of pixels that hold fragments.
        mean: fragments of a covered pixel, on average; 0 where none is covered.
        percentiles: {50, 90, 99, 99.9: fragments that so many hundredths of the covered pixels do not exceed}.
    """

    counts: np.ndarray
    histogram: np.ndarray
    fragments: int
    deepest: int
    deepest_pixel: tuple
    covered: float
    mean: float
    percentiles: dict

    def __repr__(self):
        y, x = self.deepest_pixel
        percentiles = ", ".join(f"{p:g} %: {n}" for p, n in self.percentiles.items())
        return (
            f"Inspection({self.fragments:,} fragments in {self.covered:.1%} of the pixels, {self.mean:.1f} each; "
            f"at most {self.deepest}, in pixel y={y}, x={x}; {percentiles} of the covered pixels have no more)"
        )

    def plot(self):
        """A heat map of depth complexity, and its histogram: a matplotlib Figure. Needs matplotlib."""
        figure = _figure((10, 4.2))
        left, right = figure.subplots(1, 2, width_ratios=(1.25, 1))
        shown = np.ma.masked_equal(self.counts, 0)
        image = left.imshow(shown, cmap="viridis", vmin=1, vmax=max(self.deepest, 2), interpolation="nearest")
        left.set(title="fragments of a pixel", xticks=[], yticks=[], facecolor="0.93")
        figure.colorbar(image, ax=left, shrink=0.85).locator = _integers()
        right.xaxis.set_major_locator(_integers())
        right.bar(np.arange(1, len(self.histogram)), self.histogram[1:], width=0.9, color="#6d3fa0")
        right.set(yscale="log", xlabel="fragments", ylabel="pixels", title="depth complexity")
        right.set_ylim(bottom=0.7)
        right.spines[["top", "right"]].set_visible(False)
        return figure

    def _repr_png_(self):
        import io

        file = io.BytesIO()
        self.plot().savefig(file, format="png", dpi=90)
        return file.getvalue()


def inspect(frame) -> Inspection:
    """How deep a frame's pixels are.

    Args:
        frame: a Frame with counts or lists (`fragments="count"` or True), or Fragments.

    Raises:
        ParameterError: it has neither.

    >>> from abuffer import Mesh, render
    >>> triangle = Mesh([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], colors=(1, 0, 0, .5))
    >>> found = inspect(render([triangle, triangle], width=64, height=48, device="cpu", fragments="count"))
    >>> found.deepest, int(found.histogram[2]) * 2 == found.fragments
    (2, True)
    """
    counts = frame.counts
    if counts is not None and not counts.size:
        raise ParameterError(f"the frame has no pixels: its counts are {counts.shape}")
    if counts is None and frame.fragments is not None:
        counts = frame.fragments.counts
    if counts is None:
        raise ParameterError('the frame has no counts: render with fragments="count", or with True for the lists too')
    histogram = np.bincount(counts.ravel()).astype(np.int64)
    covered = counts[counts > 0]
    place = np.unravel_index(int(np.argmax(counts)), counts.shape)
    percentiles = (50, 90, 99, 99.9)
    found = np.percentile(covered, percentiles, method="higher") if covered.size else np.zeros(len(percentiles))
    return Inspection(
        counts=counts,
        histogram=histogram,
        fragments=int(counts.sum(dtype=np.int64)),
        deepest=len(histogram) - 1,
        deepest_pixel=tuple(map(int, place)),
        covered=covered.size / counts.size,
        mean=float(covered.mean()) if covered.size else 0.0,
        percentiles=dict(zip(percentiles, map(int, found), strict=True)),
    )


def layers(fragments, y, x, ax=None, srgb=False):
    """The fragments of a pixel as a stack, the nearest on top: what `Fragments.plot` draws.

    Returns the matplotlib Figure.
    """
    own = fragments[y, x]
    count = min(len(own), MOST_LAYERS)
    figure = ax.figure if ax is not None else _figure((8.6, max(1.8, 0.42 * (count + 2))))
    ax = figure.subplots() if ax is None else ax
    through = _through(own)
    names = [*BLENDS, *(blend.name or "own" for blend in fragments.blends)]
    squares = 0.5 + 0.25 * (np.indices((2, CHECKS)).sum(axis=0) % 2)[..., None] * np.ones(3)
    for place, fragment in zip(range(count), own, strict=False):
        rgba = fragment.color.astype(np.float64)
        rgb = np.clip(rgba[:3], 0, 1)
        rgb = encode_srgb(rgb) if srgb else rgb
        box = rgba[3] * rgb + (1 - rgba[3]) * squares
        box[:, -OPAQUE_CHECKS:] = rgb
        ax.imshow(box, extent=(0, 1, place + 0.9, place + 0.1), interpolation="nearest", aspect="auto")
        ax.text(1.04, place + 0.5, _told(fragment, names, through, place), va="center", fontsize=8)
    if not len(own):
        rest = "no fragment"
    elif through is None:
        rest = "of other blend modes, and of masks of samples, what a layer lets through is no single number"
    else:
        rest = f"lets {through[-1]:.3g} of the background through"
    if len(own) > count:
        rest = f"… {len(own) - count:,} more, the farthest; {rest}"
    ax.text(0, count + 0.5, rest, va="center", fontsize=8)
    ax.set(xlim=(0, 4.1), ylim=(count + 1, 0), title=f"pixel [{y}, {x}]: {len(own):,} fragments, the nearest on top")
    ax.set_axis_off()
    return figure


def _through(own):
    """What all layers before each let through, and what all of them do; None where that is no single number."""
    fields = own.dtype.names
    if "coverage" in fields or ("blend" in fields and (own.blend != BLENDS.index("over")).any()):
        return None
    return np.cumprod(np.concatenate([[1.0], 1 - own.color[:, 3].astype(np.float64)]))


def _told(fragment, names, through, place):
    red, green, blue, alpha = fragment.color.astype(np.float64)
    said = [f"depth {fragment.depth:.6g}", f"α {alpha:.3g}", f"RGB {red:.3g} {green:.3g} {blue:.3g}"]
    if through is not None:
        said += [f"T {through[place]:.3g}", f"Tα {through[place] * alpha:.3g}"]
    elif "blend" in fragment.dtype.names:
        said.append(names[fragment.blend])
    return "   ".join([*said, f"primitive {fragment.primitive}"])


def _integers():
    return needed("matplotlib.ticker", "plotting").MaxNLocator(integer=True, min_n_ticks=1)


def _figure(size):
    """One that no window system knows of."""
    return needed("matplotlib.figure", "plotting").Figure(figsize=size, layout="constrained")
