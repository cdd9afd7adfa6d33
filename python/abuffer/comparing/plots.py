"""Plots of comparisons. Needs matplotlib."""

import math

import numpy as np

from .._srgb import encode_srgb
from ..errors import ParameterError
from .extras import needed

# Where exact is drawn: what float32 rounds.
FLOOR = 1e-7
COLUMNS = 3
# Inches of a panel.
PANEL = (5.2, 4.2)
# Square points of a dot: of nothing kept, and of each byte a pixel's square root.
LEAST_DOT, DOT_OF_ROOT = 24, 9
# Rows of a panel that have a label each; of more, the undominated ones have, and a legend tells the others.
MOST_LABELS = 16
MARKERS = {"tiles": "o", "hardware": "^", "linked_list": "s", "prefix_sum": "D"}
LABELS = {
    "gpu_ms": "GPU time of a frame, ms",
    "wall_ms": "time of a frame, ms",
    "rmse": "RMSE",
    "max_abs": "largest error of a channel",
    "rmse_relative": "relative RMSE",
    "p999": "99.9 percentile of errors",
    "flip": "FLIP",
}


def plot(compared, ax, error, scene, device):
    """What `Comparison.plot` returns."""
    cells = [
        (s, d)
        for s in (compared.scenes if scene is None else [_known("scene", scene, compared.scenes)])
        for d in (compared.devices if device is None else [_known("device", device, compared.devices)])
    ]
    if ax is not None:
        if len(cells) != 1:
            raise ParameterError(
                f"axes have room for one scene and device, and there are {len(cells)}: name one of each"
            )
        _panel(compared, ax, error, *cells[0])
        return ax.figure
    figure, axes = _grid(len(cells), PANEL)
    are_told = [_panel(compared, panel, error, *cell) for panel, cell in zip(axes, cells, strict=True)]
    if not all(are_told):
        _legend(compared, figure)
    return figure


def _legend(compared, figure):
    """Methods by colour, and pipelines by marker."""
    lines = needed("matplotlib.lines", "plotting")
    dot = {"linestyle": "", "markersize": 6}
    handles = [
        lines.Line2D([], [], color=color, marker="o", label=method, **dot)
        for method, color in _colors(compared).items()
    ]
    used = dict.fromkeys(row["pipeline"] for row in compared.rows)
    handles += [
        lines.Line2D([], [], color="0.4", marker=MARKERS.get(name, "o"), label=f"@{name}", **dot) for name in used
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=6, fontsize=7, frameon=False)


def _known(what, name, names):
    if name not in names:
        raise ParameterError(f"there is no {what} {name!r}: there are {', '.join(names)}")
    return name


