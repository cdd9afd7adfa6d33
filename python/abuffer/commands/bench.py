"""`abuffer bench`."""

import json

import abuffer as ab

from .. import bench
from .progress import status


def add(commands):
    timing = commands.add_parser(
        "bench",
        help="time the pipelines of a GPU against each other",
        description="Times pipelines tiles and linked_list on one device, in turns: an image alone, lists, 4 samples a pixel, "
        "and a blend mode, of few large triangles (200) and many small ones (200,000). Below 1 tiles are faster. The first "
        "renders take seconds to compile.",
    )
    timing.set_defaults(run=_run)
    timing.add_argument("--device", default="gpu", help="gpu (the best adapter, the default) or part of a name")
    timing.add_argument("--repeats", type=int, default=9, metavar="N", help="renders of each (default: 9)")
    timing.add_argument(
        "--calibrate",
        action="store_true",
        help="print the row that pipeline auto chooses by, for python/abuffer/measured.py",
    )


def _run(given):
    if given.repeats < 1:
        raise ab.ParameterError(f"--repeats must be at least 1, got {given.repeats}")
    rows = []
    header = f"{'case':<9}{'triangles':<11}{'tiles, ms':>11}{'linked_list, ms':>17}{'tiles ÷ linked_list':>21}"
    with status("rendering"):
        for row in bench.compare(given.device, given.repeats):
            if not rows:
                print(header)
            rows.append(row)
            start = f"{row['case']:<9}{row['scene']:<11}"
            if "error" in row:
                print(start + row["error"], flush=True)
            else:
                print(f"{start}{row['tiles_ms']:>11.2f}{row['linked_list_ms']:>17.2f}{row['ratio']:>21.2f}", flush=True)
    if given.calibrate:
        print(json.dumps(bench.constants(rows), indent=4))
