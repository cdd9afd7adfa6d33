"""`abuffer inspect`."""

import abuffer as ab

from ..extras import needed
from .arguments import SCENES, add_models, add_size, scenes_of, writable
from .progress import status

# Of the histogram: lines at most, and characters of its longest bar.
LINES, BAR = 16, 50
DPI = 110  # of the picture


def add(commands):
    inspect = commands.add_parser(
        "inspect",
        help="print how many fragments the pixels of a scene have",
        description="Prints how many fragments pixels have: in all, at most, percentiles of covered pixels, and a histogram.",
    )
    inspect.set_defaults(run=_run)
    add = inspect.add_argument
    add(
        "scene",
        metavar="MODEL_OR_SCENE",
        help=f"PLY, OBJ, STL, OFF, GLB or glTF file, or a standard scene ({', '.join(SCENES)})",
    )
    add("-o", "--output", metavar="FILE", help=".png for a map of the fragments of pixels, and their histogram")
    add_size(inspect)
    add("--device", default="auto", help="as of render (default: auto)")
    add_models(inspect)


def _run(given):
    output = given.output and writable("--output", given.output, (".png",))
    if output:
        needed("matplotlib.figure", "--output")
    with status("rendering"):
        ((_, found),) = scenes_of(given.scene, given).items()
        scene, camera = (found, ab.Camera.fit(found)) if isinstance(found, ab.Scene) else (found.scene, found.camera)
        size = {"width": given.width, "height": given.height}
        inspection = ab.inspect(ab.render(scene, camera, **size, device=given.device, fragments="count"))
        if output:
            inspection.plot().savefig(output, dpi=DPI)
    print(inspection)
    print(_histogram(inspection))


def _histogram(inspection) -> str:
    """Pixels by their number of fragments, in steps of so many that there are few lines."""
    step = -(-inspection.deepest // LINES) or 1
    lines = []
    for first in range(1, inspection.deepest + 1, step):
        last = min(first + step - 1, inspection.deepest)
        pixels = int(inspection.histogram[first : last + 1].sum())
        lines.append((f"{first}" if first == last else f"{first}-{last}", pixels))
    most = max((pixels for _, pixels in lines), default=0)
    rows = [f"{'fragments':>9}  {'pixels':>11}"]
    for name, pixels in lines:
        bar = "#" * -(-BAR * pixels // most)  # one for a single pixel
        rows.append(f"{name:>9}  {pixels:>11,}  {bar}".rstrip())
    return "\n".join(rows)
