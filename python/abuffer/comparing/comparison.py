"""What a comparison found."""

import html
import math

import numpy as np

from .. import _check
from ..errors import ParameterError
from ..extras import needed
from . import store
from .entries import as_list, check_label
from .measuring import COLUMNS, row_of_image
from .metrics import FLOOR, LESS_IS_BETTER
from .references import linear_image

# Of `_repr_html_`.
SHOWN = ("label", "device", "scene", "gpu_ms", "wall_ms", "rmse", "max_abs", "flip", "bytes_per_pixel", "passes")


class Comparison:
    """Rows of methods on scenes and devices, with the images behind them.

    Attributes:
        rows: a dict a row; `abuffer.comparing.measuring.COLUMNS` lists the columns. Times are milliseconds, errors in the units
            of colours, of premultiplied RGB.
        environment: where it was measured.
        rendered: {(scene, device, label): (H, W, 4) float32}, premultiplied.
        references: {scene: (H, W, 4) float64}, what errors are measured against.
        exact: {scene: Frame}, exact in float64, or of float32's fragments where those are the reference; with the fragments if they
            are not too many.
    """

    def __init__(self, rows, environment):
        self.rows, self.environment = rows, environment
        self.rendered, self.references, self.exact = {}, {}, {}
        self.asked = {}  # of each scene, what it was measured with: see resuming.py

    def __repr__(self):
        return f"Comparison({len(self.rows)} rows: {len(self.scenes)} scenes, {len(self.devices)} devices)"

    def add(self, scene, device, rows, images, exact, reference):
        """Takes in what was measured of a scene on a device."""
        self.rows += [row | {"device": device} for row in rows]
        self.rendered |= {(scene, device, label): image for label, image in images.items()}
        self.exact[scene], self.references[scene] = exact, reference

    def add_image(self, label, image, *, scene=None, device=None, ms=()):
        """Adds a row of what another renderer made of a scene: tables, plots and the report have it beside the methods'.

        Args:
            label: as they name it.
            image: (H, W, 4) floats, premultiplied and linear, row 0 on top, of the camera, size and background that were compared.
            scene, device: beside whose rows it stands. None: the first.
            ms: milliseconds by the clock, of as many frames as were timed. Without any it is in no plot, and neither dominates
                nor is dominated.

        Raises:
            ParameterError: an image of another size or dtype, a label that is there already, or a scene or device that is not.
        """
        scene = _check.choice("scene", scene or next(iter(self.scenes), None), self.scenes)
        device = _check.choice("device", device or next(iter(self.devices), None), self.devices)
        check_label(label)
        if self.select(scene=scene, device=device, label=label):
            raise ParameterError(f"there is a row {label!r} of {scene} on {device} already: give another label")
        reference = self.references[scene]
        image = linear_image(f"the image of {label}", image, reference.shape[1::-1])
        ms = [_check.number("ms", each, 0, np.inf, open_ends=True) for each in as_list("ms", ms)]
        row = row_of_image(label, scene, device, image, reference, self.exact[scene], ms)
        self.add(scene, device, [row], {label: image.astype(np.float32)}, self.exact[scene], reference)

    @property
    def scenes(self) -> list:
        return list(dict.fromkeys(row["scene"] for row in self.rows))

    @property
    def devices(self) -> list:
        return list(dict.fromkeys(row["device"] for row in self.rows))

    @property
    def cells(self) -> set:
        """Scenes and devices that are measured."""
        return {(row["scene"], row["device"]) for row in self.rows}

    def select(self, **columns) -> list:
        """Rows whose columns have these values: `compared.select(method="wboit", scene="hair")`."""
        for name in columns:
            _check.choice("column", name, COLUMNS)
        return [row for row in self.rows if all(row[name] == value for name, value in columns.items())]

    def to_pandas(self):
        """A DataFrame of all rows. Needs pandas."""
        return needed("pandas", "to_pandas").DataFrame(self.rows)

    def time_column(self, rows=None) -> str:
        """`gpu_ms` where all rows that have a time have it, else `wall_ms`."""
        rows = [row for row in (self.rows if rows is None else rows) if not row["failure"]]
        rows = [row for row in rows if math.isfinite(row["gpu_ms"]) or math.isfinite(row["wall_ms"])]
        return "gpu_ms" if rows and all(math.isfinite(row["gpu_ms"]) for row in rows) else "wall_ms"

    def pareto(self, error="rmse", *, scene=None, device=None) -> list:
        """Rows that no other one dominates: of the same scene and device.

        A row dominates another where its error is no greater and it is faster, and that only where the quartiles of their times
        do not overlap: what noise may have ordered is not told apart. Neither are errors of at most 1e-6, which float32 rounds.

        Args:
            error: the column of errors, of which less is better: "rmse", "max_abs", "rmse_relative", "p999", "over_1_255",
                "over_1e5", "flip" or "alpha_rmse".
            scene, device: those alone. None: all.
        """
        _check.choice("error", error, tuple(LESS_IS_BETTER))
        best = []
        for s in self.scenes if scene is None else [_check.choice("scene", scene, self.scenes)]:
            for d in self.devices if device is None else [_check.choice("device", device, self.devices)]:
                rows = [row for row in self.select(scene=s, device=d) if not row["failure"]]
                time = self.time_column(rows)
                rows = [row for row in rows if math.isfinite(row[time]) and math.isfinite(row[error])]
                best += [row for row in rows if not any(_dominates(other, row, time, error) for other in rows)]
        return best

    def plot(self, ax=None, *, error="rmse", scene=None, device=None):
        """Time against error, both logarithmic: a figure with a panel for each scene and device. Needs matplotlib.

        A dot is a row, its colour a method, its marker a pipeline, and its area grows with the bytes a pixel that are kept. A
        bar has the quartiles of its times, a line joins a sweep. Rows of `pareto` have a black edge and bold labels; the dashed
        staircase has the fastest of them at each error. Errors of at most 1e-6, which float32 rounds, are drawn at 1e-6.
        Where there are more than 16 rows, exact and those of the staircase have labels, and a legend tells the others.

        Args:
            ax: axes to draw one scene and device into, with the legend below: there is room for it where their figure's layout is
                "constrained", or it is saved with bbox_inches="tight", as notebooks do. None: a new figure.
            error: the column of errors, as in `pareto`.
            scene, device: those alone. None: all.

        Returns the matplotlib Figure. pyplot does not know of a new one: notebooks show it, scripts take `savefig`.
        """
        from .plots import plot  # needs matplotlib

        return plot(self, ax, error, scene, device)

    def images_of(self, scene=None, device=None) -> dict:
        """The images of a scene on a device by label; of the first of each where nothing is said."""
        if not self.rows:
            raise ParameterError("there is no image: the comparison has no rows")
        scene, device = scene or self.scenes[0], device or self.devices[0]
        found = {label: image for (s, d, label), image in self.rendered.items() if (s, d) == (scene, device)}
        if not found:
            raise ParameterError(
                f"no image of scene {scene!r} on device {device!r}: scenes are {', '.join(self.scenes)}, "
                f"devices {', '.join(self.devices)}"
            )
        return found

    def images(self, scene=None, device=None, labels=None, *, srgb=False):
        """A grid: the reference, each method's image, and its signed difference on one scale. Needs matplotlib.

        Images are over black, cut to [0, 1]; what is no number is magenta. Differences are of the linear floats, of the channel
        that is most off; their colour scale is linear up to 1/255 and logarithmic beyond.

        Args:
            scene, device: None: the first.
            labels: of rows. None: all.
            srgb: encode what is shown with the sRGB curve; give it if your colours are linear light.

        Returns the matplotlib Figure, which pyplot does not know of.
        """
        from .plots import grid  # needs matplotlib

        return grid(self, scene, device, labels, _check.flag("srgb", srgb))

    def report(self, path, *, srgb=False):
        """Writes one page of HTML, which loads nothing else. Needs jinja2 and matplotlib.

        Of a scene and a device that are chosen there: time against error, a table that sorts by any column, any two images
        with a slider between them, or their signed differences from the reference, and of a pixel that is clicked the values
        and the fragment list. Images are shown over black, cut to [0, 1].

        A page holds all images. It holds the lists of scenes of at most 500,000 fragments, and float32 values of a scene's
        images, while it stays within 28 million characters; where it has none it says so, and gives values of 8 bits.

        Args:
            path: of the file, .html by custom.
            srgb: encode what is shown with the sRGB curve; give it if your colours are linear light.

        Raises:
            ParameterError: there are no rows. UnsupportedError: jinja2 or matplotlib is missing.
        """
        from .report import report

        report(self, path, _check.flag("srgb", srgb))

    def save(self, folder):
        """Writes all of it to a folder: JSON, and NPZ of images and lists, which `load` reads."""
        store.save(self, folder)

    @classmethod
    def load(cls, folder) -> "Comparison":
        """Reads what `save` wrote."""
        return store.load(folder)

    def _repr_html_(self):
        head = "".join(f"<th>{name}</th>" for name in SHOWN)
        body = "".join(
            "<tr>" + "".join(f"<td>{html.escape(_cell(row[name]))}</td>" for name in SHOWN) + "</tr>"
            for row in self.rows
        )
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _dominates(one, other, time, error):
    if one is other or not one[f"{time}_q3"] < other[f"{time}_q1"]:
        return False
    return max(one[error], FLOOR) <= max(other[error], FLOOR)


def _cell(value):
    if isinstance(value, float):
        return "" if np.isnan(value) else f"{value:.3g}"
    return "" if value is None else str(value)
