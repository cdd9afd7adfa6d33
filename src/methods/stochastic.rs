//! Stochastic transparency (Enderton, Sintorn, Shirley and Luebke 2010), with stratified coverage (Laine and Karras
//! 2011).
//!
//! Of S draws a fragment covers n = ⌊αS + ξ⌋, a random n of them; each draw keeps the nearest that covers it. Then
//!   a: C = the mean of the draws' colours, B where nothing covers: C in expectation, with a deviation below R / (2 √S)
//!      for colours in a range R.
//!   b: C = A · the mean colour of the covered draws + (1 − A) B, with the exact coverage A = 1 − Π (1 − αᵢ).
//!   c: C = A Σ Vᵢ αᵢ cᵢ / Σ Vᵢ αᵢ + (1 − A) B, with the visibility Vᵢ, the share of draws that keep nothing in front
//!      of i; in a second pass.
//! b and c are ratios of estimates: their bias is O(1/S). Where b covers no draw, its colour is black.
//!
//! ξ and the subset come from a hash of pixel, sample, primitive, draw and seed, never of when a fragment arrives, in
//! integers: the same on every device. A mask made from alpha alone, as of alpha to coverage, would give two layers
//! of one alpha the same draws.

use arrayvec::ArrayVec;

use super::common::layer::{Coverage, Layer, add_weighted};
use super::{Described, Fragment, Parameters, Place, Streamed, Values};
use crate::real::{Bounded, Real};

const MOST_DRAWS: usize = 64;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Estimator {
    Mean,
    CorrectedAlpha,
    Visibility,
}

#[derive(Debug, Clone)]
pub struct Stochastic {
    draws: u32,
    seed: u32,
    estimator: Estimator,
}

#[derive(Debug, Clone, Copy)]
struct Draw<T: Real> {
    order: T::Entry,
    rgb: [T; 3],
}

pub struct State<T: Real> {
    hash: u32,
    draws: ArrayVec<Draw<T>, MOST_DRAWS>,
    coverage: Coverage<T>,
    /// Σ V α c, and last Σ V α.
    sum: [T; 4],
}

