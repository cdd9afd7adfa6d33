//! What methods share that first approximate F, the absorbance in front of each depth, and then shade by it:
//! C = A Σ e^−F(zᵢ) αᵢ cᵢ / Σ e^−F(zᵢ) αᵢ + (1 − A) B (Münstermann, Krumpen, Klein and Peters 2018, whose pass 2 and
//! resolve these are). They have A = 1 − e^−b₀, with b₀ the absorbance of all; here it is 1 − Π (1 − αᵢ), which is the same
//! where no absorbance is bounded, and exact where one is.

use super::absorbance::absorbance;
use super::layer::{Coverage, Layer, add_weighted};
use crate::real::Real;

/// −ln 10⁻⁵: that of an opaque layer would drown those of all others.
const MOST: f64 = 11.512925464970229;

#[inline]
pub fn bounded_absorbance<T: Real>(alpha: T) -> T {
    absorbance(alpha).smaller(T::from_f64(MOST))
}

/// Colours weighted by what is in front of them.
#[derive(Debug, Clone, Copy)]
pub struct Shade<T> {
    /// Σ e^(least − F) α c, and last Σ e^(least − F) α. A common factor cancels; without it, all e^−F of a thousand
    /// opaque layers are 0.
    sum: [T; 4],
    least: T,
    coverage: Coverage<T>,
}

impl<T: Real> Shade<T> {
    pub fn none() -> Self {
        Self { sum: [T::ZERO; 4], least: T::ZERO, coverage: Coverage::none() }
    }

    /// A fragment, straight, behind an absorbance.
    #[inline]
    pub fn add(&mut self, [r, g, b, a]: [T; 4], in_front: T) {
        if self.sum[3] == T::ZERO || in_front < self.least {
            let scale = (in_front - self.least).smaller(T::ZERO).exp();
            self.sum = self.sum.map(|sum| sum * scale);
            self.least = in_front;
        }
        let weight = a * (self.least - in_front).exp();
        self.sum = add_weighted(self.sum, weight, [r, g, b]);
        self.coverage.add(a);
    }

    /// All of them as one layer.
    pub fn layer(self) -> Layer<T> {
        self.coverage.of_mean(self.sum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_ratios_in_any_order_and_far_below_what_a_float_holds() {
        let (red, green) = ([1.0_f32, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0]);
        let wanted = 1.0 / (1.0 + (-1.0_f32).exp());
        for base in [0.0, 5000.0] {
            for order in [[(red, base), (green, base + 1.0)], [(green, base + 1.0), (red, base)]] {
                let mut shade = Shade::none();
                order.into_iter().for_each(|(color, in_front)| shade.add(color, in_front));
                let [r, g, b, a] = shade.layer().rgba;
                assert!((r - wanted).abs() < 1e-6 && (r + g - 1.0).abs() < 1e-6 && (b, a) == (0.0, 1.0));
            }
        }
        assert_eq!(Shade::<f32>::none().layer().over([1.0; 4]), [1.0; 4]);
    }
}
