"""What lists are like: how deep pixels are, and what lies in one."""

from dataclasses import dataclass

import numpy as np

from ._srgb import encode_srgb
from .errors import ParameterError, UnsupportedError

# Square boxes behind translucent colours, in shares of a layer's width.
CHECKS = 16


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
            f"at most {self.deepest}, in [{y}, {x}]; {percentiles})"
        )

    def plot(self):
        """A heat map of depth complexity, and its histogram: a matplotlib Figure. Needs matplotlib."""
        figure = _figure((10, 4.2))
        left, right = figure.subplots(1, 2, width_ratios=(1.25, 1))
        shown = np.ma.masked_equal(self.counts, 0)
        image = left.imshow(shown, cmap="magma", vmin=0, interpolation="nearest")
        left.set(title="fragments of a pixel", xticks=[], yticks=[], facecolor="0.93")
        figure.colorbar(image, ax=left, shrink=0.85)
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


def layers(fragments, y, x, ax=None):
    """The fragments of a pixel as a stack, the nearest on top: what `Fragments.plot` draws.

    Returns the matplotlib Figure.
    """
    own = fragments[y, x]
    figure = ax.figure if ax is not None else _figure((7.5, max(1.8, 0.42 * (len(own) + 2))))
    ax = figure.subplots() if ax is None else ax
    alpha = own.color[:, 3].astype(np.float64)
    through = np.cumprod(np.concatenate([[1.0], 1 - alpha]))  # over; other modes let through otherwise
    squares = 0.5 + 0.25 * (np.indices((2, CHECKS)).sum(axis=0) % 2)[..., None] * np.ones(3)
    for place, (fragment, before) in enumerate(zip(own, through, strict=False)):
        rgba = fragment.color.astype(np.float64)
        rgb = encode_srgb(np.clip(rgba[:3], 0, 1))
        box = rgba[3] * rgb + (1 - rgba[3]) * squares
        ax.imshow(box, extent=(0, 1, place + 0.9, place + 0.1), interpolation="nearest", aspect="auto")
        said = f"depth {fragment.depth:.6g}   α {rgba[3]:.3g}   T {before:.3g}   Tα {before * rgba[3]:.3g}"
        ax.text(1.04, place + 0.5, f"{said}   primitive {fragment.primitive}", va="center", fontsize=8)
    rest = f"lets {through[-1]:.3g} of the background through" if len(own) else "no fragment"
    ax.text(0, len(own) + 0.5, rest, va="center", fontsize=8)
    ax.set(xlim=(0, 3.6), ylim=(len(own) + 1, 0), title=f"pixel [{y}, {x}]: {len(own)} fragments, the nearest on top")
    ax.set_axis_off()
    return figure


def _figure(size):
    """One that no window system knows of."""
    try:
        from matplotlib.figure import Figure
    except ImportError as e:
        raise UnsupportedError("plotting needs matplotlib: pip install matplotlib, or 'abuffer[compare]'") from e
    return Figure(figsize=size, layout="constrained")
