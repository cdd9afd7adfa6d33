"""What a limit on sorted fragments leaves out, by either policy: exact, the nearest 4, the last submitted 4.

Seven petals lie at seven depths, and a star in front of them all is submitted first. The four nearest fragments of a
pixel hold nearly all of its colour. The four that were submitted last hold the star only where three petals or fewer
are behind it, so that it is cut out where they overlap.
"""

import argparse
import colorsys
import dataclasses
from pathlib import Path

import numpy as np

import abuffer as ab

LIMIT = 4
PETALS = 7
POLICIES = ("nearest", "last_submitted")
# Each way, for smooth edges. Not samples=: the limit is of a pixel's fragments, and where two triangles of a petal meet
# in a pixel there are two.
SUPERSAMPLING = 4


def petal(radius, center, depth, rgba):
    rim = around(np.linspace(0, 2 * np.pi, 129)) * radius + center
    return fan(center, rim, depth, rgba)


def star(depth, rgba):
    """Tips and notches in turn, the first tip on top."""
    corner = np.arange(11)
    rim = around(np.pi / 2 + corner * np.pi / 5) * np.where(corner % 2, 0.42, 0.95)[:, None]
    return fan((0, 0), rim, depth, rgba)


def around(angles):
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def fan(center, rim, depth, rgba):
    """Triangles from a centre to each pair of neighbours on a closed rim."""
    corners = np.stack([np.broadcast_to(center, rim[1:].shape), rim[:-1], rim[1:]], axis=1)
    z = np.full((*corners.shape[:2], 1), -float(depth))
    return ab.Mesh(np.concatenate([corners, z], axis=-1), colors=rgba)


def build():
    """The star, nearest and first; then the petals, each behind the one before."""
    meshes = [star(0, (0.13, 0.13, 0.35, 0.8))]
    for i in range(PETALS):
        angle = 2 * np.pi * i / PETALS
        center = 0.5 * np.array([np.sin(angle), np.cos(angle)])
        rgb = colorsys.hsv_to_rgb(i * 3 / PETALS % 1, 0.75, 0.95)
        meshes.append(petal(0.62, center, 1 + i, (*rgb, 0.5)))
    return meshes


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, default=320, help="pixels of a panel's side")
    parser.add_argument("--output", type=Path, default=Path("out/limit_policy.png"))
    args = parser.parse_args()

    camera = ab.Camera.orthographic((0, 0, 1), (0, 0, 0), height=2.4)
    size = args.size * SUPERSAMPLING
    look = {"width": size, "height": size, "background": (0.97, 0.97, 0.98), "device": "cpu"}
    scene = build()
    exact = ab.render(scene, camera, **look)
    panels = [exact.image]
    print(exact.stats)
    for policy in POLICIES:
        frame = ab.render(scene, camera, max_sorted_fragments=LIMIT, limit_policy=policy, **look)
        again = ab.render(scene[::-1], camera, max_sorted_fragments=LIMIT, limit_policy=policy, **look)
        panels.append(frame.image)
        print(
            f"{policy} {LIMIT}: {frame.stats.dropped_fragments:,} of {frame.stats.fragments:,} fragments ignored, "
            f"off by {np.abs(frame.image - exact.image).max():.2f} at most; "
            f"submitted in reverse, {np.abs(again.image - frame.image).max():.2f} from that"
        )
    args.output.parent.mkdir(parents=True, exist_ok=True)
    panels = np.concatenate(panels, axis=1)
    blocks = panels.reshape(args.size, SUPERSAMPLING, (1 + len(POLICIES)) * args.size, SUPERSAMPLING, 4)
    dataclasses.replace(exact, image=blocks.mean(axis=(1, 3))).save(args.output)
    print(f"{args.output.resolve()}: {3 * args.size}×{args.size}")


if __name__ == "__main__":
    main()
