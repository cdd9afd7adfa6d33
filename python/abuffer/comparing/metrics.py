"""How far an image is from its reference: in linear floats, before any tone map.

RGB is premultiplied, as `frame.image` is; alpha is apart. Non-finite values are counted before anything else looks at the
image: FLIP takes NaN without a word, and a mean over NaN says nothing of the pixels that are right.
"""

import numpy as np

from ..errors import ParameterError
from ..extras import optional

ERRORS = (
    "max_abs",
    "rmse",
    "rmse_relative",
    "p999",
    "over_1_255",
    "over_1e5",
    "psnr",
    "psnr_covered",
    "ssim",
    "flip",
    "alpha_rmse",
    "nonfinite",
)
# Columns of errors, of which less is better, and what plots call them.
LESS_IS_BETTER = {
    "rmse": "RMSE",
    "max_abs": "largest error of a channel",
    "rmse_relative": "relative RMSE",
    "p999": "99.9 percentile of errors",
    "over_1_255": "share of pixels off by over 1/255",
    "over_1e5": "share of pixels off by over 1e-5",
    "flip": "FLIP",
    "alpha_rmse": "RMSE of alpha",
}
# What is off by no more is off by what float32 rounds: it is drawn there, and orders no method before another.
FLOOR = 1e-6
# Beside the reference, below which a relative error is one of the dark.
DARK = 0.01
# scikit-image's window of SSIM, pixels a side.
WINDOW = 7


def errors(image, reference, covered=None) -> dict:
    """The columns ERRORS.

    Args:
        image, reference: (H, W, 4), premultiplied.
        covered: (H, W) bool, the pixels that hold fragments. None: all.

    Returns a float each, `nonfinite` an int: values of the image that are no numbers. Where there are some, errors are infinite, and
    what has no worst value (SSIM, FLIP) is NaN, as it is where the package that computes it is missing, where an image is too
    small for it, and where no pixel is covered.

    The peak of PSNR and SSIM is 1, or the reference's largest channel if that is more.

    Raises:
        ParameterError: other shapes, or a reference that is not finite.
    """
    image, reference = np.asarray(image, np.float64), np.asarray(reference, np.float64)
    if image.shape != reference.shape or image.ndim != 3 or image.shape[2] != 4:
        raise ParameterError(f"image and reference must both be (H, W, 4), got {image.shape} and {reference.shape}")
    if not np.isfinite(reference).all():
        raise ParameterError("the reference is not finite: nothing can be compared with it")
    nonfinite = int(np.count_nonzero(~np.isfinite(image)))
    if nonfinite:
        worst = dict.fromkeys(ERRORS, np.inf)
        return worst | {
            "psnr": -np.inf,
            "psnr_covered": -np.inf,
            "ssim": np.nan,
            "flip": np.nan,
            "nonfinite": nonfinite,
        }
    rgb, wanted = image[..., :3], reference[..., :3]
    off = np.abs(rgb - wanted)
    worst = off.max(axis=2)
    peak = max(1.0, float(wanted.max(initial=0)))
    covered = np.ones(worst.shape, bool) if covered is None else covered
    sizes = sizes_of(off)
    return {
        **sizes,
        "rmse_relative": _rms(off / (np.abs(wanted) + DARK)),
        "p999": float(np.quantile(off, 0.999)),
        "over_1e5": float(np.mean(worst > 1e-5)),
        "psnr": psnr(sizes["rmse"], peak),
        "psnr_covered": psnr(_rms(off[covered]), peak),
        "ssim": ssim(rgb, wanted, peak),
        "flip": flip(rgb, wanted, peak),
        "alpha_rmse": _rms(image[..., 3] - reference[..., 3]),
        "nonfinite": 0,
    }


def sizes_of(off) -> dict:
    """What is quickly said of absolute differences (..., 3): columns `max_abs`, `rmse` and `over_1_255`; NaN of none."""
    over = off.max(axis=-1) > 1 / 255
    told = {"max_abs": off.max(), "rmse": _rms(off), "over_1_255": over.mean()} if off.size else {}
    return {name: float(told.get(name, np.nan)) for name in ("max_abs", "rmse", "over_1_255")}


def _rms(values) -> float:
    """NaN of nothing."""
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else float("nan")


def psnr(rmse, peak) -> float:
    """Decibels; infinite of equal images, and NaN of no pixels."""
    return float(20 * np.log10(peak / rmse)) if rmse != 0 else float("inf")


def ssim(image, reference, peak) -> float:
    """Structural similarity (Wang et al. 2004) by scikit-image; 1 of equal images."""
    metrics = optional("skimage.metrics")
    if metrics is None or min(image.shape[:2]) < WINDOW:
        return float("nan")
    return float(metrics.structural_similarity(reference, image, channel_axis=2, data_range=peak))


def flip(image, reference, peak) -> float:
    """The mean of ꟻLIP (Andersson et al. 2020, 2021) by flip-evaluator; 0 of equal images.

    Where the reference exceeds 1 it is that of high dynamic range, whose exposures follow from the reference alone, so that they
    are the same for all methods. Else it is that of a screen: of an image, too, what exceeds 1 is cut.
    """
    evaluator = optional("flip_evaluator")
    if evaluator is None:
        return float("nan")
    # Written to by neither, and in the precision that the package has.
    pair = [np.ascontiguousarray(np.maximum(rgb, 0), np.float32) for rgb in (reference, image)]
    if peak <= 1:
        pair = [np.minimum(rgb, 1) for rgb in pair]
    kind = "LDR" if peak <= 1 else "HDR"
    # Linear input: declared as sRGB, the same pair would differ by another figure.
    return float(evaluator.evaluate(*pair, kind, inputsRGB=False, applyMagma=False)[1])
