"""Scenes of many triangles, of kinds that occur. Their images have no closed form."""

import numpy as np

from .. import _check
from ..scene import Scene
from .shapes import (
    around,
    bell,
    between,
    fans,
    hue,
    lit,
    mesh,
    numbers,
    quads,
    rectangle,
    rgba,
    shuffled,
    sphere,
    strips,
)
from .standard import PAPER, StandardScene, count, seed_of, seen_from


def nested_spheres(n=5) -> StandardScene:
    """n spheres within each other, each of its own colour, the outermost submitted first, its triangles in random order.

    Hard for: blending without sorting, and sorting objects, whose middles are all at one depth.

    Known: a pixel that k spheres cover has 2k fragments, and in the middle 2n.

    Args:
        n: spheres.
    """
    n = count("n", n, high=100)
    vertices, faces = sphere(24)
    rng = numbers(2)
    meshes = []
    for k in range(n):
        radius = 1 - 0.85 * k / n
        colors = rgba(hue(np.float64(0.55 + 0.45 * k / n)) * lit(vertices), np.float64(0.2 + 0.3 * k / n))
        shell = faces[shuffled(rng, len(faces))]
        meshes.append(mesh(vertices * radius, shell, colors, color_mode="vertex", name=f"sphere {k}"))
    return StandardScene(
        name="nested_spheres",
        scene=Scene(meshes),
        camera=seen_from(6, focal=4.8, azimuth=(0.28, 0.96), elevation=(0.28, 0.96)),
        background=PAPER,
        hard_for="blending without sorting, and sorting objects: all have the same middle",
    )


def random_triangles(n=2000, size=0.1, seed=0) -> StandardScene:
    """n triangles in a cube, in a random order, of random colours and alphas of 0.2 to 0.8.

    Hard for: nothing in particular, and so for all: lists of every length, in every order.

    Args:
        n: triangles.
        size: corners are at most this far from a triangle's middle, along each axis; the cube's side is 1.
        seed: of another scene of the kind.
    """
    n, size = count("n", n), _check.number("size", size, 0, open_ends=True)
    rng = numbers(seed_of(seed))
    corners = between(rng, -0.5, 0.5, (n, 1, 3)) + between(rng, -size, size, (n, 3, 3))
    colors = rgba(hue(rng.random(n)), between(rng, 0.2, 0.8, n))
    return StandardScene(
        name="random_triangles",
        scene=Scene([mesh(corners, None, colors, color_mode="face")]),
        camera=seen_from(3, focal=3.7, azimuth=(0.6, 0.8), elevation=(5 / 13, 12 / 13)),
        background=PAPER,
        hard_for="nothing in particular, and so for all: lists of every length, in every order",
    )


def opaque_and_glass() -> StandardScene:
    """Opaque balls on an opaque floor, panes of glass between, before and behind them, and one through a ball.

    Hard for: order that stops at what is opaque: nothing behind it may show, and all before it must. Where a ball's edge
    passes behind a pane, what is behind the pane changes within a pixel.
    """
    vertices, faces = sphere(24)
    tiles = [(i, j) for i in range(-6, 6) for j in range(-6, 6)]
    floor = np.array([[(i, 0, j + 1), (i + 1, 0, j + 1), (i + 1, 0, j), (i, 0, j)] for i, j in tiles]) * 0.5
    grey = np.array([0.85 if (i + j) % 2 else 0.6 for i, j in tiles])
    meshes = [quads(floor, rgba(grey[:, None] * np.ones(3), np.float64(1)), opaque=True, name="floor")]
    balls = [((-1.1, 0.6, -0.2), 0.6, 0.02), ((0.35, 0.45, 0.7), 0.45, 0.12), ((1.1, 0.7, -0.9), 0.7, 0.58)]
    for center, radius, turn in balls:
        colors = rgba(hue(np.float64(turn)) * lit(vertices), np.float64(1))
        meshes.append(
            mesh(vertices * radius + np.array(center), faces, colors, color_mode="vertex", opaque=True, name="ball")
        )
    # Left end, right end, height, hue: each stands on the floor.
    panes = [
        ((-2.2, 0.9), (-0.3, 1.1), 1.3, 0.5),
        ((-0.5, 1.5), (1.5, 0.9), 0.9, 0.33),
        ((-1.9, -0.7), (0.5, 0.5), 1.7, 0.12),
        ((0.2, -0.4), (2.2, -1.0), 1.9, 0.9),
        ((-2.1, -1.4), (1.3, -1.7), 2.3, 0.62),
    ]
    for (x0, z0), (x1, z1), top, turn in panes:
        corners = np.array([[(x0, 0.0, z0), (x1, 0.0, z1), (x1, top, z1), (x0, top, z0)]])
        meshes.append(quads(corners, rgba(hue(np.array([turn])) * 0.9, np.float64(0.4)), name="pane"))
    return StandardScene(
        name="opaque_and_glass",
        scene=Scene(meshes),
        camera=seen_from(8, focal=4.2, target=(0, 0.75, 0), azimuth=(-0.28, 0.96), elevation=(0.28, 0.96)),
        background=(0.80, 0.87, 0.94),
        hard_for="what hides: nothing behind an opaque body may show, and all before it must",
    )