def _grid(count, panel, columns=COLUMNS):
    """A figure that no window system knows of, and its axes; those beyond `count` are off."""
    figures = needed("matplotlib.figure", "plotting")
    columns = min(columns, count)
    rows = math.ceil(count / columns)
    figure = figures.Figure(figsize=(panel[0] * columns, panel[1] * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for empty in axes[count:]:
        empty.set_axis_off()
    return figure, axes[:count]


def _panel(compared, ax, error, scene, device):
    rows = [row for row in compared.select(scene=scene, device=device) if not row["failure"]]
    rows = [row for row in rows if math.isfinite(row[error])]
    time = compared.time_column(rows)
    ax.set(xscale="log", yscale="log", title=f"{scene}, {device}")
    if rows:
        xs, ys = _points(rows, time, error)
        ax.set(xlim=(min(xs) / 1.6, max(xs) * 4), ylim=(min(ys) / 3, max(ys) * 6))  # with room for labels
    ax.set_xlabel(LABELS[time])
    ax.set_ylabel(LABELS.get(error, error))
    ax.grid(True, which="major", color="0.88", linewidth=0.6)
    ax.set_axisbelow(True)
    best = [row for row in compared.pareto(error) if (row["scene"], row["device"]) == (scene, device)]
    colors = _colors(compared)
    steps = _staircase(ax, best, time, error)
    for curve in dict.fromkeys(row["curve"] for row in rows if row["curve"]):
        own = [row for row in rows if row["curve"] == curve]
        color = colors[own[0]["method"]]
        ax.plot(*_points(own, time, error), color=color, linewidth=1, alpha=0.7, zorder=2)
    for row in rows:
        color = colors[row["method"]]
        (x,), (y,) = _points([row], time, error)
        spread = [[x - row[f"{time}_q1"]], [row[f"{time}_q3"] - x]]
        ax.errorbar(x, y, xerr=np.maximum(spread, 0), color=color, linewidth=0.7, zorder=2)
        size = LEAST_DOT + DOT_OF_ROOT * math.sqrt(np.nan_to_num(row["bytes_per_pixel"]))
        edge = "black" if row in best else "white"
        marker = MARKERS.get(row["pipeline"], "o")
        ax.scatter(x, y, s=size, color=color, marker=marker, edgecolor=edge, linewidth=0.8, zorder=3)
    all_told = len(rows) <= MOST_LABELS
    _labelled(ax, rows if all_told else steps, time, error, best)
    return all_told


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


def _colors(compared):
    """Of each method, the same in all panels."""
    colormaps = needed("matplotlib", "plotting").colormaps
    every = [*colormaps["tab20"].colors[::2], *colormaps["tab20"].colors[1::2], *colormaps["tab20b"].colors]
    methods = dict.fromkeys(row["method"] for row in compared.rows)
    return {method: every[i % len(every)] for i, method in enumerate(methods)}


def _labelled(ax, rows, time, error, best):
    """A label beside each dot, moved up until it covers no other: in the order of errors, so that it stays near."""
    ax.figure.canvas.draw_idle()
    taken = []
    to_pixels = ax.transData.transform
    for row in sorted(rows, key=lambda row: (max(row[error], FLOOR), row[time])):
        (x,), (y,) = _points([row], time, error)
        left, bottom = to_pixels((x, y))
        width, height = 5.2 * len(row["label"]), 9.0
        left, bottom = left + 7, bottom - 3
        while any(left < r and l < left + width and bottom < t and b < bottom + height for l, b, r, t in taken):  # noqa: E741
            bottom += 3
        taken.append((left, bottom, left + width, bottom + height))
        dx, dy = np.subtract((left, bottom), to_pixels((x, y))) * 72 / ax.figure.dpi
        weight = "bold" if row in best else "normal"
        ax.annotate(
            row["label"],
            (x, y),
            (dx, dy),
            textcoords="offset points",
            fontsize=6.5,
            weight=weight,
            color="0.15",
            clip_on=True,
            zorder=4,
        )


def grid(compared, scene, device, labels):
    """What `Comparison.images` returns."""
    scene, device = scene or compared.scenes[0], device or compared.devices[0]
    images = compared.images_of(scene, device)
    labels = list(images) if labels is None else [_known("row", label, list(images)) for label in labels]
    reference = compared.references[scene]
    height, width = reference.shape[:2]
    panel = (3.0, 3.0 * height / width + 0.3)
    figure, axes = _grid(2 * (len(labels) + 1), panel, columns=4)
    wanted = _shown(reference)
    off = {label: _signed(images[label], reference) for label in labels}
    most = max((float(np.abs(o).max()) for o in off.values()), default=0.0) or FLOOR
    # A step of 8 bits shows, and so does what is off by hundreds of them.
    colors = needed("matplotlib.colors", "plotting")
    norm = colors.SymLogNorm(1 / 255, vmin=-max(most, 1 / 255), vmax=max(most, 1 / 255))
    axes[0].imshow(wanted, interpolation="nearest")
    axes[0].set_title(f"{scene}: reference", fontsize=8)
    axes[1].set_axis_off()
    scale = None
    for i, label in enumerate(labels, 1):
        image, difference = axes[2 * i], axes[2 * i + 1]
        image.imshow(_shown(images[label]), interpolation="nearest")
        image.set_title(label, fontsize=8)
        scale = difference.imshow(off[label], cmap="RdBu_r", norm=norm, interpolation="nearest")
        difference.set_title(f"off by {np.abs(off[label]).max():.2g}", fontsize=8)
    for ax in axes:
        ax.set_xticks([])
        ax.set_yticks([])
    if scale is not None:
        figure.colorbar(scale, ax=list(axes), shrink=0.5, label="image − reference, the channel that is most off")
    return figure


def _shown(image):
    """Over black, encoded for a screen."""
    return encode_srgb(np.clip(np.nan_to_num(image[..., :3].astype(np.float64)), 0, 1))


def _signed(image, reference):
    """Of each pixel, the difference of the channel that is most off; what is no number is the most there is."""
    off = np.nan_to_num(image[..., :3].astype(np.float64) - reference[..., :3], nan=1.0, posinf=1.0, neginf=-1.0)
    return np.take_along_axis(off, np.abs(off).argmax(axis=2)[..., None], axis=2)[..., 0]
