"""Metrics of comparisons are those of the packages that define them, on pairs that are known."""

import math

import numpy as np
import pytest

from abuffer import ParameterError, UnsupportedError, extras
from abuffer.comparing import metrics

skimage = pytest.importorskip("skimage.metrics", reason="pip install 'abuffer[compare]'")
flip_evaluator = pytest.importorskip("flip_evaluator", reason="pip install 'abuffer[compare]'")


def pair(seed=0, noise=0.05, peak=1.0, size=(48, 64)):
    """A smooth image and the same with noise, (H, W, 4)."""
    y, x = np.mgrid[: size[0], : size[1]] / max(size)
    reference = np.stack([x, y, 0.5 + 0.5 * np.sin(9 * x * y), np.ones(size)], axis=-1)
    noisy = reference + noise * np.random.default_rng(seed).uniform(-1, 1, reference.shape)
    scale = np.array([peak, peak, peak, 1])
    return np.clip(noisy, 0, 1) * scale, reference * scale


def test_equal_images_are_off_by_nothing():
    _, reference = pair()
    found = metrics.errors(reference, reference)
    assert found | {"psnr": 0, "psnr_covered": 0} == dict.fromkeys(metrics.ERRORS, 0.0) | {"ssim": 1.0}
    assert (found["psnr"], found["psnr_covered"]) == (math.inf, math.inf)


def test_errors_are_their_definitions():
    image, reference = pair()
    off = np.abs(image - reference)[..., :3]
    found = metrics.errors(image, reference)
    assert found["max_abs"] == off.max()
    assert found["rmse"] == pytest.approx(np.sqrt((off**2).mean()))
    assert found["rmse_relative"] == pytest.approx(np.sqrt(((off / (reference[..., :3] + 0.01)) ** 2).mean()))
    assert found["p999"] == pytest.approx(np.percentile(off, 99.9))
    assert found["over_1_255"] == (off.max(axis=2) > 1 / 255).mean()
    assert found["over_1e5"] == (off.max(axis=2) > 1e-5).mean() > found["over_1_255"]
    assert found["alpha_rmse"] == pytest.approx(np.sqrt(((image - reference)[..., 3] ** 2).mean()))


def test_one_white_pixel_of_4096():
    """Its RMSE is 1/64; its mean FLIP is 0.0035, through the filters of the eye."""
    reference = np.zeros((64, 64, 4))
    image = reference.copy()
    image[30, 30, :3] = 1
    found = metrics.errors(image, reference)
    assert found["rmse"] == pytest.approx(1 / 64)
    assert found["psnr"] == pytest.approx(20 * np.log10(64))
    assert found["flip"] == pytest.approx(0.0035, abs=1e-4)
    assert (found["max_abs"], found["over_1_255"]) == (1, 1 / 4096)


@pytest.mark.parametrize("peak", [1.0, 1e4])
def test_psnr_and_ssim_are_those_of_scikit_image(peak):
    image, reference = pair(peak=peak)
    found = metrics.errors(image, reference)
    largest = max(1.0, reference[..., :3].max())
    rgb = reference[..., :3], image[..., :3]
    assert found["psnr"] == pytest.approx(skimage.peak_signal_noise_ratio(*rgb, data_range=largest))
    assert found["ssim"] == pytest.approx(skimage.structural_similarity(*rgb, channel_axis=2, data_range=largest))
    assert 0 < found["ssim"] < 1


def test_flip_is_that_of_flip_evaluator_for_linear_colours():
    """Declared as sRGB the same pair would have another figure: means agree to 1e-4 between systems."""
    image, reference = pair()
    rgb = [np.float32(each[..., :3]) for each in (reference, image)]
    linear, encoded = (flip_evaluator.evaluate(*rgb, "LDR", inputsRGB=srgb)[1] for srgb in (False, True))
    found = metrics.errors(image, reference)["flip"]
    assert found == pytest.approx(linear, abs=1e-6)
    assert abs(found - encoded) > 1e-3


