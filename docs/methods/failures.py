"""For each method a small scene that it gets wrong, as seen from the front: what is exact, and what the method makes of it.

The pages of the methods show these (pictures.py), and tests compute again what the pages say they are off by.
"""

from dataclasses import dataclass

import numpy as np

import abuffer as ab

# A unit of the picture's sides from its middle; the eye is at z = 10, so that a depth d is at z = 10 − d.
CAMERA = ab.Camera.orthographic((0, 0, 10), (0, 0, 0), height=2)
EYE = 10.0
# Pixels of a picture, and where in it the sides and the tops of its three panels are.
WIDTH, HEIGHT = 1050, 380
SIDE, LEFTS, TOP = 312, (12, 344, 676), 56
PAPER = (0.94, 0.94, 0.94)
ORANGE, BLUE, GREEN = (1.0, 0.5, 0.0), (0.0, 0.4, 1.0), (0.1, 0.8, 0.4)
VEIL, VEIL_ALPHA = (0.45, 0.5, 0.6), 0.1


@dataclass(frozen=True)
class Failure:
    """Two images, (N, N, 3) float64 over an opaque background, and what they are of."""

    exact: np.ndarray
    method: np.ndarray
    titles: tuple
    meshes: list

    @property
    def off(self) -> np.ndarray:
        """Of each pixel, the difference of the channel where it is largest."""
        return np.abs(self.method - self.exact).max(axis=-1)

    def panels(self):
        """The images as they are shown: (SIDE, SIDE, 3) from 0 to 1, a pixel a square of them."""
        times = SIDE // len(self.exact)
        for image in (self.exact, self.method):
            yield np.clip(image, 0, 1).repeat(times, axis=0).repeat(times, axis=1)


def shown(meshes, *, background=PAPER, side=SIDE, samples=4, **options):
    frame = ab.render(
        meshes, CAMERA, width=side, height=side, background=background, samples=samples, precision="float64",
        device="cpu", **options,
    )  # fmt: skip
    return frame.image[..., :3]


def failure(id, title, meshes, *, background=PAPER, side=SIDE, samples=4, **options):
    look = {"background": background, "side": side, "samples": samples}
    return Failure(shown(meshes, **look), shown(meshes, method=id, **look, **options), ("exact", title), meshes)


# ---- shapes, which face the eye at a depth ----


def disc(center, radius, depth, color, alpha, turns=1.0):
    """A disc, or the upper part of one."""
    angles = np.linspace(0, 2 * np.pi * turns, 97)
    rim = np.stack([np.cos(angles), np.sin(angles)], axis=1) * radius + center
    corners = np.stack([np.broadcast_to(center, rim[1:].shape), rim[:-1], rim[1:]], axis=1)
    return _mesh(corners, depth, color, alpha)


def rectangle(low, high, depth, color, alpha):
    (x0, y0), (x1, y1) = low, high
    return _mesh(np.array([[(x0, y0), (x1, y0), (x1, y1)], [(x0, y0), (x1, y1), (x0, y1)]]), depth, color, alpha)


def _mesh(corners, depth, color, alpha):
    z = np.full((*corners.shape[:2], 1), EYE - depth)
    return ab.Mesh(np.concatenate([corners, z], axis=-1), colors=(*color, alpha))


def veils(count, depth, step=1.0, color=VEIL, alpha=VEIL_ALPHA):
    """Alike and behind each other, each beginning further to the right: of all of them from x = 0.1 on."""
    lefts = np.linspace(-0.95, 0.1, count)
    return [rectangle((x, -0.9), (0.95, 0.9), depth + i * step, color, alpha) for i, x in enumerate(lefts)]


def three_discs(alpha):
    """Nearest first: each pair overlaps, and all three in the middle."""
    places = [((-0.3, 0.2), ORANGE), ((0.3, 0.2), GREEN), ((0.0, -0.3), BLUE)]
    return [disc(center, 0.58, 4 + i, color, alpha) for i, (center, color) in enumerate(places)]


def two_discs(depths, alphas):
    """Orange on the left, and blue."""
    return [
        disc((-0.28, 0), 0.6, depths[0], ORANGE, alphas[0]),
        disc((0.28, 0), 0.6, depths[1], BLUE, alphas[1]),
    ]


