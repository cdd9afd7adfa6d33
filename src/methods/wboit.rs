//! Weighted blended order-independent transparency (McGuire and Bavoil 2013).
//!
//! C = A Σ αᵢ cᵢ w(zᵢ, αᵢ) / Σ αᵢ w(zᵢ, αᵢ) + (1 − A) B, with the exact coverage A = 1 − Π (1 − αᵢ). The weights are
//! equations 7 to 10 of the paper, z the positive eye depth, in units that put a scene between 0.1 and 500; or 1 (its
//! equation 5). Exact for one layer and for equal colours. Unweighted, |ΔC| ≤ R Σ_{i<j} αᵢ αⱼ for colours in a range R;
//! a weight that depends on depth makes the error first order in alpha.

use super::common::layer::{Coverage, add_weighted};
use super::common::window::window_depth;
use super::{DepthRange, Described, Fragment, Parameters, Place, Streamed, Values};
use crate::real::Real;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Weight {
    None,
    /// By the paper's numbers.
    Equation7,
    Equation8,
    Equation9,
    Equation10,
}

#[derive(Debug, Clone)]
pub struct Wboit {
    weight: Weight,
    range: DepthRange,
}

pub struct State<T> {
    /// Σ α w c, and last Σ α w.
    sum: [T; 4],
    coverage: Coverage<T>,
}

impl Wboit {
    pub fn of(parameters: &Parameters) -> Self {
        let weight = match parameters.text("weight") {
            "7" => Weight::Equation7,
            "8" => Weight::Equation8,
            "9" => Weight::Equation9,
            "10" => Weight::Equation10,
            _ => Weight::None,
        };
        Self { weight, range: parameters.depth_range() }
    }

    /// w / α of equations 7 to 10, or 1.
    fn weight<T: Real>(&self, depth: T, alpha: T) -> T {
        let n = T::from_f64;
        let z = depth.abs();
        let power = |scale: f64, k: u32| {
            let x = z / n(scale);
            (1..k).fold(x, |product, _| product * x)
        };
        let within = |w: T| n(0.01).larger(w.smaller(n(3e3)));
        let far = n(1e-5);
        // A common factor cancels, and 2⁻¹² brings weights below 1: bright colours do not overflow.
        alpha
            * n(1.0 / 4096.0)
            * match self.weight {
                Weight::None => return T::ONE,
                Weight::Equation7 => within(n(10.0) / (far + power(5.0, 2) + power(200.0, 6))),
                Weight::Equation8 => within(n(10.0) / (far + power(10.0, 3) + power(200.0, 6))),
                Weight::Equation9 => within(n(0.03) / (far + power(200.0, 4))),
                Weight::Equation10 => {
                    let front = T::ONE - window_depth(z, self.range);
                    n(0.01).larger(n(3e3) * front * front * front)
                }
            }
    }
}

impl Described for Wboit {
    fn constants(&self) -> Vec<(&'static str, String)> {
        vec![("WEIGHT", format!("{}u", self.weight as u32))]
    }
    fn common(&self) -> &'static [&'static str] {
        &["methods/common/layer", "methods/common/window"]
    }
    fn values(&self) -> Values {
        Values { range: self.range, ..Values::default() }
    }
    fn work(&self, _: u32) -> (u32, u32) {
        (1, 8) // powers
    }
}

impl<T: Real> Streamed<T> for Wboit {
    type State = State<T>;

    fn begin(&self, _: Place) -> State<T> {
        State { sum: [T::ZERO; 4], coverage: Coverage::none() }
    }

    fn turn(&self, _: &mut State<T>, pass: u32) -> bool {
        pass == 0
    }

    fn insert(&self, state: &mut State<T>, fragment: &Fragment<T>, _: u32) {
        let [r, g, b, a] = fragment.color;
        let weight = a * self.weight(fragment.depth, a);
        state.sum = add_weighted(state.sum, weight, [r, g, b]);
        state.coverage.add(a);
    }

    fn end(&self, state: &State<T>, behind: [T; 4]) -> [T; 4] {
        state.coverage.of_mean(state.sum).over(behind)
    }
}
