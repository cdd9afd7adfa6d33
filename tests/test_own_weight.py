"""`wboit` with a weight of one's own: one text, on GPUs, on the CPU, and over captured lists."""

import numpy as np
import pytest

import abuffer as ab
import methods
from abuffer import ParameterError, ShaderError

CAMERA = ab.Camera.look_at((0, 0, 4), (0, 0, 0))
SIZE = {"width": 61, "height": 45}
EQUATION_9 = "alpha * max(0.01, min(0.03 / (1e-5 + pow(z / 200.0, 4.0)), 3e3))"
OTHERS = (
    "1.0",
    "exp(-0.5f * z) * (1.0 + alpha)",
    "clamp(pow(alpha, 3.0) * 10.0 / (1.0 + z * z), 1e-2, 3e3)",
    "select(0.5, 2.0, z < 4.0)",
)


def scene():
    rng = np.random.default_rng(5)
    triangles = rng.uniform(-1, 1, (40, 1, 3)) + rng.uniform(-0.6, 0.6, (40, 3, 3))
    return ab.Mesh(triangles, colors=rng.uniform(0.05, 1, (40, 4)))


def render(weight, **kw):
    return ab.render(scene(), CAMERA, **SIZE, method="wboit", weight=weight, background=(0.1, 0.2, 0.3, 0.5), **kw)


@pytest.mark.parametrize("weight", [EQUATION_9, *OTHERS])
def test_gpu_cpu_and_lists_agree(weight, needs_gpu):
    double = render(weight, precision="float64", fragments=True)
    again = double.fragments.composite("wboit", weight=weight)
    np.testing.assert_allclose(again, double.image, rtol=1e-12)
    for device in ("cpu", "gpu"):
        image = render(weight, device=device, pipeline="tiles").image
        np.testing.assert_allclose(image, double.image, atol=methods.tolerance("wboit"))


@pytest.mark.parametrize(("weight", "named"), [(EQUATION_9, "9"), ("1.0", "none")], ids=["9", "none"])
def test_an_equation_of_the_paper_written_out_is_that_equation(weight, named):
    written, wanted = (render(w, precision="float64").image for w in (weight, named))
    np.testing.assert_allclose(written, wanted, rtol=1e-12)
    assert np.abs(render("7", precision="float64").image - wanted).max() > 1e-3


@pytest.mark.parametrize(
    ("weight", "error", "message"),
    [
        ("z +", ShaderError, "weight:1"),
        ("colour.a * z", ShaderError, "colour"),
        ("vec3f(z)", ShaderError, "weight"),
        ("z * fragment_depth", ShaderError, "fragment_depth"),
        ("1 / 2 * z", ParameterError, r"write 1\.0 / 2\.0"),
        ("acosh(z)", ParameterError, "do not know 'acosh"),
        ("z // depth", ParameterError, "has a comment"),
        ("11", ParameterError, "weight must be one of"),
        ("nonee", ParameterError, "did you mean 'none'"),
        (7, ParameterError, "weight must be one of"),
    ],
)
def test_what_is_no_weight_is_told(weight, error, message):
    with pytest.raises(error, match=message):
        render(weight, device="cpu")


@pytest.mark.parametrize("weight", ["exp(100.0 * z)", "1.0 / (z - z)", "log(z - 3.9)", "-z"])
def test_weights_keep_within_limits_so_that_no_image_is_infinite(weight, needs_gpu):
    for device in ("cpu", "gpu"):
        assert np.isfinite(render(weight, device=device, pipeline="tiles").image).all()
    limited, whole = (render(w, device="cpu").image for w in ("exp(100.0 * z)", "1e6 + 0.0 * z"))
    np.testing.assert_allclose(limited, whole, atol=1e-6)
