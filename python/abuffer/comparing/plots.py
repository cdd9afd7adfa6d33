"""Plots of comparisons. Needs matplotlib."""

import math

import numpy as np

from .. import _check
from .._methods import METHODS
from .._srgb import encode_srgb
from ..errors import ParameterError
from ..extras import needed
from .entries import as_list
from .labels import labelled
from .measuring import OTHER
from .metrics import FLOOR, LESS_IS_BETTER

COLUMNS = 3
# Inches of a panel.
PANEL = (5.2, 4.2)
# Square points of a dot: of nothing kept, and of each byte a pixel's square root.
LEAST_DOT, DOT_OF_ROOT = 24, 9
# Rows of a panel that have a label each; of more, exact and the staircase have, and a legend tells the others.
MOST_LABELS = 16
# Inches of a legend's column.
LEGEND_COLUMN = 1.65
# What is no number is shown in no colour that light has here.
NO_NUMBER = (1.0, 0.0, 1.0)
MARKERS = {"tiles": "o", "hardware": "^", "linked_list": "s", "prefix_sum": "D", OTHER: "*"}
TITLES = {OTHER: "another renderer"}
TIMES = {"gpu_ms": "GPU time of a frame, ms", "wall_ms": "time of a frame, ms"}


def plot(compared, ax, error, scene, device, panel=PANEL):
    """What `Comparison.plot` returns; `panel` in inches."""
    _check.choice("error", error, tuple(LESS_IS_BETTER))
    cells = [
        (s, d)
        for s in (compared.scenes if scene is None else [_known("scene", scene, compared.scenes)])
        for d in (compared.devices if device is None else [_known("device", device, compared.devices)])
    ]
    if ax is not None and getattr(ax, "name", None) != "rectilinear":
        raise ParameterError(f"ax must be flat axes of matplotlib, got {type(ax).__name__}")
    if ax is not None and len(cells) != 1:
        raise ParameterError(f"axes have room for one scene and device, and there are {len(cells)}: name one of each")
    figure, axes = _grid(len(cells), panel) if ax is None else (ax.figure, [ax])
    told = [_panel(compared, panel, error, *cell) for panel, cell in zip(axes, cells, strict=True)]
    rows = [row for scene, device in cells for row in compared.select(scene=scene, device=device)]
    handles = _handles(rows, any(not all_told for _, all_told, _ in told))
    small = {"fontsize": 7, "frameon": False}
    if ax is None:
        columns = max(1, int(figure.get_figwidth() / LEGEND_COLUMN))
        figure.legend(handles=handles, loc="outside lower center", ncols=columns, **small)
    else:
        width = ax.get_window_extent().width / figure.dpi
        columns = max(1, int(width / LEGEND_COLUMN))
        ax.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=columns, **small)
    # Labels go where there is room, which the layout has to be done for.
    figure.figure.draw_without_rendering()  # of a part of a figure, the whole
    for panel, (labels, *_, dots) in zip(axes, told, strict=True):
        labelled(panel, labels, dots)
    return figure


def _handles(rows, by_color):
    """What dots and lines mean; by_color: methods and pipelines too, where dots have no label each."""
    line = needed("matplotlib.lines", "plotting").Line2D
    dot = {"linestyle": "", "marker": "o"}
    handles = [
        line([], [], color="0.6", markeredgecolor="black", label="undominated", **dot),
        line([], [], color="0.55", linestyle="--", linewidth=1, label="fastest at an error"),
        line([], [], color="0.6", markersize=9, label="larger: more bytes a pixel", **dot),
        line([], [], color="0.6", linewidth=0.7, marker="|", label="quartiles of time"),
    ]
    if not by_color:
        return handles
    methods = dict.fromkeys(row["method"] for row in rows if row["method"] != OTHER)
    handles += [line([], [], color=_color(method), label=method, **dot) for method in methods]
    pipelines = dict.fromkeys(row["pipeline"] for row in rows)
    return handles + [
        line([], [], linestyle="", color="0.4", marker=MARKERS[name], label=TITLES.get(name, f"@{name}"))
        for name in pipelines
    ]


