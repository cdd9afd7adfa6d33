"""Comparing a frame with the oracle: which pixels are compared, and how far apart they may be."""

from dataclasses import dataclass

import numpy as np

import abuffer as ab
import oracle

EDGE = 1 / 64  # pixels: vertices are snapped to 1/256, a ray sees them exactly, float32 moves them a little
U = oracle.U


@dataclass(frozen=True)
class Precision:
    """What a pipeline promises beside the oracle."""

    pipeline: str
    device: str
    precision: str
    # Relative depth error that makes two fragments a near tie: in float32 the 99th percentile of 20-px triangles.
    depth_relative: float
    # Roundings of an interpolated colour itself, in units of 2^-24: two divisions by w and a product, which a GPU may
    # round by 2.5 units each.
    interpolation_ulps: float

    def render(self, *args, **kw):
        return ab.render(*args, pipeline=self.pipeline, device=self.device, precision=self.precision, **kw)

    def __str__(self):
        return f"{self.pipeline}-{self.device}-{self.precision}"


CPU32 = Precision("tiles", "cpu", "float32", 1e-5, 4)
CPU64 = Precision("tiles", "cpu", "float64", 1e-13, 0)
GPU = Precision("linked_list", "gpu", "float32", 1e-5, 8)
GPU_PREFIX = Precision("prefix_sum", "gpu", "float32", GPU.depth_relative, GPU.interpolation_ulps)
GPU_TILES = Precision("tiles", "gpu", "float32", GPU.depth_relative, GPU.interpolation_ulps)


def assert_frame_matches(frame, hits, edges, precision, background=(0, 0, 0, 0)):
    """Asserts counts, primitives, depths and image of a frame with lists against the oracle's hits.

    `edges`: distance of each pixel's centre to the nearest projected edge; pixels nearer than EDGE are left out.
    """
    double = precision.precision == "float64"
    inside = edges >= EDGE
    assert inside.mean() > 0.3, "the edge band must not swallow the test"
    frags = frame.fragments
    np.testing.assert_array_equal(frags.counts[inside], hits.counts[inside], "counts outside the edge band")
    near = oracle.near_tie_pixels(hits, precision.depth_relative)
    assert near[inside].mean() <= 0.01, f"{near[inside].mean():.2%} of the pixels have near ties"

    # Lists, fragment by fragment, where the pixel is compared and its order is decided.
    decided = (inside & ~near).ravel()
    ours = np.flatnonzero(decided[frags.pixel])
    theirs = np.flatnonzero(decided[hits.pixel])
    np.testing.assert_array_equal(frags.primitive[ours], hits.primitive[theirs], "primitives, front to back")
    depth, gradient = hits.depth[theirs], hits.depth_gradient[theirs]
    error = np.abs(frags.depth[ours] - depth)
    if double:
        bound = 1e-9 * np.abs(depth) * (1 + gradient / np.abs(depth))
    else:
        shift = 4 * U * max(frags.shape)
        bound = precision.depth_relative * np.abs(depth) + shift * gradient
    assert (error <= bound).all(), f"depth is off by {(error / bound).max():.3g} times its bound"

    # Where the order is not decided, the same fragments in either order.
    undecided = (inside & near).ravel()
    for pixel in np.flatnonzero(undecided):
        a = frags.primitive[frags.offsets[pixel] : frags.offsets[pixel + 1]]
        b = hits.primitive[hits.offsets[pixel] : hits.offsets[pixel + 1]]
        np.testing.assert_array_equal(np.sort(a), np.sort(b))

    if double:
        kappa = gradient_of_image(hits)
        image_bound = 1e-9 * (1 + kappa)
    else:
        height, width = frags.shape
        image_bound = oracle.colour_bound(
            hits, width, height, background=background, interpolation_ulps=precision.interpolation_ulps
        )
    low, high = oracle.hull(hits, background, precision.depth_relative)
    outside = np.maximum(low - frame.image, frame.image - high)
    ratio = np.where(inside[..., None], outside / np.maximum(image_bound, 1e-300), 0)
    assert np.isfinite(frame.image).all()
    worst = np.unravel_index(np.argmax(ratio), ratio.shape)
    assert ratio.max() <= 1, f"pixel [{worst[0]}, {worst[1]}] channel {worst[2]} is off by {ratio.max():.3g} bounds"
    return {
        "pixels compared": float(inside.mean()),
        "near ties": float(near[inside].mean()),
        "worst pixel, in bounds": float(ratio.max()),
        "κ up to": float(gradient_of_image(hits)[inside].max()),
    }


def gradient_of_image(hits):
    """Per pixel and channel, the summed colour gradients of all layers (an upper bound of Σ T|∇c|): κ."""
    height, width = hits.counts.shape
    total = np.zeros((height * width, 4))
    np.add.at(total, hits.pixel, hits.gradient.max(axis=1, keepdims=True) * np.ones(4))
    return total.reshape(height, width, 4)
