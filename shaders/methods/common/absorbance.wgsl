// Absorbance (optical depth) −ln(1 − α), which adds where transmittances multiply (src/methods/common/absorbance.rs).

// What stands for that of alpha 1: e^−104 is 0 in float32.
const OPAQUE_ABSORBANCE = 104.0;

// Small alphas keep their digits: WGSL has no log1p. Below 2⁻⁶ the next term of the series is under 2⁻²⁴ of the sum.
fn absorbance(alpha: f32) -> f32 {
    if alpha >= 1.0 {
        return OPAQUE_ABSORBANCE;
    }
    if alpha < 0.015625 {
        return alpha * (1.0 + alpha * (0.5 + alpha * (1.0 / 3.0 + alpha * 0.25)));
    }
    return -log(1.0 - alpha);
}

// 1 − e^−a, with the digits of a small a.
fn opacity(a: f32) -> f32 {
    if a >= OPAQUE_ABSORBANCE {
        return 1.0;
    }
    if a < 0.0625 {
        return a * (1.0 - a * (0.5 - a * (1.0 / 6.0 - a * (1.0 / 24.0 - a * (1.0 / 120.0)))));
    }
    return 1.0 - exp(-a);
}

// e^−a, 0 at that of alpha 1.
fn transmittance_of(a: f32) -> f32 {
    return select(exp(-a), 0.0, a >= OPAQUE_ABSORBANCE);
}

// That of n layers of one alpha, the mean ᾱ = `sum` / n: 1 − (1 − ᾱ)ⁿ.
fn coverage_of_equal(sum: f32, count: u32) -> Coverage {
    let n = f32(max(count, 1u));
    let total = absorbance(sum / n) * n;
    return Coverage(opacity(total), transmittance_of(total));
}