def _known(what, name, names):
    if name not in names:
        raise ParameterError(f"there is no {what} {name!r}: there are {', '.join(names)}")
    return name


def _grid(count, panel, columns=COLUMNS):
    """A figure that no window system knows of, and its axes; those beyond `count` are off."""
    figures = needed("matplotlib.figure", "plotting")
    if not count:
        raise ParameterError("there is nothing to plot: the comparison has no rows")
    columns = min(columns, count)
    rows = math.ceil(count / columns)
    figure = figures.Figure(figsize=(panel[0] * columns, panel[1] * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for empty in axes[count:]:
        empty.set_axis_off()
    return figure, axes[:count]


def _panel(compared, ax, error, scene, device):
    """Draws a panel but its labels. Returns those, whether all dots have one, and all dots: see `labelled`."""
    rows = [row for row in compared.select(scene=scene, device=device) if not row["failure"]]
    time = compared.time_column(rows)
    rows = [row for row in rows if math.isfinite(row[error]) and math.isfinite(row[time])]
    ax.set(xscale="log", yscale="log")
    ax.set_title(f"{scene}, {device}", parse_math=False)
    if rows:
        xs, ys = _points(rows, time, error)
        ax.set(xlim=(min(xs) / 1.6, max(xs) * 2.5), ylim=(min(ys) / 3, max(ys) * 4))  # with room for labels
    ax.set_xlabel(TIMES[time])
    ax.set_ylabel(LESS_IS_BETTER[error])
    _ticks(ax)
    ax.grid(True, which="major", color="0.88", linewidth=0.6)
    ax.set_axisbelow(True)
    best = compared.pareto(error, scene=scene, device=device)
    steps = _staircase(ax, best, time, error)
    for curve in dict.fromkeys(row["curve"] for row in rows if row["curve"]):
        own = [row for row in rows if row["curve"] == curve]
        ax.plot(*_points(own, time, error), color=_color(own[0]["method"]), linewidth=1, alpha=0.7, zorder=2)
    dots = {}
    for row in rows:
        color = _color(row["method"])
        (x,), (y,) = _points([row], time, error)
        spread = [[x - row[f"{time}_q1"]], [row[f"{time}_q3"] - x]]
        ax.errorbar(x, y, xerr=np.maximum(spread, 0), color=color, linewidth=0.7, zorder=2)
        area = LEAST_DOT + DOT_OF_ROOT * math.sqrt(np.nan_to_num(row["bytes_per_pixel"]))
        edge = "black" if row in best else "white"
        marker = MARKERS[row["pipeline"]]
        dots[x, y] = max(math.sqrt(area), dots.get((x, y), 0))
        ax.scatter(x, y, s=area, color=color, marker=marker, edgecolor=edge, linewidth=0.8, zorder=3)
    all_told = len(rows) <= MOST_LABELS
    few = [row for row in rows if row["label"] == "exact" or row in steps[:MOST_LABELS]]
    told = sorted(rows if all_told else few, key=lambda row: (max(row[error], FLOOR), row[time]))
    labels = [(row[time], max(row[error], FLOOR), row["label"], row in best) for row in told]
    return labels, all_told, dots


def _ticks(ax):
    """Times as numbers, with those between decades where there are few; what is at the floor is no more than that."""
    ticker = needed("matplotlib.ticker", "plotting")
    low, high = ax.get_xlim()
    subs = (1, 2, 5) if high / low < 300 else (1,)
    ax.xaxis.set_major_locator(ticker.LogLocator(subs=subs))
    ax.xaxis.set_major_formatter(ticker.StrMethodFormatter("{x:g}"))
    ax.xaxis.set_minor_formatter(ticker.NullFormatter())
    power = ticker.LogFormatterMathtext(labelOnlyBase=False)
    ax.yaxis.set_major_formatter(
        ticker.FuncFormatter(lambda y, _: r"$\leq 10^{-6}$" if math.isclose(y, FLOOR) else power(y))
    )
    power.set_axis(ax.yaxis)
    ax.yaxis.set_minor_formatter(ticker.NullFormatter())


def _points(rows, time, error):
    return [row[time] for row in rows], [max(row[error], FLOOR) for row in rows]


def _staircase(ax, best, time, error):
    """What is fastest at each error: down and to the right, from one undominated row to the next, which it returns."""
    lowest, kept = math.inf, []
    for row in sorted(best, key=lambda row: (row[time], row[error])):
        if max(row[error], FLOOR) < lowest:
            kept.append(row)
            lowest = max(row[error], FLOOR)
    if kept:
        ax.step(*_points(kept, time, error), where="post", color="0.55", linewidth=1, linestyle="--", zorder=1)
    return kept


def _color(method):
    """The same in all figures: by the method's place in the table of methods."""
    colormaps = needed("matplotlib", "plotting").colormaps
    # As many as there are methods, no two alike; further ones for those that are registered.
    every = [*colormaps["tab10"].colors, *colormaps["Dark2"].colors[:7], *colormaps["tab20b"].colors[::4]]
    every += [*colormaps["tab20c"].colors, *colormaps["tab20b"].colors[1::2]]
    if method == OTHER:
        return "black"
    place = list(METHODS).index(method) if method in METHODS else len(METHODS)
    return every[place % len(every)]


def grid(compared, scene, device, labels, srgb):
    """What `Comparison.images` returns."""
    images = compared.images_of(scene, device)
    scene = scene or compared.scenes[0]
    labels = (
        list(images) if labels is None else [_known("row", each, list(images)) for each in as_list("labels", labels)]
    )
    reference = compared.references[scene]
    height, width = reference.shape[:2]
    panel = (3.0, 3.0 * height / width + 0.3)
    figure, axes = _grid(2 * (len(labels) + 1), panel, columns=4)
    off = {label: signed(images[label], reference) for label in labels}
    most = max((float(np.abs(o).filled(0).max()) for o in off.values()), default=0.0)
    # A step of 8 bits shows, and so does what is off by hundreds of them.
    colors = needed("matplotlib.colors", "plotting")
    norm = colors.SymLogNorm(1 / 255, vmin=-max(most, 1 / 255), vmax=max(most, 1 / 255))
    axes[0].imshow(shown(reference, srgb), interpolation="nearest")
    kind = compared.asked.get(scene, {}).get("reference")
    title = f"{scene}: reference" + (f", {kind}" if kind else "")
    axes[0].set_title(title, fontsize=8, parse_math=False)
    axes[1].set_axis_off()
    scale = None
    for i, label in enumerate(labels, 1):
        image, difference = axes[2 * i], axes[2 * i + 1]
        image.imshow(shown(images[label], srgb), interpolation="nearest")
        image.set_title(label, fontsize=8, parse_math=False)
        scale = difference.imshow(off[label], cmap="RdBu_r", norm=norm, interpolation="nearest")
        difference.set_facecolor(NO_NUMBER)  # where what is masked lets it show
        bad = np.ma.count_masked(off[label])
        told = f"off by {np.abs(off[label]).filled(0).max():.2g}"
        difference.set_title(f"{told}; not finite in {bad:,} pixels" if bad else told, fontsize=8)
    for ax in axes:
        ax.set_xticks([])
        ax.set_yticks([])
    if scale is not None:
        figure.colorbar(scale, ax=list(axes), fraction=0.03, label="image − reference")
    return figure


def shown(image, srgb):
    """Over black, cut to [0, 1]."""
    rgb = np.asarray(image[..., :3], np.float64)
    shown = np.clip(np.nan_to_num(rgb), 0, 1)
    shown = encode_srgb(shown) if srgb else shown
    shown[~np.isfinite(rgb).all(axis=2)] = NO_NUMBER
    return shown


def signed(image, reference):
    """Of each pixel, the difference of the channel that is most off; what is no number is masked."""
    off = image[..., :3].astype(np.float64) - reference[..., :3]
    most = np.take_along_axis(off, np.abs(off).argmax(axis=2)[..., None], axis=2)[..., 0]
    return np.ma.masked_where(~np.isfinite(off).all(axis=2), most)
