//! Wavelet transparency (Aizenshtein, Smal and McGuire 2022, arXiv 2201.00094).
//!
//! F(x) = Σ aᵢ [xᵢ ≤ x], the absorbance in front of a normalised depth x, is projected to Haar wavelets of the levels
//! j = 0 … rank over y = x (C − 1) / C, C = 2^(rank + 1) coefficients, by sums in any order:
//!   s = Σ aᵢ (1 − yᵢ),   d_jk = −Σ aᵢ 2^(−j/2) min(v, 1 − v),   v = 2^j yᵢ − k,   k = ⌊2^j yᵢ⌋.
//! The cell averages are F_i = s + Σ_j ± 2^(j/2) d_jk, + in the first half of the support of wavelet jk. Between them
//! F is interpolated, from F_{i−1} to F_i within cell i, F₋₁ = 0; so F never falls, and what is farther is never less
//! hidden.
//!
//! Doubt: the sums were derived from the projection and compared with published ports; where in a cell the authors
//! interpolate, and whether they leave out a fragment's own absorbance (not done here), was not read in their paper.

use super::common::depth::depth_in_range;
use super::common::shade::{Shade, bounded_absorbance};
use super::{DepthRange, Described, Fragment, Parameters, Place, Streamed, Values};
use crate::real::Real;

/// Of the greatest rank, 5.
const MOST_CELLS: usize = 64;

#[derive(Debug, Clone)]
pub struct Wavelet {
    rank: usize,
    range: DepthRange,
}

pub struct State<T> {
    /// s, then 2^(j/2) d_jk at 2^j + k: so scaled the powers of 2^(j/2) cancel.
    coefficients: [T; MOST_CELLS],
    shade: Shade<T>,
}

impl Wavelet {
    pub fn of(parameters: &Parameters) -> Self {
        Self { rank: parameters.count("rank"), range: parameters.depth_range() }
    }

    fn cells(&self) -> i32 {
        2 << self.rank
    }

    /// C y.
    fn place<T: Real>(&self, depth: T) -> T {
        depth_in_range(depth, self.range) * T::from_i32(self.cells() - 1)
    }

    fn project<T: Real>(&self, coefficients: &mut [T; MOST_CELLS], place: T, absorbance: T) {
        let cells = T::from_i32(self.cells());
        coefficients[0] = coefficients[0] + absorbance * (T::ONE - place / cells);
        for level in 0..=self.rank {
            let v = place * (T::from_i32(1 << level) / cells);
            let k = v.floor_to_i32();
            let v = v - T::from_i32(k);
            let at = (1 << level) + k as usize;
            coefficients[at] = coefficients[at] - absorbance * v.smaller(T::ONE - v);
        }
    }

    /// F_i.
    fn cell<T: Real>(&self, coefficients: &[T; MOST_CELLS], i: i32) -> T {
        if i < 0 {
            return T::ZERO;
        }
        let mut sum = coefficients[0];
        for level in 0..=self.rank {
            let half = i as usize >> (self.rank - level);
            let coefficient = coefficients[(1 << level) + (half >> 1)];
            sum = if half & 1 == 0 { sum + coefficient } else { sum - coefficient };
        }
        sum
    }

    /// F.
    fn in_front<T: Real>(&self, coefficients: &[T; MOST_CELLS], place: T) -> T {
        let i = place.floor_to_i32();
        let (before, own) = (self.cell(coefficients, i - 1), self.cell(coefficients, i));
        before + (own - before) * (place - T::from_i32(i))
    }
}

impl Described for Wavelet {
    fn constants(&self) -> Vec<(&'static str, String)> {
        vec![("RANK", format!("{}u", self.rank)), ("CELLS", format!("{}u", self.cells()))]
    }
    fn common(&self) -> &'static [&'static str] {
        &["methods/common/layer", "methods/common/absorbance", "methods/common/depth", "methods/common/shade"]
    }
    fn values(&self) -> Values {
        Values { range: self.range, ..Values::default() }
    }
    fn work(&self, _: u32) -> (u32, u32) {
        (2, 2 * (self.rank as u32 + 1)) // the levels of two cells
    }
}

impl<T: Real> Streamed<T> for Wavelet {
    type State = State<T>;

    fn begin(&self, _: Place) -> State<T> {
        State { coefficients: [T::ZERO; MOST_CELLS], shade: Shade::none() }
    }

    fn turn(&self, _: &mut State<T>, pass: u32) -> bool {
        pass < 2
    }

    fn insert(&self, state: &mut State<T>, fragment: &Fragment<T>, pass: u32) {
        let place = self.place(fragment.depth);
        if pass == 1 {
            state.shade.add(fragment.color, self.in_front(&state.coefficients, place));
            return;
        }
        self.project(&mut state.coefficients, place, bounded_absorbance(fragment.color[3]));
    }

    fn end(&self, state: &State<T>, behind: [T; 4]) -> [T; 4] {
        state.shade.layer().over(behind)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::tests::{fragment, run};

    #[test]
    fn a_cell_is_the_average_of_the_step_over_it() {
        let wavelet = Wavelet { rank: 3, range: (0.0, 1.0) };
        let mut coefficients = [0.0_f64; MOST_CELLS];
        // A third into cell 5 of 16.
        wavelet.project(&mut coefficients, 5.0 + 1.0 / 3.0, 3.0);
        for i in 0..16 {
            let wanted = [0.0, 2.0, 3.0][usize::from(i >= 5) + usize::from(i > 5)];
            assert!((wavelet.cell(&coefficients, i) - wanted).abs() < 1e-14, "{i}");
        }
    }

    #[test]
    fn two_layers_at_the_ends_of_the_range_are_exact() {
        for rank in 1..=5 {
            let wavelet = Wavelet { rank, range: (1.0, 9.0) };
            let two = [fragment(9, [0.0, 1.0, 0.0, 0.5]), fragment(1, [1.0, 0.0, 0.0, 0.25])];
            let image = run(&wavelet, &two).0;
            for (got, wanted) in image.into_iter().zip([0.25, 0.375, 0.0, 0.625]) {
                assert!((got - wanted).abs() < 1e-14, "{image:?}");
            }
        }
    }
}
