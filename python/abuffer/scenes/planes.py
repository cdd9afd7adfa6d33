"""Scenes of flat panes, whose image has a closed form."""

import math

import numpy as np

from ..scene import Scene
from .shapes import numbers, quads, rectangle, rgba, shuffled
from .standard import FRONT, PAPER, StandardScene, count, fraction, seen_from

ORANGE, BLUE, GREEN, YELLOW = (1.0, 0.5, 0.0), (0.0, 0.375, 1.0), (0.125, 0.75, 0.375), (1.0, 0.875, 0.125)
FAR = 8.0  # from the middle: images of up to eight times their height are covered
MARGIN = 0.75  # pixels from an edge, or from where two panes cross, that a closed form leaves out


def stack(n=16, alpha=0.5) -> StandardScene:
    """n parallel sheets over the whole view, submitted in a random order, in three bands.

    Hard for: whatever has a limit of layers, and sums that round. All else should get it right, so that a method which
    does not has a mistake.

    Closed form, with r = 1 − α, over black: on the left white sheets, 1 − rⁿ. In the middle orange and blue in turn, orange
    first: α(1 − r^(2⌈n/2⌉)) / (1 − r²) of orange, and r·α(1 − r^(2⌊n/2⌋)) / (1 − r²) of blue. On the right each sheet has
    half the light of the one before it: α(1 − (r/2)ⁿ) / (1 − r/2).

    Args:
        n: sheets.
        alpha: of each.
    """
    n, alpha = count("n", n, high=20_000), fraction("alpha", alpha)
    third = 1 / 2.25  # of an image of 4 to 3
    bands = [(-FAR, -third), (-third, third), (third, FAR)]
    sheets = []
    for k in range(n):
        colors = [(1.0, 1.0, 1.0), (ORANGE, BLUE)[k % 2], (0.5 ** min(k, 140),) * 3]
        corners = [rectangle(left, -FAR, right, FAR, 5 - 10 * (k + 0.5) / n) for left, right in bands]
        sheets.append(quads(corners, rgba(colors, alpha), name=f"sheet {k}"))
    r = 1 - alpha
    first = alpha * _geometric(r * r, -(-n // 2))
    second = alpha * r * _geometric(r * r, n // 2)
    closed = [
        np.full(3, _over(alpha, n)),
        first * np.array(ORANGE) + second * np.array(BLUE),
        np.full(3, alpha * _geometric(r / 2, n)),
    ]
    order = shuffled(numbers(0), n)
    return StandardScene(
        name="stack",
        scene=Scene([sheets[k] for k in order]),
        camera=FRONT,
        background=(0.0, 0.0, 0.0),
        hard_for="limits of layers and sums that round: all else should get it right",
        expected=lambda width, height: _bands(width, height, [-third, third], closed),
    )


def thin_sheets(n=256, alpha=0.02) -> StandardScene:
    """Hundreds of nearly transparent sheets over the whole view, the nearest sixteenth of another colour than the others.

    Hard for: weights by depth, which make more of the nearest sheets than they cover; and targets of 8 bits, where a
    fragment that changes a channel by less than 1/510 changes nothing.

    Closed form, with r = 1 − α and m = ⌊n/16⌋, at least 1, over black: 1 − rᵐ of the near colour, rᵐ − rⁿ of the far one.
    On the left those are yellow and blue, on the right blue and orange.

    Args:
        n: sheets, at least 2.
        alpha: of each.
    """
    n, alpha = count("n", n, low=2, high=20_000), fraction("alpha", alpha)
    bands = [(-FAR, 0.0), (0.0, FAR)]
    near, far, m = (YELLOW, BLUE), (BLUE, ORANGE), max(n // 16, 1)
    sheets = []
    for k in range(n):
        corners = [rectangle(left, -FAR, right, FAR, 9 - 18 * k / (n - 1)) for left, right in bands]
        sheets.append(quads(corners, rgba(near if k < m else far, np.full(2, alpha)), name=f"sheet {k}"))
    through = [1 - _over(alpha, k) for k in (m, n)]
    closed = [
        _over(alpha, m) * np.array(first) + (through[0] - through[1]) * np.array(then)
        for first, then in zip(near, far, strict=True)
    ]
    order = shuffled(numbers(1), n)
    return StandardScene(
        name="thin_sheets",
        scene=Scene([sheets[k] for k in order]),
        camera=FRONT,
        background=(0.0, 0.0, 0.0),
        hard_for="weights by depth, which make too much of the nearest, and targets of 8 bits, which stall",
        expected=lambda width, height: _bands(width, height, [0.0], closed),
    )


def intersecting() -> StandardScene:
    """Three translucent squares, each of which passes through the other two.

    Hard for: whatever sorts triangles or objects. On one side of a line in which two cross the one is in front, on the
    other side the other, so that no order of triangles is right.

    Closed form: in each part the three colours, nearest first, which the planes' depths at the pixel say.
    """
    side = 1.0
    x, y = rectangle(-side, -side, side, side)[:, :2].T
    zero = 0 * x
    corners = [np.stack(axes, axis=-1) for axes in ((x, zero, -y), (x, y, zero), (zero, y, -x))]
    camera = seen_from(5.5, focal=4.0, azimuth=(0.6, 0.8), elevation=(5 / 13, 12 / 13))
    return _panes(
        "intersecting",
        zip(corners, (GREEN, ORANGE, BLUE), (0.625,) * 3, strict=True),
        camera,
        "sorting triangles or objects: where two pass through each other no order of them is right",
    )


def cyclic() -> StandardScene:
    """Three bars, each over one of the others and under the other.

    Hard for: whatever sorts triangles or objects: none of the bars can be painted first.

    Closed form: where two cross, orange is over blue, blue over green, and green over orange.
    """
    length, low, high, slant = 0.9, -0.46, -0.14, 0.4
    bar = np.array([(-length, low, slant), (length, low, -slant), (length, high, -slant), (-length, high, slant)])
    third = np.sqrt(3.0) / 2  # the sine of a third of a turn, whose cosine is −1/2
    corners = []
    for c, s in ((1.0, 0.0), (-0.5, third), (-0.5, -third)):
        x, y, z = bar.T
        corners.append(np.stack([c * x - s * y, s * x + c * y - 0.2, z], axis=-1))  # the triangle's middle
    return _panes(
        "cyclic",
        zip(corners, (ORANGE, GREEN, BLUE), (0.75,) * 3, strict=True),
        FRONT,
        "sorting triangles or objects: each bar is over one of the others and under the other",
    )


def coplanar() -> StandardScene:
    """Squares in one plane: on the left orange and then blue in the same place, on the right blue and then orange.

    A yellow bar across both comes first of all, and a green one last.

    Hard for: whatever decides ties of depth by chance, or drops all but one of the fragments that tie.

    Closed form: at equal depth the later one is in front.
    """
    left, right = rectangle(-1.05, -0.75, -0.1, 0.75), rectangle(0.1, -0.75, 1.05, 0.75)
    first, last = rectangle(-1.2, -0.55, 1.2, -0.2), rectangle(-1.2, 0.2, 1.2, 0.55)
    corners = (first, left, left, right, right, last)
    colors = (YELLOW, ORANGE, BLUE, BLUE, ORANGE, GREEN)
    return _panes(
        "coplanar",
        zip(corners, colors, (0.625,) * len(corners), strict=True),
        FRONT,
        "ties: all fragments of a pixel are at one depth, and the later submitted is in front",
    )


# ---- closed forms ----


def _over(alpha, n):
    """1 − (1 − α)ⁿ."""
    return 1.0 if alpha == 1 else -math.expm1(n * math.log1p(-alpha))


def _geometric(q, n):
    """1 + q + … + qⁿ⁻¹."""
    return float(n) if q == 1 else (1 - q**n) / (1 - q)


def _bands(width, height, edges, colors):
    """Colours (3,) between x of the front camera's image, over black."""
    x = (np.arange(width) + 0.5 - width / 2) * (2 / height)
    row = np.concatenate([np.array(colors)[np.searchsorted(edges, x)], np.ones((width, 1))], axis=1)
    near = np.abs(x[:, None] - np.array(edges)).min(axis=1) < MARGIN * 2 / height
    row[near | (np.abs(x) > FAR - MARGIN * 2 / height)] = np.nan  # there the sheets end
    return np.tile(row, (height, 1, 1))


def _panes(name, panes, camera, hard_for) -> StandardScene:
    """A scene of planar quads (corners, rgb, alpha), a mesh each."""
    panes = [(np.asarray(corners, np.float32), rgba(rgb, np.float64(alpha))) for corners, rgb, alpha in panes]
    return StandardScene(
        name=name,
        scene=Scene([quads(corners[None], color[None]) for corners, color in panes]),
        camera=camera,
        background=PAPER,
        hard_for=hard_for,
        expected=lambda width, height: _composited(panes, camera, PAPER, width, height),
    )


def _composited(panes, camera, background, width, height):
    """What each pixel's centre sees, by the panes' planes; NaN within MARGIN of an edge or of a crossing."""
    y, x = np.mgrid[:height, :width] + 0.5
    keys, inside, unsure = [], [], np.zeros((height, width), bool)
    for corners, _ in panes:
        xy, depth = camera.project(corners, width, height)
        # Affine in the image, and rises with depth.
        rises = -1 / depth if camera.is_perspective else depth
        a, b, c = np.linalg.solve(np.column_stack([xy[:3], np.ones(3)]), rises[:3])
        keys.append((a, b, a * x + b * y + c))
        within = np.full((height, width), np.inf)
        (px, py), (qx, qy) = xy.T, np.roll(xy, -1, axis=0).T
        turn = np.sign((px * qy - qx * py).sum())
        for x0, y0, x1, y1 in zip(px, py, qx, qy, strict=True):
            cross = (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0)
            within = np.minimum(within, turn * cross / np.hypot(x1 - x0, y1 - y0))
        inside.append(within > 0)
        unsure |= np.abs(within) < MARGIN
    for i, (a, b, key) in enumerate(keys):
        for j, (c, d, other) in enumerate(keys[:i]):
            slope = np.hypot(a - c, b - d)
            if slope > 1e-12:  # else they are parallel, or in one plane
                unsure |= inside[i] & inside[j] & (np.abs(key - other) < MARGIN * slope)
    # Nearest first; of equal ones, which the last digits may not tell apart, the later.
    order = np.argsort(np.round([key for _, _, key in keys], 9)[::-1], axis=0, kind="stable")
    image, through = np.zeros((height, width, 4)), np.ones((height, width, 1))
    alphas = np.array([np.where(covers, color[3], 0) for covers, (_, color) in zip(inside, panes, strict=True)])[::-1]
    straight = np.array([[*color[:3], 1] for _, color in panes])[::-1]
    for layer in order:
        alpha = np.take_along_axis(alphas, layer[None], axis=0)[0][..., None]
        image += through * alpha * straight[layer]
        through *= 1 - alpha
    image += through * np.array([*background, 1])
    image[unsure] = np.nan
    return image
