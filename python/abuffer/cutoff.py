"""Stopping early: the option `cutoff`, and why a channel changes by no more than that.

Front to back, `over` makes a channel C = Σ Tᵢ αᵢ cᵢ + T·D: the sum is of the fragments that were composited, T = Π (1 − αᵢ)
what they let through, and D what the fragments behind make of the background. D is a mean. It weighs each of their colours
by T'ⱼ αⱼ and the background's by T', which are at least 0 and sum to 1. So 0 ≤ D ≤ R for the largest colour R of scene
and background; in alpha all fragments have the colour 1, and D ≤ 1.

Where compositing stops, the background's own B takes D's place: |ΔC| = T·|D − B| ≤ T·R, since both lie between 0 and R. It
stops where T ≤ cutoff / max(1, R), so that no channel changes by more than `cutoff`; R is reached by D = R over black.
Samples keep the bound apart, and so does their mean.

Other modes have no such mean: additive adds without end, whatever T is.
"""

from . import _check
from .errors import ParameterError

# Nine bits of mantissa round up by half a unit at most.
LARGEST_ROUNDED = {"rgb9e5_alpha8_depth24": 1 + 2**-9}


def least_transmittance(cutoff, blends, colors, options, samples) -> float:
    """The transmittance at which compositing stops, so that no channel changes by more than `cutoff`, a checked number.

    Args:
        blends: the mode, or `Blend`, of everything that is blended.
        colors: arrays of straight colours, (..., 3|4): all that there are, the background's too.
        options: those that are given or their defaults, by name.

    Raises:
        ParameterError: what is not `over` from front to back, or not averaged with equal weights.
    """
    if cutoff == 0:
        return 0.0
    others = [blend for blend in blends if blend != "over"]
    if others:
        raise ParameterError(
            f'cutoff is for blend="over" alone, and there is {others[0]!r}: what it makes of the colour behind has no '
            "bound that shrinks with the transmittance; leave cutoff out"
        )
    if options["blend_order"] == "back_to_front":
        raise ParameterError(
            'cutoff stops on the way from front to back, and blend_order is "back_to_front": leave one of them out'
        )
    if options["msaa_resolve"] == "hdr" and samples > 1:
        raise ParameterError(
            'cutoff bounds each sample, and with msaa_resolve="hdr" their mean may change by more, since it weighs dark '
            'samples the most: leave cutoff out, or take "per_pixel"'
        )
    largest = max((float(c[..., :3].max(initial=0)) for c in colors), default=0.0)
    return cutoff / max(1.0, largest * LARGEST_ROUNDED.get(options.get("node_format"), 1.0))


def checked(value) -> float:
    return _check.number("cutoff", value, 0)
