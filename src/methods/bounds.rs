//! No method but what is known of them: for each pixel, how far off an image some methods can be at most.
//!
//! With R_c the range of the fragments' colours in a channel, and R that range with the background's and alpha's own:
//! - the unweighted commutative blend (McGuire and Bavoil 2013, equation 5): |ΔC| ≤ R_c ((Σα)² − Σα²) / 2;
//! - the k nearest alone: |ΔC| ≤ R T, T being what they let through, and 0 where there are no others.

use super::common::nearest::Nearest;
use super::{Described, Fragment, Parameters, Place, Streamed, Values};
use crate::real::Real;

#[derive(Debug, Clone)]
pub struct Bounds {
    k: usize,
    /// Gives what the k nearest may be off by, instead of the least number of nearest that `tolerance` allows.
    of_nearest: bool,
    tolerance: f64,
}

pub struct State<T: Real> {
    count: i32,
    alphas: T,
    /// Σ αᵢ αⱼ over all pairs: as ((Σα)² − Σα²) / 2 it would be a difference of large numbers.
    pairs: T,
    low: [T; 3],
    high: [T; 3],
    nearest: Nearest<T>,
}

impl Bounds {
    pub fn of(parameters: &Parameters) -> Self {
        let (k, tolerance) = (parameters.count("k"), parameters.number("tolerance"));
        Self { k, of_nearest: parameters.flag("of_nearest"), tolerance }
    }
}

impl Described for Bounds {
    fn constants(&self) -> Vec<(&'static str, String)> {
        vec![("K", format!("{}u", self.k)), ("OF_NEAREST", self.of_nearest.to_string())]
    }
    fn common(&self) -> &'static [&'static str] {
        &["methods/common/layer", "methods/common/slots", "methods/common/nearest"]
    }
    fn values(&self) -> Values {
        Values { beta: self.tolerance, ..Values::default() }
    }
    fn work(&self, _: u32) -> (u32, u32) {
        (1, self.k as u32)
    }
}

impl<T: Real> Streamed<T> for Bounds {
    type State = State<T>;

    fn begin(&self, _: Place) -> State<T> {
        State {
            count: 0,
            alphas: T::ZERO,
            pairs: T::ZERO,
            low: [T::ZERO; 3],
            high: [T::ZERO; 3],
            nearest: Nearest::none(),
        }
    }

    fn turn(&self, _: &mut State<T>, pass: u32) -> bool {
        pass == 0
    }

    fn insert(&self, state: &mut State<T>, fragment: &Fragment<T>, _: u32) {
        let [r, g, b, a] = fragment.color;
        let color = [r, g, b];
        if state.count == 0 {
            (state.low, state.high) = (color, color);
        }
        state.low = std::array::from_fn(|i| state.low[i].smaller(color[i]));
        state.high = std::array::from_fn(|i| state.high[i].larger(color[i]));
        state.count += 1;
        state.pairs = state.pairs + state.alphas * a;
        state.alphas = state.alphas + a;
        state.nearest.insert(*fragment, self.k);
    }

    /// (unweighted, how many nearest, fragments, 0); or (the k nearest, 0, fragments, 0).
    fn end(&self, state: &State<T>, behind: [T; 4]) -> [T; 4] {
        let count = T::from_i32(state.count);
        if state.count == 0 {
            return [T::ZERO; 4];
        }
        let mut own = T::ZERO; // R_c
        let mut range = T::ONE - behind[3]; // alpha's: fragments have 1
        for i in 0..3 {
            let shown = behind[3] * behind[i];
            own = own.larger(state.high[i] - state.low[i]);
            range = range.larger(state.high[i].larger(shown) - state.low[i].smaller(shown));
        }
        // What the nearest let through, one more each time; of all that are kept, at most k.
        let mut through = T::ONE;
        let mut needed = if range <= T::from_f64(self.tolerance) { 0 } else { self.k as i32 + 1 };
        for (place, alpha) in (1..).zip(state.nearest.alphas()) {
            through = through * (T::ONE - alpha);
            let is_all = place == state.count;
            if needed > place && (is_all || range * through <= T::from_f64(self.tolerance)) {
                needed = place;
            }
        }
        if self.of_nearest {
            let off = if state.count as usize > self.k { range * through } else { T::ZERO };
            return [off, T::ZERO, count, T::ZERO];
        }
        [own * state.pairs, T::from_i32(needed), count, T::ZERO]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::tests::{fragment, run};

    fn bounds(k: usize, of_nearest: bool, tolerance: f64, fragments: &[Fragment<f64>]) -> [f64; 4] {
        run(&Bounds { k, of_nearest, tolerance }, fragments).0
    }

    #[test]
    fn two_layers_are_bound_by_the_product_of_their_alphas_times_the_range() {
        let two = [fragment(1, [1.0, 0.5, 0.0, 0.5]), fragment(2, [0.25, 0.5, 0.0, 0.25])];
        let [unweighted, needed, count, _] = bounds(4, false, 0.1, &two);
        assert!((unweighted - 0.75 * 0.125).abs() < 1e-15);
        assert_eq!([needed, count], [2.0, 2.0]);
        // Behind the first, half shows: all of the range, which is alpha's.
        assert_eq!(bounds(1, true, 0.0, &two)[0], 0.5);
        assert_eq!(bounds(2, true, 0.0, &two)[0], 0.0);
    }

    #[test]
    fn one_layer_and_equal_colours_are_exact_without_weights() {
        assert_eq!(bounds(4, false, 0.0, &[fragment(1, [1.0, 0.5, 0.0, 0.5])])[0], 0.0);
        let equal: Vec<_> = (0..9).map(|i| fragment(i, [0.3, 0.2, 0.1, 0.1 * f64::from(i)])).collect();
        assert_eq!(bounds(4, false, 0.0, &equal)[0], 0.0);
    }
}
