//! k-buffer (Bavoil, Callahan, Lefohn, Comba and Silva 2007): the k nearest fragments are composited exactly, in front
//! of what becomes of the others, the tail.
//!
//! `drop`: nothing. |ΔC| ≤ T · max |C_tail − B|, T being what the k nearest let through. `blend`: they are composited in
//! the order of submission, as if painted, in a second pass. `average`: one layer with their mean colour Σ αᵢ cᵢ / Σ αᵢ
//! and the coverage 1 − (1 − ᾱ)ᵐ of m equal layers (Maule, Comba, Torchelsen and Bastos 2013).

use super::common::absorbance::coverage_of_equal;
use super::common::layer::{Layer, add_weighted};
use super::common::nearest::Nearest;
use super::{Described, Fragment, Parameters, Place, Streamed};
use crate::real::Real;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Tail {
    Drop,
    Blend,
    Average,
}

#[derive(Debug, Clone)]
pub struct KBuffer {
    k: usize,
    tail: Tail,
}

pub struct State<T: Real> {
    nearest: Nearest<T>,
    /// Fragments that are not among the nearest; of those Σ α c and Σ α, or what they paint.
    tail_count: u32,
    sum: [T; 4],
    painted: Layer<T>,
}

impl KBuffer {
    pub fn of(parameters: &Parameters) -> Self {
        let tail = match parameters.text("tail") {
            "blend" => Tail::Blend,
            "average" => Tail::Average,
            _ => Tail::Drop,
        };
        Self { k: parameters.count("k"), tail }
    }
}

impl Described for KBuffer {
    fn constants(&self) -> Vec<(&'static str, String)> {
        vec![("K", format!("{}u", self.k)), ("TAIL", format!("{}u", self.tail as u32))]
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
        (if self.tail == Tail::Blend { 2 } else { 1 }, self.k as u32)
    }
    fn drops(&self) -> bool {
        self.tail == Tail::Drop
    }
}

impl<T: Real> Streamed<T> for KBuffer {
    type State = State<T>;

    fn begin(&self, _: Place) -> State<T> {
        State { nearest: Nearest::none(), tail_count: 0, sum: [T::ZERO; 4], painted: Layer::clear() }
    }

    fn turn(&self, state: &mut State<T>, pass: u32) -> bool {
        pass == 0 || (pass == 1 && self.tail == Tail::Blend && state.tail_count > 0)
    }

    fn insert(&self, state: &mut State<T>, fragment: &Fragment<T>, pass: u32) {
        if pass == 1 {
            if state.nearest.end_before(fragment) {
                state.painted = Layer::of(fragment.color).onto(state.painted);
            }
            return;
        }
        if let Some(Fragment { color: [r, g, b, a], .. }) = state.nearest.insert(*fragment, self.k) {
            state.tail_count += 1;
            state.sum = add_weighted(state.sum, a, [r, g, b]);
        }
    }

    fn end(&self, state: &State<T>, behind: [T; 4]) -> [T; 4] {
        let tail = match self.tail {
            Tail::Drop => Layer::clear(),
            Tail::Blend => state.painted,
            Tail::Average => coverage_of_equal(state.sum[3], state.tail_count).of_mean(state.sum),
        };
        state.nearest.layer().onto(tail).over(behind)
    }

    fn left_out(&self, state: &State<T>, _: u32) -> u32 {
        state.tail_count
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::tests::{fragment, run};

    /// red α .5, green α .5, blue α 1, nearest first, on black.
    fn three() -> [Fragment<f64>; 3] {
        [
            fragment(2, [0.0, 1.0, 0.0, 0.5]),
            fragment(1, [1.0, 0.0, 0.0, 0.5]),
            fragment(3, [0.0, 0.0, 1.0, 1.0]),
        ]
    }

    fn of(k: usize, tail: Tail) -> KBuffer {
        KBuffer { k, tail }
    }

    #[test]
    fn dropped_tails_show_the_background_and_kept_ones_do_not() {
        assert_eq!(run(&of(1, Tail::Drop), &three()), ([0.5, 0.0, 0.0, 0.5], 2));
        assert_eq!(run(&of(2, Tail::Drop), &three()), ([0.5, 0.25, 0.0, 0.75], 1));
        assert_eq!(run(&of(3, Tail::Drop), &three()), ([0.5, 0.25, 0.25, 1.0], 0));
        // Painted green, then blue: blue hides it.
        assert_eq!(run(&of(1, Tail::Blend), &three()), ([0.5, 0.0, 0.5, 1.0], 2));
    }

    #[test]
    fn an_average_of_equal_layers_has_their_coverage() {
        let equal: Vec<_> = (0..9).map(|i| fragment(i, [0.2, 0.4, 0.6, 0.3])).collect();
        let (image, left_out) = run(&of(2, Tail::Average), &equal);
        assert!((image[3] - (1.0 - 0.7_f64.powi(9))).abs() < 1e-14);
        assert_eq!(left_out, 7);
    }
}
