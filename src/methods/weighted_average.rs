//! Weighted average (Bavoil and Myers 2008): C = C̄ (1 − (1 − ᾱ)ⁿ) + (1 − ᾱ)ⁿ B, with C̄ = Σ αᵢ cᵢ / Σ αᵢ and
//! ᾱ = Σ αᵢ / n.
//!
//! Exact where all alphas and all colours are equal. A fragment of alpha 0 changes n, and with it the image.

use super::common::absorbance::coverage_of_equal;
use super::common::layer::add_weighted;
use super::{Described, Fragment, Parameters, Place, Streamed};
use crate::real::Real;

#[derive(Debug, Clone)]
pub struct WeightedAverage;

pub struct State<T> {
    /// Σ α c, and last Σ α.
    sum: [T; 4],
    count: u32,
}

impl WeightedAverage {
    pub fn of(_: &Parameters) -> Self {
        Self
    }
}

impl Described for WeightedAverage {
    fn common(&self) -> &'static [&'static str] {
        &["methods/common/layer", "methods/common/absorbance"]
    }
}

impl<T: Real> Streamed<T> for WeightedAverage {
    type State = State<T>;

    fn begin(&self, _: Place) -> State<T> {
        State { sum: [T::ZERO; 4], count: 0 }
    }

    fn turn(&self, _: &mut State<T>, pass: u32) -> bool {
        pass == 0
    }

    fn insert(&self, state: &mut State<T>, fragment: &Fragment<T>, _: u32) {
        let [r, g, b, a] = fragment.color;
        state.sum = add_weighted(state.sum, a, [r, g, b]);
        state.count += 1;
    }

    fn end(&self, state: &State<T>, behind: [T; 4]) -> [T; 4] {
        coverage_of_equal(state.sum[3], state.count).of_mean(state.sum).over(behind)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::tests::{fragment, run};

    #[test]
    fn an_invisible_fragment_lets_the_background_leak_through() {
        // (1 − ½)² of it: alphas 1 and 0.
        let (image, _) = run(&WeightedAverage, &[fragment(1, [1.0; 4]), fragment(2, [1.0, 1.0, 1.0, 0.0])]);
        assert_eq!(image, [0.75; 4]);
        assert_eq!(run(&WeightedAverage, &[fragment(1, [1.0, 1.0, 1.0, 0.0])]).0, [0.0; 4]);
        assert_eq!(run(&WeightedAverage, &[]).0, [0.0; 4]);
    }
}
