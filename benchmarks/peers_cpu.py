"""The CPU's tiles beside moderngl on the same cores, by Mesa's llvmpipe: plain blending, and a naive A-buffer.

    python benchmarks/peers_cpu.py [--repeats 25] [--model dragon_vrip_res2.ply] [--json out.json] [--markdown out.md]

Four kinds of scene at 512×512, with everything prebuilt on either side: a frame is one call that returns an image in
numpy. Frames take turns; medians, and medians over turns of ratios. Needs benchmarks/requirements-peers.txt, and EGL.
"""

import argparse
import json
import os
import statistics
import time
from pathlib import Path

import named
import numpy as np
from peers_gl import LONGEST, LinkedLists, PlainBlending, context
from report import lines_of

import abuffer as ab
from scenes import random_triangles

SIZE = (512, 512)
DISTANCE, FOV_Y, NEAR, FAR = 4, 40, 1, 10
BACKGROUND = (51 / 255, 77 / 255, 102 / 255, 1)
OURS, BLENDING, LISTS = "abuffer, CPU", "plain blending", "linked lists"
# The A-buffer's colours are half floats; edges may snap to either side.
CHANGED, ALLOWED = 1 / 255, 0.002
WARM_UP = 8  # rounds


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=25)
    parser.add_argument("--model", help="a file for D; None: the Stanford bunny that comes with pymeshfix")
    parser.add_argument("--json", help="a file for all times")
    parser.add_argument("--markdown", help="a file for the tables")
    arguments = parser.parse_args()
    gl = context()
    kinds = {
        "A: 64 large triangles, a mesh each": lambda: triangles(64, 0.1, 1.2),
        "B: 8 nested icospheres": spheres,
        "C: 20,000 triangles": lambda: triangles(20_000, 1.45, 0.16),
        f"D: {Path(arguments.model or 'StanfordBunny.ply').name}": lambda: model(arguments.model),
    }
    rows = [measure(gl, name, make(), arguments.repeats) for name, make in kinds.items()]
    ratios = [f"{peer} ÷ ours" for peer in (BLENDING, LISTS)]
    head = ["scene", "triangles", "fragments", "deepest", *(f"{name}, ms" for name in rows[0]["ms"]), *ratios]
    head += [f"image of {peer} against ours" for peer in (LISTS, BLENDING)]
    lines = [
        [r["scene"], f"{r['triangles']:,}", f"{r['fragments']:,}", r["deepest"]]
        + [f"{ms:.2f}" for ms in r["ms"].values()]
        + [f"{r['ratio'][peer]:.2f}" for peer in (BLENDING, LISTS)]
        + [said(r["off"][peer]) for peer in (LISTS, BLENDING)]
        for r in rows
    ]
    first = first_row(gl, arguments.repeats)
    columns = ["20k of ~20 px, 1280×720", "ms, median", "÷ ours"]
    text = [
        f"{gl.info['GL_RENDERER']}, OpenGL {gl.info['GL_VERSION']}; {os.cpu_count()} cores.",
        f"Medians of {arguments.repeats}.",
        "",
        *lines_of(head, lines),
        "",
        *lines_of(columns, [[name, f"{ms:.2f}", f"{ratio:.2f}"] for name, (ms, ratio) in first.items()]),
    ]
    print(*text, sep="\n")
    if arguments.markdown:
        with open(arguments.markdown, "w") as file:
            file.write("\n".join(text) + "\n")
    if arguments.json:
        with open(arguments.json, "w") as file:
            json.dump(
                {"device": [gl.info["GL_RENDERER"], gl.info["GL_VERSION"]], "rows": rows, "20k of ~20 px": first},
                file,
                indent=1,
            )


