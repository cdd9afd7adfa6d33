"""Renderers that draw transparency, and our methods, on the same scenes: time and error in one table.

    python benchmarks/peers.py --scenes stack hair --markdown peers.md --json peers.json

A frame is one call that returns an image in numpy, of a scene that was uploaded before. Ours are drawn in turns; each
peer in a process of its own, in an environment that is made of the pins beside its script (benchmarks/peers). Errors
are of linear colours, against exact in float64. Peers are unlit, with one sample a pixel; colours and backgrounds are
such as 8 bits hold, for ours too. A peer that cannot run is a row that says why.

For a machine without network: `pip wheel --no-deps -r FILE -w FOLDER` where there is one, of every .txt in
benchmarks/peers and for the same Python, and --wheels FOLDER.
"""

import argparse
import dataclasses
import json
import math
from pathlib import Path

import numpy as np
from report import lines_of

import abuffer as ab
from abuffer.comparing.environment import environment
from abuffer.comparing.metrics import sizes_of
from abuffer.testing import edge_band
from peers_protocol import arrays_of, drawn

# Those that all peers can express, which hold no light beyond 1. The last take longest.
SCENES = (
    "stack", "intersecting", "cyclic", "nested_spheres", "random_triangles", "opaque_and_glass", "hair", "coplanar",
    "smoke", "thin_sheets",
)  # fmt: skip
OURS = {
    "cpu": ("exact", "wboit", "mlab", "depth_peeling"),
    "gpu": ("exact", "exact@linked_list", "wboit@hardware", "mlab", "depth_peeling@hardware"),
}
PEERS = (
    "pyrender:sorted objects",
    "pyvista:depth peeling",
    "pyvista:default",
    "pygfx:weighted_blend",
    "trimesh:embree rays",
    "trimesh:native rays",
)
# Pixels: drivers snap vertices to a grid of their own. What is nearer to an edge may be covered or not.
CLOSE = 1 / 64
ROW = {"renderer": "", "device": "", "version": "", "notes": "", "ms": [], "failure": ""}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=SCENES)
    parser.add_argument("--size", nargs=2, type=int, default=(320, 240), metavar=("WIDTH", "HEIGHT"))
    parser.add_argument("--repeats", type=int, default=7, help="frames that are timed; of ours, turns")
    parser.add_argument("--timeout", type=float, default=600, help="seconds that a peer has for a scene")
    parser.add_argument(
        "--peers", nargs="*", default=PEERS, metavar="NAME:VARIANT", help="or a path of a script like those there"
    )
    parser.add_argument("--devices", nargs="+", choices=OURS, help="of our methods; default: all there are")
    parser.add_argument("--wheels", type=Path, help="a folder of wheels, in place of the network")
    parser.add_argument("--markdown", type=Path)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    has_gpu = any("hardware" in row["pipelines"] for row in ab.devices().values())
    devices = arguments.devices or (["cpu", "gpu"] if has_gpu else ["cpu"])
    where = environment(devices)
    sections, rows = [], []
    for name in arguments.scenes:
        own, said = measured(of_8_bits(getattr(ab.scenes, name)()), devices, arguments)
        section = [f"## {name}", "", said, "", *table(own, f"exact, {devices[0]}"), ""]
        print("\n".join(section), flush=True)
        rows += own
        sections += section
        # After every scene: it takes long.
        if arguments.markdown:
            lines = [*told(where, arguments), "", *peers_of(rows), "", *sections]
            _write(arguments.markdown, "\n".join(lines))
        if arguments.json:
            _write(arguments.json, json.dumps({"environment": where, "rows": rows}, indent=1))


