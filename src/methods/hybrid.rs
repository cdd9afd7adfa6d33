//! Hybrid transparency (Maule, Comba, Torchelsen and Bastos 2013): the k nearest fragments, the core, are composited
//! exactly, in front of one layer of the mean colour Σ αᵢ cᵢ / Σ αᵢ of the others, the tail.
//!
//! The coverage of that layer is the tail's own, 1 − Π (1 − αᵢ), or as published that of m equal layers, 1 − (1 − ᾱ)ᵐ
//! with ᾱ = Σ αᵢ / m. The mean of logarithms being at most the logarithm of the mean, (1 − ᾱ)ᵐ ≥ Π (1 − αᵢ): the
//! published form never covers more, and as much where alphas are equal.

use super::common::absorbance::coverage_of_equal;
use super::common::layer::{Coverage, add_weighted};
use super::common::nearest::Nearest;
use super::{Described, Fragment, Parameters, Place, Streamed};
use crate::real::Real;

#[derive(Debug, Clone)]
pub struct Hybrid {
    k: usize,
    /// The tail covers as equal layers do.
    averages: bool,
}

pub struct State<T: Real> {
    core: Nearest<T>,
    tail_count: u32,
    /// Σ α c of the tail, and last Σ α.
    sum: [T; 4],
    coverage: Coverage<T>,
}

impl Hybrid {
    pub fn of(parameters: &Parameters) -> Self {
        Self { k: parameters.count("k"), averages: parameters.text("coverage") == "average" }
    }
}

impl Described for Hybrid {
    fn constants(&self) -> Vec<(&'static str, String)> {
        vec![("K", format!("{}u", self.k)), ("AVERAGES", self.averages.to_string())]
    }
    fn common(&self) -> &'static [&'static str] {
        &[
            "methods/common/layer",
            "methods/common/absorbance",
            "methods/common/slots",
            "methods/common/nearest",
        ]
    }
    fn work(&self, _: u32) -> (u32, u32) {
        (1, self.k as u32)
    }
}

impl<T: Real> Streamed<T> for Hybrid {
    type State = State<T>;

    fn begin(&self, _: Place) -> State<T> {
        State { core: Nearest::none(), tail_count: 0, sum: [T::ZERO; 4], coverage: Coverage::none() }
    }

    fn turn(&self, _: &mut State<T>, pass: u32) -> bool {
        pass == 0
    }

    fn insert(&self, state: &mut State<T>, fragment: &Fragment<T>, _: u32) {
        if let Some(Fragment { color: [r, g, b, a], .. }) = state.core.insert(*fragment, self.k) {
            state.tail_count += 1;
            state.sum = add_weighted(state.sum, a, [r, g, b]);
            state.coverage.add(a);
        }
    }

    fn end(&self, state: &State<T>, behind: [T; 4]) -> [T; 4] {
        let coverage = match self.averages {
            true => coverage_of_equal(state.sum[3], state.tail_count),
            false => state.coverage,
        };
        state.core.layer().onto(coverage.of_mean(state.sum)).over(behind)
    }

    fn left_out(&self, state: &State<T>, _: u32) -> u32 {
        state.tail_count
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::tests::{fragment, run};

    #[test]
    fn a_tail_is_one_layer_of_its_mean_colour() {
        // Behind a red half: green of alpha ½ and blue of alpha ¼, whose mean is (0, 2, 1) / 3.
        let fragments = [
            fragment(3, [0.0, 0.0, 1.0, 0.25]),
            fragment(1, [1.0, 0.0, 0.0, 0.5]),
            fragment(2, [0.0, 1.0, 0.0, 0.5]),
        ];
        // Coverages 1 − ½ · ¾, and 1 − (1 − ⅜)².
        for (averages, coverage) in [(false, 0.625), (true, 1.0 - 0.625_f64.powi(2))] {
            let (image, left_out) = run(&Hybrid { k: 1, averages }, &fragments);
            let wanted = [0.5, coverage / 3.0, coverage / 6.0, 0.5 + 0.5 * coverage];
            assert!(image.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-15), "{image:?} {wanted:?}");
            assert_eq!(left_out, 2);
        }
    }

    #[test]
    fn a_tail_of_alpha_0_is_none() {
        let fragments = [fragment(1, [1.0, 0.0, 0.0, 0.5]), fragment(2, [0.0, 1.0, 0.0, 0.0])];
        for averages in [false, true] {
            assert_eq!(run(&Hybrid { k: 1, averages }, &fragments).0, [0.5, 0.0, 0.0, 0.5]);
        }
    }
}
