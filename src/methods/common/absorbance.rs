//! Absorbance (optical depth) −ln(1 − α), which adds where transmittances multiply.

use super::layer::Coverage;
use crate::real::Real;

/// What stands for that of alpha 1: e^−104 is 0 in float32, where e^−103 is not yet.
const OPAQUE: f64 = 104.0;

/// Small alphas keep their digits.
#[inline]
pub fn absorbance<T: Real>(alpha: T) -> T {
    if alpha < T::ONE { -(-alpha).ln_1p() } else { T::from_f64(OPAQUE) }
}

/// 1 − e^−a, with the digits of a small a.
#[inline]
pub fn opacity<T: Real>(absorbance: T) -> T {
    if absorbance < T::from_f64(OPAQUE) { -(-absorbance).exp_m1() } else { T::ONE }
}

/// e^−a, 0 at that of alpha 1.
#[inline]
pub fn transmittance<T: Real>(absorbance: T) -> T {
    if absorbance < T::from_f64(OPAQUE) { (-absorbance).exp() } else { T::ZERO }
}

/// That of n layers of one alpha, the mean ᾱ = `sum` / n: 1 − (1 − ᾱ)ⁿ.
#[inline]
pub fn coverage_of_equal<T: Real>(sum: T, count: u32) -> Coverage<T> {
    let count = T::from_i32(count.max(1) as i32);
    let total = absorbance(sum / count) * count;
    Coverage { alpha: opacity(total), transmittance: transmittance(total) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_alphas_keep_their_digits_and_alpha_1_is_opaque() {
        for alpha in [1e-30_f32, 1e-7, 1e-3, 0.5, 0.999] {
            assert!((opacity(absorbance(alpha)) / alpha - 1.0).abs() < 1e-6, "{alpha}");
        }
        assert_eq!(opacity(absorbance(1.0_f32)), 1.0);
        assert_eq!(transmittance(absorbance(1.0_f64)), 0.0);
        assert_eq!(absorbance(0.0_f32), 0.0);
    }
}