def _write(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def of_8_bits(standard):
    """The scene with alphas, colours and background of 8 bits, which all peers hold."""
    meshes = []
    for mesh in standard.scene.meshes:
        colors = np.round(255 * mesh.colors).astype(np.uint8)
        meshes.append(mesh.replaced(colors=colors, color_mode=mesh.color_mode))
    background = tuple(round(255 * channel) / 255 for channel in standard.background)
    return dataclasses.replace(standard, scene=ab.Scene(meshes), background=background)


def measured(standard, devices, arguments):
    """Rows of a scene, and a line on it."""
    size = tuple(arguments.size)
    look = {"width": size[0], "height": size[1]}
    precise = look | {"precision": "float64", "fragments": "count"}
    exact = ab.render(standard.scene, standard.camera, background=standard.background, **precise)
    white = [mesh.replaced(colors=(1, 1, 1, 1)) for mesh in standard.scene.meshes]
    covered = ab.render(white, standard.camera, **precise).image[..., 3] > 0.5
    band = edge_band(standard.scene, standard.camera, *size, CLOSE)

    def judged(image):
        off = np.abs(image - exact.image)[..., :3]
        return {"errors": sizes_of(off), "errors_off_edges": sizes_of(off[~band])}

    rows = []
    for device in devices:
        told = {"methods": OURS[device], "devices": [device], "repeats": arguments.repeats}
        compared = ab.compare(standard, **look, **told)
        for row in compared.rows:
            own = ROW | {"renderer": f"{row['label']}, {device}", "device": row["device"], "failure": row["failure"]}
            own |= {"ms": [row["wall_ms_q1"], row["wall_ms"], row["wall_ms_q3"]], "frames": row["frames"]}
            image = compared.rendered.get((row["scene"], row["device"], row["label"]))
            rows.append(own if image is None else own | judged(image))
    for peer in arguments.peers:
        own, found = by_peer(peer, standard, size, arguments)
        if found is not None:
            own |= {"coverage_differs": int((found.covered != covered).sum())} | judged(found.image)
        rows.append(own)
    stats = exact.stats
    said = f"{stats.fragments:,} fragments, {stats.max_depth_complexity} at most in a pixel"
    return [{"scene": standard.name} | row for row in rows], f"{said}; {band.mean():.1%} of pixels are near an edge"


def by_peer(peer, standard, size, arguments):
    """A peer's row without errors, and what it drew; of one that cannot, its failure and None."""
    path, _, variant = peer.partition(":")
    own = ROW | {"renderer": f"{Path(path).stem}, {variant}" if variant else Path(path).stem}
    told = {"repeats": arguments.repeats, "timeout": arguments.timeout, "wheels": arguments.wheels}
    try:
        arrays = arrays_of(standard.scene, standard.camera, size, standard.background)
        found = drawn(path, variant, arrays, **told)
    except RuntimeError as error:
        return own | {"failure": str(error)}, None
    quartiles = np.quantile(found.ms, (0.25, 0.5, 0.75)).tolist()
    said = {name: getattr(found, name) for name in ("device", "version", "notes")}
    return own | said | {"ms": quartiles, "frames": len(found.ms)}, found


def table(rows, base_name):
    """A scene's lines in markdown; errors in 1/255, times also divided by those of the renderer `base_name`."""
    base = next((row["ms"][1] for row in rows if row["renderer"] == base_name and not row["failure"]), math.nan)
    head = ["renderer", "device", "ms, median (quartiles)", f"÷ {base_name}"]
    head += [f"{what}{where}" for where in ("", ", off edges") for what in ("RMSE", "max", "over 1/255")]
    return lines_of([*head, "pixels covered otherwise"], [_cells(row, base, len(head) + 1) for row in rows])


def _cells(row, base, count):
    if row["failure"]:
        said = "cannot: " + row["failure"].strip().splitlines()[-1].replace("|", "/")
        return [row["renderer"], row["device"], said, *[""] * (count - 3)]
    low, middle, high = row["ms"]
    few = "" if row["frames"] >= 5 else f", frames: {row['frames']}"
    cells = [row["renderer"], row["device"], f"{_ms(middle)} ({_ms(low)}–{_ms(high)}{few})", f"{middle / base:.2f}"]
    for found in (row["errors"], row["errors_off_edges"]):
        cells += [f"{255 * found['rmse']:.3f}", f"{255 * found['max_abs']:.2f}", f"{found['over_1_255']:.2%}"]
    return [*cells, row.get("coverage_differs", "")]


def _ms(ms):
    return f"{ms:.1f}" if ms < 100 else f"{ms:,.0f}"


def peers_of(rows):
    """What each peer is, and what could not be turned off."""
    found = {row["renderer"]: row for row in rows if row["version"]}
    cells = [[row[column] for column in ("renderer", "version", "device", "notes")] for row in found.values()]
    return lines_of(["peer", "version", "device", "what could not be turned off, or was patched"], cells)


def told(where, arguments):
    """Where and how it was measured."""
    frames = [len(arguments.scenes), arguments.repeats, *arguments.size]
    devices = ", ".join(where["devices"])
    return [
        f"abuffer {where['abuffer']}, {where['processor']}, {where['date'][:10]}; devices {devices}.",
        f"{frames[0]} scenes; medians of {frames[1]} frames of {frames[2]}×{frames[3]}; errors in 1/255.",
    ]


if __name__ == "__main__":
    main()