def hair(strands=2000, seed=0) -> StandardScene:
    """Strands that fall from a crown, thinner than a pixel at 480×360, facing the viewer.

    Hard for: coverage, since the centres of pixels miss most of the strands; and lists of a fixed length, since strands
    crowd, at nearly one depth.

    Args:
        strands: of 24 segments each.
        seed: of another scene of the kind.
    """
    strands = count("strands", strands, high=100_000)
    rng = numbers(seed_of(seed))
    steps = 24
    c, s = around(rng.random(strands))
    out = np.sqrt(rng.random(strands))
    root = np.stack([0.5 * out * c, 0.55 + 0.25 * np.sqrt(1 - 0.9 * out * out), 0.5 * out * s], axis=-1)
    away = np.stack([c, 0.9 - out, s], axis=-1) * (0.35 + 0.35 * out)[:, None]
    tip = np.stack([0.75 * c * out, 0 * c - between(rng, 0.7, 0.9, strands), 0.6 * s * out], axis=-1)
    points_of = [root, root + away, tip + np.array([0, 0.7, 0]) * (0.6 + 0.8 * rng.random(strands))[:, None], tip]
    points_of = [p + 0.04 * bell(rng, (strands, 3)) for p in points_of]
    t = (np.arange(steps + 1) / steps)[None, :, None]
    u = 1 - t
    a, b, d, e = (p[:, None] for p in points_of)
    points = u * u * u * a + 3 * u * u * t * b + 3 * u * t * t * d + t * t * t * e
    # A wave along each strand, of its own phase and size.
    cw, sw = around(between(rng, 0, 1, (strands, 1)) + between(rng, 1.5, 3, (strands, 1)) * t[..., 0])
    points = points + 0.06 * t * np.stack([cw, 0 * cw, sw], axis=-1)
    tone = between(rng, 0.0, 1.0, (strands, 1, 1))
    brown = np.array([0.30, 0.14, 0.06]) * (1 - tone) + np.array([0.95, 0.60, 0.28]) * tone
    gloss = 1 - 3 * np.abs(t - 0.3)
    rgb = np.clip(brown * (0.75 + 0.25 * t) + 0.25 * np.maximum(gloss, 0), 0, 1)
    widths = 0.004 * np.sqrt(1 - 0.9 * t[..., 0]) * np.ones((strands, 1))
    return StandardScene(
        name="hair",
        scene=Scene([strips(points, widths, rgba(rgb, np.full((strands, steps + 1), 0.5)))]),
        camera=seen_from(6, focal=6.0),
        background=(0.93, 0.92, 0.90),
        hard_for="coverage of what is thinner than a pixel, and lists of a fixed length where strands crowd",
    )


