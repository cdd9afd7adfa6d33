//! Additive blending, as of surfaces that only emit light: C = B + Σ αᵢ cᵢ. Nothing hides anything, and sums may exceed
//! every colour.
//!
//! Such a sum says nothing about coverage: alpha is the background's alone.

use super::common::layer::Layer;
use super::{Described, Fragment, Parameters, Place, Streamed};
use crate::real::Real;

#[derive(Debug, Clone)]
pub struct Additive;

impl Additive {
    pub fn of(_: &Parameters) -> Self {
        Self
    }
}

impl Described for Additive {}

impl<T: Real> Streamed<T> for Additive {
    /// Σ α c.
    type State = [T; 3];

    fn begin(&self, _: Place) -> [T; 3] {
        [T::ZERO; 3]
    }

    fn turn(&self, _: &mut [T; 3], pass: u32) -> bool {
        pass == 0
    }

    fn insert(&self, sum: &mut [T; 3], fragment: &Fragment<T>, _: u32) {
        let [r, g, b, a] = fragment.color;
        let [x, y, z] = *sum;
        *sum = [x + a * r, y + a * g, z + a * b];
    }

    fn end(&self, &[r, g, b]: &[T; 3], behind: [T; 4]) -> [T; 4] {
        Layer { rgba: [r, g, b, T::ZERO], transmittance: T::ONE }.over(behind)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::tests::{fragment, run};

    #[test]
    fn light_adds_up_and_covers_nothing() {
        let lights = [fragment(1, [1.0, 0.5, 0.0, 0.5]), fragment(2, [1.0, 1.0, 2.0, 1.0])];
        assert_eq!(run(&Additive, &lights).0, [1.5, 1.25, 2.0, 0.0]);
        assert_eq!(Additive.end(&[1.5, 1.25, 2.0], [1.0, 0.0, 0.5, 0.5]), [2.0, 1.25, 2.25, 0.5]);
    }
}
