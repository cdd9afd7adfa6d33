"""Three translucent bunnies standing in each other, and an opaque ring through all of them.

No order of whole objects paints this picture right. Here the meshes and their faces are even shuffled: every pixel
sorts what it sees, so the picture is the same whatever --seed says.
"""

import argparse
import dataclasses
import importlib.util
from pathlib import Path

import numpy as np
import trimesh

import abuffer as ab

EYE, TARGET = np.array([6, -150, 50]), np.array([0.5, 0, 19.5])  # Z is up
LIGHT = (-0.5, -0.6, 0.8)
SUPERSAMPLING = 3  # each way: smooth edges
# Colour (over 1, since shading darkens it), which way it looks, and where it stands.
BUNNIES = [((0.0, 0.62, 1.4), 25, (-23, 7)), ((1.45, 0.2, 0.32), -5, (1, -5)), ((1.45, 0.95, 0.0), 158, (25, 7))]


def bunny():
    """The Stanford bunny, 99,785 faces, 50 units long. It comes with pymeshfix, which need not be imported."""
    package = importlib.util.find_spec("pymeshfix")
    if package is None:
        raise SystemExit("the bunny comes with pymeshfix: pip install pymeshfix")
    return trimesh.load(Path(package.origin).parent / "examples" / "StanfordBunny.ply", process=False)


def glass(shape, rgb):
    """A thin shell: nearly clear where it faces the eye, nearly solid where the eye grazes it."""
    corners = shape.vertices[shape.faces].swapaxes(0, 1)
    normals = np.zeros(shape.vertices.shape)
    np.add.at(normals, shape.faces, np.cross(corners[1] - corners[0], corners[2] - corners[0])[:, None])
    to_eye = EYE - shape.vertices
    lengths = np.linalg.norm(normals, axis=1) * np.linalg.norm(to_eye, axis=1)
    facing = np.abs((normals * to_eye).sum(axis=1)) / np.maximum(lengths, 1e-30)
    colors = np.column_stack([np.tile(rgb, (len(facing), 1)), 0.22 + 0.73 * (1 - facing) ** 2])
    return ab.Mesh(shape.vertices, shape.faces, colors, color_mode="vertex")


def shadow(x, y, height):
    """A sphere pressed flat, fading towards its rim."""
    sphere = trimesh.creation.icosphere(subdivisions=5)
    fading = 0.16 * sphere.vertices[:, 2] ** 2
    colors = np.column_stack([np.tile((0.1, 0.12, 0.2), (len(fading), 1)), fading])
    return ab.Mesh(sphere.vertices * (32, 24, 0) + (x, y, height), sphere.faces, colors, color_mode="vertex")


def build(rng):
    scene, turn, model = ab.Scene(), trimesh.transformations.rotation_matrix, bunny()
    for i, (rgb, angle, (x, y)) in enumerate(BUNNIES):
        pose = trimesh.transformations.translation_matrix((x, y, 0)) @ turn(np.radians(angle), (0, 0, 1))
        scene.add(glass(model.copy().apply_transform(pose), rgb), shade=LIGHT)
        scene.add(shadow(x, y, -0.1 * i))  # one above the other: which one is in front is no accident
    ring = trimesh.creation.torus(28, 2, major_sections=192, minor_sections=64)
    ring.apply_transform(trimesh.transformations.translation_matrix((0, 3, 20)) @ turn(np.radians(34), (1, 0.3, 0)))
    scene.add(ab.Mesh(ring.vertices, ring.faces, (0.97, 0.96, 0.94), opaque=True), shade=LIGHT)
    meshes = [mesh.replaced(faces=rng.permutation(mesh.faces)) for mesh in scene.meshes]
    return ab.Scene([meshes[i] for i in rng.permutation(len(meshes))])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--width", type=int, default=1280)
    parser.add_argument("--height", type=int, default=720)
    parser.add_argument("--output", type=Path, default=Path("out/demo.png"))
    parser.add_argument("--seed", type=int, default=0, help="of the order in which faces and meshes are given")
    args = parser.parse_args()

    scene = build(np.random.default_rng(args.seed))
    frame = ab.render(
        scene,
        ab.Camera.look_at(EYE, TARGET, up=(0, 0, 1), fov_y=25),
        width=args.width * SUPERSAMPLING,
        height=args.height * SUPERSAMPLING,
        background=(0.95, 0.96, 0.98),
        fragments="count",
        precision="float64",  # in float32 the scan touches itself in a dozen of 8 million pixels: tied, the last in front
    )
    print(f"{scene.triangle_count:,} triangles, {frame.stats}")

    # Colours may exceed 1; what can be shown may not. Cut before the mean, or bright edges would be jagged.
    blocks = frame.image.clip(0, 1).reshape(args.height, SUPERSAMPLING, args.width, SUPERSAMPLING, 4)
    picture = dataclasses.replace(frame, image=blocks.mean(axis=(1, 3)), counts=None)
    args.output.parent.mkdir(parents=True, exist_ok=True)
    picture.save(args.output)
    print(f"{args.output.resolve()}: {args.width}×{args.height}")


if __name__ == "__main__":
    main()
