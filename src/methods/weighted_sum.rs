//! Weighted sum (Meshkin 2007; McGuire and Bavoil 2013, equation 3): C = Σ αᵢ cᵢ + (1 − Σ αᵢ) B.
//!
//! It is `over` without all products of alphas: exact to first order, |ΔC| ≤ R Σ_{i<j} αᵢ αⱼ for colours in a range R.
//! Nothing is clamped. Where Σ α exceeds 1 the background counts negatively, colours leave their range, and alpha,
//! Σ α + (1 − Σ α) B_α, exceeds 1 over all that is not opaque.

use super::common::layer::{Layer, add_weighted};
use super::{Described, Fragment, Parameters, Place, Streamed};
use crate::real::Real;

#[derive(Debug, Clone)]
pub struct WeightedSum;

impl WeightedSum {
    pub fn of(_: &Parameters) -> Self {
        Self
    }
}

impl Described for WeightedSum {}

impl<T: Real> Streamed<T> for WeightedSum {
    /// Σ α c, and last Σ α.
    type State = [T; 4];

    fn begin(&self, _: Place) -> [T; 4] {
        [T::ZERO; 4]
    }

    fn turn(&self, _: &mut [T; 4], pass: u32) -> bool {
        pass == 0
    }

    fn insert(&self, sum: &mut [T; 4], fragment: &Fragment<T>, _: u32) {
        let [r, g, b, a] = fragment.color;
        *sum = add_weighted(*sum, a, [r, g, b]);
    }

    fn end(&self, sum: &[T; 4], behind: [T; 4]) -> [T; 4] {
        Layer { rgba: *sum, transmittance: T::ONE - sum[3] }.over(behind)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::tests::{fragment, run};

    #[test]
    fn the_background_counts_negatively_where_alphas_exceed_1() {
        let two = [fragment(1, [1.0, 0.0, 0.0, 0.75]), fragment(2, [0.0, 1.0, 0.0, 0.75])];
        assert_eq!(run(&WeightedSum, &two).0, [0.75, 0.75, 0.0, 1.5]);
        assert_eq!(WeightedSum.end(&[0.75, 0.75, 0.0, 1.5], [0.0, 0.5, 1.0, 1.0]), [0.75, 0.5, -0.5, 1.0]);
    }
}