# ---- exact ----


def exact():
    """Two halves of a slanted square, and the same square again of other triangles: depths tie but for roundings."""
    orange = _slanted([(-0.8, -0.8), (0.8, -0.8), (0.8, 0.8), (-0.8, 0.8)], ORANGE)
    blue = [(-0.55, -0.7), (0.7, -0.55), (0.55, 0.7), (-0.7, 0.55)]
    meshes, look = [orange, _slanted(blue, BLUE)], {"side": SIDE // 3, "samples": 1}
    lifted = [orange, _slanted(blue, BLUE, lifted=1e-3)]
    titles = ("the blue square a little in front", "exact, of both in one plane")
    return Failure(shown(lifted, **look), shown(meshes, **look), titles, meshes)


def _slanted(corners, color, lifted=0.0):
    points = np.array([(x, y, 0.37 * x + 0.23 * y + lifted) for x, y in corners])
    return ab.Mesh(points, [[0, 1, 2], [0, 2, 3]], colors=(*color, 0.7))


def depth_peeling():
    stairs = veils(12, 2, step=0.5, color=(1, 1, 1), alpha=0.15)
    return failure("depth_peeling", "depth_peeling, layers=4", stairs, background=(0.05, 0.05, 0.1), layers=4)


def dual_depth_peeling():
    """A disc, and the upper half of its triangles again in another colour."""
    whole = disc((0, 0), 0.8, 4, ORANGE, 0.7)
    again = ab.Mesh(whole.triangles()[:48], colors=(*BLUE, 0.7))
    meshes = [whole, again, rectangle((-0.9, -0.4), (0.9, 0.4), 6, GREEN, 0.5)]
    look = {"width": SIDE, "height": SIDE, "background": PAPER, "precision": "float64", "device": "cpu"}
    frame = ab.render(meshes, CAMERA, fragments=True, method="dual_depth_peeling", **look)
    titles = ("dual_depth_peeling here, and exact", "as published, by depth alone")
    return Failure(frame.image[..., :3], _without_ties(frame.fragments), titles, meshes)


def _without_ties(lists):
    """Composited without those that a depth test finds no nearer than an earlier one of their depth."""
    padded = lists.to_padded()
    color = padded.color.astype(np.float64)
    color[..., :-1, 3][padded.depth[..., :-1] == padded.depth[..., 1:]] = 0
    return ab.Fragments.from_padded(padded.depth, color, background=(*PAPER, 1)).composite()[..., :3]


# ---- bounded ----


def k_buffer():
    meshes = [*veils(12, 1, step=0.5), disc((0, 0), 0.7, 8, ORANGE, 0.9)]
    return failure("k_buffer", "k_buffer, k=8, tail='drop'", meshes)


def hybrid():
    return failure("hybrid", "hybrid, k=4", [*veils(4, 1), *two_discs((6, 7), (0.9, 0.9))])


def adaptive():
    """The disc is right behind the last veil."""
    return failure("adaptive", "adaptive, k=4", [*veils(4, 1), disc((0, 0), 0.7, 4.05, ORANGE, 0.9)])


def mlab():
    """The farther disc is submitted before the nearer one."""
    return failure("mlab", "mlab, k=4", [*veils(4, 1), *two_discs((6, 7), (0.9, 0.9))[::-1]])


def bucket_peeling():
    """A far pane behind the right half."""
    meshes = [*two_discs((2, 2.2), (0.3, 0.9)), rectangle((0, -0.9), (0.95, 0.9), 9, VEIL, 0.3)]
    return failure("bucket_peeling", "bucket_peeling, buckets=32", meshes)


def stencil_routed():
    """The nearest is submitted last."""
    return failure("stencil_routed", "stencil_routed, k=8", [*veils(8, 2), disc((0, 0), 0.7, 1, ORANGE, 0.9)])


# ---- sums ----


def additive():
    return failure("additive", "additive (above 1 shown as 1)", three_discs(0.6), background=(0.2, 0.2, 0.2))


def weighted_sum():
    return failure("weighted_sum", "weighted_sum (below 0 shown as 0)", three_discs(0.6), background=(1, 1, 1))


def weighted_average():
    """An opaque disc in front of a chequered background, and an invisible pane in front of its right half."""
    squares = np.add.outer(np.arange(SIDE) // 26, np.arange(SIDE) // 26) % 2
    chequered = np.repeat(np.where(squares, 1.0, 0.15)[..., None], 3, axis=-1)
    meshes = [disc((0, 0), 0.75, 4, ORANGE, 1), rectangle((0, -0.95), (0.95, 0.95), 3, VEIL, 0)]
    return failure("weighted_average", "weighted_average", meshes, background=chequered)


def wboit():
    return failure("wboit", "wboit, weight='7'", two_discs((5, 6), (1, 1)))


def phenomenological():
    """An opaque card in front of opaque stripes, both in the nearer part of the range."""
    stripes = [rectangle((x, -0.85), (x + 0.16, 0.85), 2.5, BLUE, 1) for x in np.arange(-0.9, 0.8, 0.32)]
    meshes = [rectangle((-0.6, -0.6), (0.7, 0.6), 2, ORANGE, 1), *stripes]
    return failure("phenomenological", "phenomenological", meshes, depth_range=(1, 20))


def mboit():
    """A veil in front of an opaque disc."""
    return failure("mboit", "mboit, 4 moments, beta=0.25", two_discs((2, 8), (0.5, 1)))


def wavelet():
    """Two discs close to each other, and a triangle at a hundred times their distance."""
    near, far = 0.5, 50.0
    speck = _mesh(np.array([[(0.8, -0.95), (0.95, -0.95), (0.95, -0.8)]]), far, GREEN, 0.9)
    behind = near * (far / near) ** (WAVELET_PLACE / 15)
    return failure("wavelet", "wavelet, rank=3", [*two_discs((near, behind), (0.9, 0.9)), speck])


WAVELET_PLACE = 0.1  # where in the first of 16 cells the second disc is


def fourier():
    """A thin veil in front of an opaque disc, the last of the scene."""
    return failure("fourier", "fourier, terms=3", two_discs((2, 8), (0.1, 1)))


def stochastic():
    return failure("stochastic", "stochastic, draws=8", three_discs(0.55), side=SIDE // 3, samples=1)


# ---- baselines ----


def unsorted():
    """Submitted front to back."""
    return failure("unsorted", "unsorted", three_discs(0.7))


def object_sorted():
    """A ring around a post, neither through the other: the ring is behind it above, and in front of it below."""
    angles = np.linspace(0, 2 * np.pi, 97)
    rims = [np.stack([r * np.cos(angles), 0.5 * r * np.sin(angles), -r * np.sin(angles)], axis=1) for r in (0.55, 0.9)]
    inner, outer = rims
    quads = np.stack([inner[:-1], outer[:-1], outer[1:], inner[:-1], outer[1:], inner[1:]], axis=1)
    ring = ab.Mesh(quads.reshape(-1, 3, 3), colors=(*BLUE, 0.7))
    post = rectangle((-0.3, -0.85), (0.3, 0.85), EYE, ORANGE, 0.7)
    return failure("object_sorted", "object_sorted", [post, ring])


def triangle_sorted():
    """Three long triangles, each over the next."""
    corners = np.array([[-0.72, -0.04, -0.2], [0.72, 0.23, 0.2], [-0.72, 0.5, -0.2]])
    meshes = []
    for turn, color in zip(np.radians([0, 120, 240]), (ORANGE, GREEN, BLUE), strict=True):
        cos, sin = np.cos(turn), np.sin(turn)
        rotation = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
        meshes.append(ab.Mesh(corners @ rotation.T, colors=(*color, 0.8)))
    return failure("triangle_sorted", "triangle_sorted", meshes)


FAILURES = {
    function.__name__: function
    for function in (
        exact, depth_peeling, dual_depth_peeling,
        k_buffer, hybrid, adaptive, mlab, bucket_peeling, stencil_routed,
        additive, weighted_sum, weighted_average, wboit, phenomenological, mboit, wavelet, fourier, stochastic,
        unsorted, object_sorted, triangle_sorted,
    )
}  # fmt: skip
