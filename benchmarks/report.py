"""Tables in markdown, printed while they are measured, and every run behind them in JSON."""

import json
import statistics
import sys

from timing import Variant, measure

import scenes


class Report:
    """What is measured on one device, at one scale."""

    def __init__(self, arguments, device):
        self.scale, self.repeats = arguments.scale, arguments.repeats
        self.options = {"device": arguments.device, "memory": arguments.memory, "pipeline": "linked_list"}
        self.files = arguments.markdown, arguments.json
        self.device, self.is_real = device, device["kind"] != "software"
        self.lines, self.rows, self.wrong = [], [], []

    def say(self, *lines):
        self.lines += [*lines, ""]
        print(*lines, "", sep="\n", flush=True)

    def table(self, head, cells):
        self.say(*lines_of(head, cells))

    def variant(self, name, scene, options, **rest):
        return Variant(name, scene, self.options | options, **rest)

    def random_scenes(self):
        """All of RANDOM by name, the last one on real GPUs only."""
        names = list(scenes.RANDOM)
        return {name: ("random_triangles", name, 0, self.scale) for name in (names if self.is_real else names[:-1])}

    def measure(self, table, scene, variants, how=measure):
        """Rows of a scene, which are kept, and whose checks are counted."""
        print(f"… {table}: {scene}", file=sys.stderr, flush=True)
        rows = how(variants, self.repeats)
        self.rows += [{"table": table, "scene": scene} | row for row in rows]
        self.wrong += [f"{table}, {scene}, {r['name']}: {r['image']}" for r in rows if not r.get("holds", True)]
        return rows

    def groups(self, table, groups, columns):
        """Measures {scene: variants}, and prints a line a variant."""
        lines = []
        for scene, variants in groups.items():
            lines += [[scene, *line] for line in cells(self.measure(table, scene, variants), columns)]
        self.table(["scene", "variant", *columns], lines)

    def save(self):
        markdown, path = self.files
        if markdown:
            with open(markdown, "w") as file:
                file.write("\n".join(self.lines))
        if path:
            with open(path, "w") as file:
                json.dump({"device": self.device, "scale": self.scale, "rows": self.rows}, file, indent=1)


def lines_of(head, cells):
    """A table's lines in markdown."""
    return ["| " + " | ".join(map(str, row)) + " |" for row in [head, ["---"] * len(head), *cells]]


def cells(rows, columns):
    """A line a row: its name, and columns; × is a ratio to the first row."""
    for row in rows:
        if "error" in row:
            yield [row["name"], row["error"], *[""] * (len(columns) - 1)]
        else:
            yield [row["name"], *(COLUMNS[column](row, rows[0]) for column in columns)]


def ms(key):
    return lambda row, first: f"{row[key]:.3f}"


def ratio(key):
    """Of turns, which a busy moment slows alike, and not of medians."""

    def times(row, first):
        pairs = [(run[key], base[key]) for run, base in zip(row["runs"], first["runs"], strict=True)]
        return f"{statistics.median(a / b for a, b in pairs):.2f}" if all(b for _, b in pairs) else "–"

    return times


TIMES = ("wall", "fill", "resolve", "opaque", "classify", "classes")
COLUMNS = {
    "fragments": lambda row, first: f"{row['fragments']:,}",
    "a pixel": lambda row, first: f"{row['fragments'] / row['pixels']:.1f}",
    "longest": lambda row, first: row["longest"],
    "bytes a node": lambda row, first: row["node"].split(", ")[1].removesuffix(" bytes"),
    "bands": lambda row, first: row["bands"],
    "image": lambda row, first: row.get("image", "not compared"),
    "counter": lambda row, first: row["lists"].removesuffix(" hands out nodes"),
    "opaque geometry": lambda row, first: row["opaque geometry"],
}
COLUMNS |= {f"{key} ms": ms(key) for key in TIMES} | {f"{key} ×": ratio(key) for key in TIMES}