def smoke(n=400, seed=0) -> StandardScene:
    """Puffs that face the viewer, of one family of colours, whose alpha falls to 0 at the rim.

    Hard for: lists of a fixed length: many fragments, each of which changes little. Easy for sums, since colours are
    nearly equal: what is cheap is good enough here.

    Args:
        n: puffs.
        seed: of another scene of the kind.
    """
    n = count("n", n, high=100_000)
    rng = numbers(seed_of(seed))
    up = rng.random(n)
    spread = 0.10 + 0.38 * up
    x = -0.55 + 1.15 * up * up + 0.45 * spread * bell(rng, n)
    y = -0.95 + 1.75 * up + 0.20 * spread * bell(rng, n)
    z = 0.8 * spread * bell(rng, n)
    radii = (0.08 + 0.30 * up) * between(rng, 0.7, 1.3, n)
    # Lighter above and towards the light, darker below.
    tone = np.clip(0.42 + 0.40 * up + 0.06 * bell(rng, n) - 0.25 * (x + 0.55 - 1.15 * up * up), 0.1, 1)
    rgb = tone[:, None] * np.array([1.0, 0.96, 0.92])
    inner = rgba(rgb, (0.30 - 0.20 * up) * between(rng, 0.6, 1.4, n))
    outer = rgba(rgb, np.zeros(n))
    return StandardScene(
        name="smoke",
        scene=Scene([fans(np.stack([x, y, z], axis=-1), radii, inner, outer)]),
        camera=seen_from(6, focal=5.6),
        background=(0.16, 0.22, 0.32),
        hard_for="lists of a fixed length: many fragments that each change little; sums do well here",
    )


def hdr_lights(seed=0) -> StandardScene:
    """Lamps of radiance up to 10,000 in soft halos, among dim surfaces and behind dark glass.

    Hard for: sums in 16 bits, which overflow; random draws, which make fireflies; and every comparison of images by
    absolute differences: a thousandth of a lamp is ten times white. Compare relative errors.

    Args:
        seed: of another scene of the kind.
    """
    rng = numbers(seed_of(seed))
    vertices, faces = sphere(16)
    lamps = 9
    places = np.stack(
        [(np.arange(lamps) % 3 - 1) * 0.85, 0.55 - 0.55 * (np.arange(lamps) // 3), 0 * np.arange(lamps)], 1
    )
    places = places + between(rng, -0.12, 0.12, (lamps, 3)) * np.array([1, 1, 5])
    radiance = np.array([1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0, 10000.0])[shuffled(rng, lamps)]
    cold = rng.random((lamps, 1))
    tints = np.array([1.0, 0.75, 0.4]) * (1 - cold) + np.array([0.4, 0.65, 1.0]) * cold
    tints = tints / tints.max(axis=1, keepdims=True)
    wall = quads(rectangle(-3, -2, 3, 2, -1.2)[None], [(0.05, 0.05, 0.06, 1)], opaque=True, name="wall")
    meshes = [wall]
    for place, tint, light in zip(places, tints, radiance, strict=True):
        colors = rgba(np.broadcast_to(tint * light, vertices.shape), np.float64(0.8))
        meshes.append(mesh(vertices * 0.09 + place, faces, colors, color_mode="vertex", name="lamp"))
    # The brighter a lamp, the wider its halo, and the thinner: at its middle it adds what white does.
    thin = np.minimum(0.5, 0.8 / radiance)
    meshes.append(
        fans(
            places + np.array([0, 0, 0.1]),
            np.sqrt(np.sqrt(radiance)) * 0.05 + 0.1,
            rgba(tints * radiance[:, None], thin),
            rgba(tints * radiance[:, None], 0 * thin),
            sides=64,
        )
    )
    # Dim panes across, tilted both ways.
    for k in range(6):
        x = -1.5 + 0.6 * k
        corners = np.array(
            [[(x - 0.35, -1.1, 0.8), (x + 0.25, -1.1, -0.7), (x + 0.35, 1.1, -0.8), (x - 0.25, 1.1, 0.7)]]
        )
        meshes.append(quads(corners, rgba(0.2 * hue(np.array([k / 6])), np.float64(0.5)), name="glass"))
    return StandardScene(
        name="hdr_lights",
        scene=Scene(meshes),
        camera=seen_from(6, focal=5.4),
        background=(0.03, 0.035, 0.05),
        hard_for="sums in 16 bits, random draws, and measures of absolute error: radiance goes to 10,000",
    )