def measure(gl, name, scene, repeats):
    """One row: the three in turns, and how their images differ."""
    camera = ab.Camera.look_at((0, 0, DISTANCE), (0, 0, 0), fov_y=FOV_Y, near=NEAR, far=FAR)
    width, height = SIZE

    def ours():
        return ab.render(scene, camera, width=width, height=height, background=BACKGROUND, device="cpu")

    frame = ours()
    arrays, clip = joined(scene), clip_matrix()
    sides = {
        OURS: lambda: ours().image,
        BLENDING: PlainBlending(gl, arrays, clip, SIZE, BACKGROUND),
        LISTS: LinkedLists(gl, arrays, clip, SIZE, BACKGROUND, frame.stats.fragments * 101 // 100 + 1000),
    }
    assert frame.stats.max_depth_complexity <= LONGEST, "the naive A-buffer has no room for that"
    images = {peer: image() for peer, image in sides.items()}
    times = in_turns(sides, repeats)
    off = {peer: difference(images[peer], frame.image) for peer in (BLENDING, LISTS)}
    assert off[LISTS]["changed"] < ALLOWED, f"{name}: the linked lists are off in {off[LISTS]['changed']:.2%} of pixels"
    return {
        "scene": name,
        "triangles": scene.triangle_count,
        "fragments": frame.stats.fragments,
        "deepest": frame.stats.max_depth_complexity,
        "ms": {peer: statistics.median(ms) for peer, ms in times.items()},
        "ratio": {peer: ratio(ms, times[OURS]) for peer, ms in times.items()},
        "off": off,
        "all ms": times,
    }


def first_row(gl, repeats):
    """Plain blending of the first of the random scenes, into half floats as on GPUs, against the CPU's tiles.

    llvmpipe's timestamps in Vulkan do for a draw but not for tiles, and its tiles hold too few layers for this scene:
    so this is OpenGL's llvmpipe, wall time until the draw has ended, with and without the image in numpy.
    """
    mesh, camera, width, height = random_triangles("20k of ~20 px")
    view = np.diag([2 / width, 2 / height, -2, 1.0])  # z from 0 to −1: all of it inside
    view[2, 3] = -1
    colors = np.repeat(np.round(255 * mesh.colors), 3, axis=0)
    arrays = mesh.positions.reshape(-1, 3), np.arange(len(colors)).reshape(-1, 3), colors
    blending = PlainBlending(gl, arrays, view, (width, height), (0, 0, 0, 0), dtype="f2")

    def drawn():
        blending.draw()
        gl.finish()

    scene = ab.Scene([mesh])
    sides = {
        OURS: lambda: ab.render(scene, camera, width=width, height=height, device="cpu").image,
        f"{BLENDING}, drawn": drawn,
        f"{BLENDING}, image in numpy": blending,
    }
    for image in sides.values():
        image()
    covered = np.mean((blending()[..., 3] > 0) == (sides[OURS]()[..., 3] > 0))
    assert covered > 1 - ALLOWED, "plain blending covers other pixels"
    times = in_turns(sides, repeats)
    return {name: (statistics.median(ms), ratio(ms, times[OURS])) for name, ms in times.items()}


def in_turns(sides, repeats):
    """Milliseconds of each, in turns; rounds before them, whose memory is new to the process, are not counted."""
    times = {name: [] for name in sides}
    for turn in range(-WARM_UP, repeats):
        for name, call in sides.items():
            start = time.perf_counter()
            call()
            if turn >= 0:
                times[name].append((time.perf_counter() - start) * 1e3)
    return times


def ratio(ms, base):
    return statistics.median(a / b for a, b in zip(ms, base, strict=True))


def difference(image, ours):
    """How an image differs, in steps of 255, and the share of pixels by more than one."""
    image = image / 255 if image.dtype == np.uint8 else image
    off = np.abs(image - ours)[..., :3]
    return {"changed": float((off.max(axis=-1) > CHANGED).mean()), "rmse": float(255 * np.sqrt((off**2).mean()))}


def said(off):
    return f"RMSE {off['rmse']:.3f}/255, {off['changed']:.2%} of pixels off by > 1/255"


def clip_matrix():
    """World to clip space of this camera, with OpenGL's depths."""
    cotangent = 1 / np.tan(np.radians(FOV_Y) / 2)
    depth = [[0, 0, (FAR + NEAR) / (NEAR - FAR), 2 * FAR * NEAR / (NEAR - FAR)], [0, 0, -1, 0]]
    view = np.eye(4)
    view[2, 3] = -DISTANCE
    return np.array([[cotangent * SIZE[1] / SIZE[0], 0, 0, 0], [0, cotangent, 0, 0], *depth]) @ view


def joined(scene):
    """All meshes as (positions, faces, colors a vertex)."""
    first = np.cumsum([0, *(len(mesh.positions) for mesh in scene.meshes)])
    positions = np.concatenate([mesh.positions for mesh in scene.meshes])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(scene.meshes, first, strict=False)])
    return positions, faces, np.concatenate([np.round(255 * mesh.colors) for mesh in scene.meshes])


def triangles(count, spread, size):
    """Random triangles, each of one colour: a mesh each where there are few."""
    rng = np.random.default_rng(0)
    positions = rng.uniform(-spread, spread, (count, 1, 3)) + rng.uniform(-size, size, (count, 3, 3))
    colors = np.column_stack([rng.integers(0, 256, (count, 3)), rng.integers(40, 160, count)]).astype(np.uint8)
    groups = np.array_split(np.arange(count), count if count < 100 else 1)
    return ab.Scene([_vertices(positions[g].reshape(-1, 3), None, np.repeat(colors[g], 3, axis=0)) for g in groups])


def spheres():
    """Nested icospheres of 5,120 triangles, the innermost first, alpha 77/255."""
    vertices, faces = named.icosphere(4)
    colors = np.random.default_rng(0).integers(0, 256, (8, 3))
    return ab.Scene(
        [
            _vertices(vertices * radius, faces, np.tile((*color, 77), (len(vertices), 1)).astype(np.uint8))
            for radius, color in zip(np.linspace(0.24, 1.09, 8), colors, strict=True)
        ]
    )


def model(path):
    """A scan whose colours are its normals, alpha 128/255."""
    positions, faces = named.model(path) if path else named.bunny()
    corners = positions[faces].swapaxes(0, 1)
    normals = np.zeros(positions.shape)
    np.add.at(normals, faces, np.cross(corners[1] - corners[0], corners[2] - corners[0])[:, None])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    colors = np.column_stack([np.round(127.5 * (normals + 1)), np.full(len(normals), 128)]).astype(np.uint8)
    return ab.Scene([_vertices(positions * 2.4, faces, colors)])


def _vertices(positions, faces, colors):
    if faces is None:
        faces = np.arange(len(positions)).reshape(-1, 3)
    return ab.Mesh(positions.astype(np.float32), faces, colors, color_mode="vertex")


if __name__ == "__main__":
    main()