/// PCG's permutation of a step of its generator (Jarzynski and Olano 2020, JCGT 9(3)).
fn hash(value: u32) -> u32 {
    let state = value.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

impl Stochastic {
    pub fn of(parameters: &Parameters) -> Self {
        let estimator = match parameters.text("estimator") {
            "b" => Estimator::CorrectedAlpha,
            "c" => Estimator::Visibility,
            _ => Estimator::Mean,
        };
        Self { draws: parameters.count("draws") as u32, seed: parameters.number("seed") as u32, estimator }
    }

    pub fn draws(&self) -> u32 {
        self.draws
    }

    /// The exact coverage is accumulated beside the draws.
    pub fn corrects_alpha(&self) -> bool {
        self.estimator != Estimator::Mean
    }

    /// Fragments are composited by the share of draws that see them.
    pub fn weighs_visibility(&self) -> bool {
        self.estimator == Estimator::Visibility
    }

    /// How many draws a fragment covers: ⌊αS + ξ⌋, from ⌊αS⌋ and the rest, so that no sum rounds and alpha 1 covers
    /// all.
    fn covered(&self, alpha: f32, hashed: u32) -> u32 {
        let share = alpha * self.draws as f32;
        let whole = share.floor();
        whole as u32 + u32::from((hashed >> 8) as f32 / 16_777_216.0 < share - whole)
    }

    /// Calls `cover` with each draw that a fragment covers: a random subset, each of that size as likely (selection
    /// sampling, Knuth 1969, 3.4.2 S). float32's alpha in any precision, so that all draw alike.
    fn draw(&self, place: u32, primitive: u32, alpha: f32, mut cover: impl FnMut(usize)) {
        let own = hash(place.wrapping_add(primitive));
        let mut wanted = self.covered(alpha, hash(own));
        for draw in 0..self.draws {
            let left = self.draws - draw;
            // Random below `left`: 24 bits and the 7 of 64 fit in 32.
            let random = ((hash(own.wrapping_add(draw + 1)) >> 8) * left) >> 24;
            if random < wanted {
                wanted -= 1;
                cover(draw as usize);
            }
        }
    }
}

impl Described for Stochastic {
    fn constants(&self) -> Vec<(&'static str, String)> {
        vec![("DRAWS", format!("{}u", self.draws)), ("ESTIMATOR", format!("{}u", self.estimator as u32))]
    }
    fn values(&self) -> Values {
        Values { seed: self.seed, ..Values::default() }
    }
    fn work(&self, _: u32) -> (u32, u32) {
        (if self.estimator == Estimator::Visibility { 2 } else { 1 }, self.draws)
    }
}

impl<T: Real> Streamed<T> for Stochastic {
    type State = State<T>;

    fn begin(&self, place: Place) -> State<T> {
        let parts = [place.sample, place.y, place.x];
        let empty = Draw { order: T::Entry::MAX, rgb: [T::ZERO; 3] };
        State {
            hash: parts.into_iter().fold(hash(self.seed), |hashed, part| hash(part.wrapping_add(hashed))),
            draws: (0..self.draws).map(|_| empty).collect(),
            coverage: Coverage::none(),
            sum: [T::ZERO; 4],
        }
    }

    fn turn(&self, _: &mut State<T>, pass: u32) -> bool {
        pass == 0 || (pass == 1 && self.estimator == Estimator::Visibility)
    }

    fn insert(&self, state: &mut State<T>, fragment: &Fragment<T>, pass: u32) {
        let [r, g, b, a] = fragment.color;
        if pass == 1 {
            let visible = state.draws.iter().filter(|draw| draw.order >= fragment.order).count();
            let weight = T::from_i32(visible as i32) * a;
            state.sum = add_weighted(state.sum, weight, [r, g, b]);
            return;
        }
        state.coverage.add(a);
        let draws = &mut state.draws;
        self.draw(state.hash, fragment.primitive, a.to_f64() as f32, |draw| {
            if fragment.order < draws[draw].order {
                draws[draw] = Draw { order: fragment.order, rgb: [r, g, b] };
            }
        });
    }

    fn end(&self, state: &State<T>, behind: [T; 4]) -> [T; 4] {
        if self.estimator == Estimator::Visibility {
            return state.coverage.of_mean(state.sum).over(behind);
        }
        let covered = state.draws.iter().filter(|draw| draw.order < T::Entry::MAX);
        let [r, g, b, n] = covered.fold([T::ZERO; 4], |[x, y, z, n], Draw { rgb: [r, g, b], .. }| {
            [x + *r, y + *g, z + *b, n + T::ONE]
        });
        if self.estimator == Estimator::CorrectedAlpha {
            return state.coverage.of_mean([r, g, b, n]).over(behind);
        }
        let all = T::from_i32(self.draws as i32);
        Layer { rgba: [r / all, g / all, b / all, n / all], transmittance: (all - n) / all }.over(behind)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::tests::{fragment, run};

    fn of(draws: u32, estimator: Estimator) -> Stochastic {
        Stochastic { draws, seed: 7, estimator }
    }

    #[test]
    fn subsets_are_of_the_size_drawn_and_each_as_likely() {
        let stochastic = of(4, Estimator::Mean);
        let mut found = [0_u32; 16];
        for place in 0..60_000 {
            let mut mask = 0_usize;
            stochastic.draw(hash(place), 3, 0.5, |draw| mask |= 1 << draw);
            found[mask] += 1;
        }
        let pairs: Vec<u32> = (1..16_usize).filter(|m| m.count_ones() == 2).map(|m| found[m]).collect();
        assert_eq!(pairs.iter().sum::<u32>(), 60_000);
        // Binomial: 5 deviations of √(60000 · 1/6 · 5/6).
        assert!(pairs.iter().all(|&n| n.abs_diff(10_000) < 457), "{pairs:?}");
    }

    #[test]
    fn sizes_are_alpha_s_rounded_down_or_up_as_often_as_its_fraction_says() {
        let stochastic = &of(6, Estimator::Mean);
        let sizes = |alpha: f32| (0..40_000).map(move |i| stochastic.covered(alpha, hash(i)));
        assert!(sizes(1.0).all(|n| n == 6) && sizes(0.5).all(|n| n == 3) && sizes(0.0).all(|n| n == 0));
        let sum: u32 = sizes(0.3).sum();
        // 1.8 on average; 5 deviations of √(40000 · .8 · .2).
        assert!(sum.abs_diff(72_000) < 400, "{sum}");
    }

    #[test]
    fn an_opaque_layer_covers_every_draw_and_what_is_behind_it_none() {
        for estimator in [Estimator::Mean, Estimator::CorrectedAlpha, Estimator::Visibility] {
            let two = [fragment(2, [0.0, 1.0, 0.0, 0.5]), fragment(1, [1e4, 0.0, 0.0, 1.0])];
            assert_eq!(run(&of(8, estimator), &two).0, [1e4, 0.0, 0.0, 1.0], "{estimator:?}");
        }
    }
}
