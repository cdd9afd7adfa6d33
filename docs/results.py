"""Measures the standard suite, and writes results.md and its plots from what was measured; the words are in results/text.md.

    python docs/results.py measure --device gpu        # rows of a device, to docs/results/
    python docs/results.py write                       # docs/results.md, and docs/results/*.png

Needs `pip install 'abuffer[compare]'`.
"""

import argparse
import json
import statistics
from pathlib import Path

import abuffer as ab
from abuffer.comparing.metrics import FLOOR

FOLDER = Path(__file__).parent / "results"
SIZES = {"cpu": {"width": 240, "height": 180}, "gpu": {"width": 640, "height": 360}}
SWEEP = {
    "k_buffer": {"k": [2, 4, 8, 16]},
    "mlab": {"k": [2, 4, 8, 16]},
    "hybrid": {"k": [2, 4, 8, 16]},
    "adaptive": {"k": [2, 4, 8, 16]},
    "bucket_peeling": {"buckets": [8, 32]},
    "stencil_routed": {"k": [8, 16]},
    "wboit": {"weight": ["7", "8", "9", "10", "none"]},
    "mboit": {"moments": [4, 6, 8]},
    "wavelet": {"rank": [2, 3, 5]},
    "fourier": {"terms": [3, 5]},
    "stochastic": {"estimator": ["a", "c"], "draws": [8, 64]},
}
HALF = [
    {"method": f"{id}@hardware", "targets": "float16"}
    for id in ("additive", "weighted_average", "wboit", "unsorted", "mboit", "stochastic")
]


def measure(device, frames):
    """A scene after the other, whose images are let go; those that the file has are not measured again."""
    FOLDER.mkdir(exist_ok=True)
    name = "cpu" if device == "cpu" else "gpu"
    path = FOLDER / f"{name}.json"
    found = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {"size": SIZES[name], "rows": []}
    measured = {row["scene"] for row in found["rows"]}
    for scene in ab.scenes.suite("standard").values():
        if scene.name in measured:
            continue
        is_gpu = device != "cpu"
        plain = [id for id in ab.methods() if id not in SWEEP]
        native = (
            [f"{id}@hardware" for id, row in ab.methods().items() if "hardware" in row["pipelines"]] if is_gpu else []
        )
        compared = ab.compare(
            scene,
            **SIZES[name],
            devices=[device],
            methods=[*plain, *native, *(HALF if is_gpu else [])],
            sweep=SWEEP,
            repeats=frames,
            progress=lambda done, all, what: print(f"{done} of {all}: {what}", end="\033[K\r", flush=True),
        )
        found["rows"] += compared.rows
        found["frames"] = frames
        found["environment"] = compared.environment
        path.write_text(json.dumps(found), encoding="utf-8")
        print(f"\n{scene.name}: {len(compared.rows)} rows")


def compared_of(name):
    """What was measured of a device, without images."""
    found = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    return ab.Comparison(found["rows"], found["environment"]), found["size"], found["frames"]


def write():
    text = (FOLDER / "text.md").read_text(encoding="utf-8")
    for name in ("cpu", "gpu"):
        text = text.replace(f"<!-- {name} -->\n", section(name, *compared_of(name)))
    (FOLDER.parent / "results.md").write_text(text, encoding="utf-8")


def section(name, compared, size, frames):
    """A device's plots and tables; frames: as given to the command."""
    environment = compared.environment
    device = next(iter(environment["devices"]))
    driver = environment["devices"][device]["driver"]
    where = f"{device} ({driver})" if driver else environment["processor"]
    plotted(compared, name)
    timed = [row["frames"] for row in compared.rows]
    fewer = sum(count < max(timed) for count in timed)
    said = f"medians of {max(timed)} frames" + (
        f", of {min(timed)} at least in {fewer} rows that take seconds" if fewer else ""
    )
    command = f"python docs/results.py measure --device {name}" + (f" --frames {frames}" if frames else "")
    lines = [
        "",
        f"## {where}",
        "",
        f"{size['width']}×{size['height']}, on {environment['date'][:10]}, {said}. `{command}`",
        "",
        f"![Time against error of all methods on each scene, {where}](results/{name}.png)",
        "",
        "Time: that of a frame, as a multiple of exact in the same turns; geometric mean of the scenes, the least and the most.",
        "Errors: of each scene the RMSE of premultiplied linear RGB. `=`: no more than float32 rounds, 1e-6. In the plot black edges",
        "and bold labels are undominated rows, the staircase has the fastest at each error, and larger dots keep more bytes.",
        "",
        *table(compared),
        "",
    ]
    return "\n".join(lines)


def table(compared):
    """A line a row: times beside exact, memory, and the error on each scene."""
    scenes = compared.scenes
    time = compared.time_column()
    exact = {scene: compared.select(scene=scene, label="exact")[0][time] for scene in scenes}
    lines = [["method", "time", "from", "to", "bytes a pixel", *scenes]]
    for label in dict.fromkeys(row["label"] for row in compared.rows):
        rows = {row["scene"]: row for row in compared.select(label=label)}
        times = [rows[scene][time] / exact[scene] for scene in scenes]
        mean = statistics.geometric_mean(times)
        memory = [rows[scene]["bytes_per_pixel"] for scene in scenes]
        shown = f"{memory[0]:.0f}" if min(memory) == max(memory) else f"{min(memory):.0f} to {max(memory):.0f}"
        errors = ["=" if rows[scene]["rmse"] < FLOOR else f"{rows[scene]['rmse']:.1e}" for scene in scenes]
        lines.append([f"`{label}`", f"{mean:.2f}", f"{min(times):.2f}", f"{max(times):.2f}", shown, *errors])
    lines.insert(1, ["---"] * len(lines[0]))
    return [f"| {' | '.join(line)} |" for line in lines]


def plotted(compared, name):
    figure = compared.plot()
    figure.savefig(FOLDER / f"{name}.png", dpi=100, pil_kwargs={"optimize": True})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    measuring = commands.add_parser("measure")
    measuring.add_argument("--device", default="cpu")
    measuring.add_argument("--frames", type=int, help="that are timed; 30 on a real GPU, 5 on others")
    commands.add_parser("write")
    arguments = parser.parse_args()
    if arguments.command == "measure":
        measure(arguments.device, arguments.frames)
    else:
        write()


if __name__ == "__main__":
    main()