def test_flip_of_high_dynamic_range_is_told_by_the_reference():
    """Its exposures are the reference's, whatever the image."""
    image, reference = pair(peak=1e3)
    rgb = [np.float32(each[..., :3]) for each in (reference, image)]
    assert metrics.errors(image, reference)["flip"] == pytest.approx(flip_evaluator.evaluate(*rgb, "HDR")[1], abs=1e-6)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_not_finite_is_counted_and_nothing_else_looks_at_it(value, monkeypatch):
    """FLIP itself would take it without a word."""
    monkeypatch.setattr(metrics, "flip", lambda *_: pytest.fail("FLIP was asked"))
    image, reference = pair()
    image[3, 4, 1] = value
    found = metrics.errors(image, reference)
    assert found["nonfinite"] == 1
    assert found["rmse"] == found["max_abs"] == found["over_1_255"] == math.inf
    assert found["psnr"] == -math.inf
    assert math.isnan(found["flip"]) and math.isnan(found["ssim"])


def test_a_reference_that_is_not_finite_is_refused():
    image, reference = pair()
    reference[0, 0, 0] = np.nan
    with pytest.raises(ParameterError, match="the reference is not finite"):
        metrics.errors(image, reference)
    with pytest.raises(ParameterError, match=r"must both be \(H, W, 4\)"):
        metrics.errors(image[:-1], image)


def test_covered_pixels_alone_have_a_psnr_that_empty_ones_do_not_inflate():
    image, reference = pair()
    covered = np.zeros(image.shape[:2], bool)
    covered[10:20, 10:20] = True
    image[~covered] = reference[~covered]
    found = metrics.errors(image, reference, covered)
    assert found["psnr"] - found["psnr_covered"] == pytest.approx(10 * np.log10(covered.size / covered.sum()))


def test_missing_packages_leave_their_columns_open(monkeypatch):
    monkeypatch.setattr(metrics, "optional", lambda name: None)
    found = metrics.errors(*pair())
    assert math.isnan(found["ssim"]) and math.isnan(found["flip"])
    assert found["rmse"] > 0
    monkeypatch.setattr(extras, "optional", lambda name: None)
    with pytest.raises(
        UnsupportedError, match=r"plotting needs matplotlib: pip install matplotlib, or 'abuffer\[compare\]'"
    ):
        extras.needed("matplotlib.figure", "plotting")


def test_images_smaller_than_the_window_have_no_ssim():
    image, reference = pair(size=(6, 40))
    assert math.isnan(metrics.errors(image, reference)["ssim"])


def test_where_no_pixel_is_covered_nothing_is_said_of_covered_ones():
    image, reference = pair()
    found = metrics.errors(image, reference, np.zeros(image.shape[:2], bool))
    assert math.isnan(found["psnr_covered"]) and math.isfinite(found["psnr"])


def test_errors_beside_negative_light_are_relative_to_its_size():
    reference = np.full((8, 8, 4), -0.01)
    assert metrics.errors(reference + 0.02, reference)["rmse_relative"] == pytest.approx(1)


def test_peaks_are_the_references():
    """Of an image that is too bright beside a reference within 1, the peak is 1; above, the reference's own."""
    image, reference = pair()
    image[3, 4, 0] = 50
    off = (image - reference)[..., :3]
    rmse = np.sqrt((off**2).mean())
    assert metrics.errors(image, reference)["psnr"] == pytest.approx(20 * np.log10(1 / rmse))
    bright = reference * [3, 3, 3, 1]
    covered = np.ones(image.shape[:2], bool)
    found = metrics.errors(image, bright, covered)
    rmse = np.sqrt(((image - bright)[..., :3] ** 2).mean())
    peak = bright[..., :3].max()
    assert peak > 2
    assert found["psnr"] == found["psnr_covered"] == pytest.approx(20 * np.log10(peak / rmse))


def test_flip_is_that_of_a_screen_where_the_reference_stays_within_1():
    """Which cuts what is brighter; a reference that is brighter makes it that of high dynamic range."""
    image, reference = pair()
    bright, cut = image.copy(), image.copy()
    bright[..., :3] *= 4
    cut[..., :3] = np.minimum(bright[..., :3], 1)
    assert metrics.errors(bright, reference)["flip"] == metrics.errors(cut, reference)["flip"] > 0
    scaled = reference * [1.5, 1.5, 1.5, 1]
    rgb = [np.float32(each[..., :3]) for each in (scaled, bright)]
    assert metrics.errors(bright, scaled)["flip"] == pytest.approx(flip_evaluator.evaluate(*rgb, "HDR")[1], abs=1e-6)
