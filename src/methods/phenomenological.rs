//! Phenomenological transparency (McGuire and Mara 2016): weighted blended transparency of surfaces that also transmit
//! light.
//!
//! A fragment holds back αᵢ (1 − t) of what is behind, and the background is multiplied by M = Π (1 − αᵢ (1 − t)).
//! C = (1 − M) Σ αᵢ cᵢ wᵢ / Σ αᵢ (1 − t) wᵢ + M B, with w = clamp((10 (1 − 0.99 d) α (1 − t))³, 0.01, 30), d the
//! window depth. The paper has a transmission of each surface and of each channel: here it is one number for all, as no
//! other is given; refraction and diffusion are left out. At t = 0 it is weighted blended transparency with that weight.
//!
//! Written as C = S Σ α c w / Σ α w + M B with S = (1 − M) / (1 − t), summed as Σ αᵢ Π_{j<i} (1 − αⱼ (1 − t)): t = 1,
//! where the quotients are 0/0, gives then their limit S = Σ α. The published shader divides by no less than 1e-5, so
//! that colours vanish there. Alpha is 1 − M: with t > 0 colours may exceed it.

use super::common::layer::{Layer, add_weighted};
use super::common::window::window_depth;
use super::{DepthRange, Described, Fragment, Parameters, Place, Streamed, Values};
use crate::real::Real;

#[derive(Debug, Clone)]
pub struct Phenomenological {
    /// t.
    transmission: f64,
    range: DepthRange,
}

pub struct State<T> {
    /// Σ α w c, and last Σ α w.
    sum: [T; 4],
    /// S: how much of the mean colour there is.
    amount: T,
    /// M.
    transmittance: T,
}

impl Phenomenological {
    pub fn of(parameters: &Parameters) -> Self {
        Self { transmission: parameters.number("transmission"), range: parameters.depth_range() }
    }

    fn weight<T: Real>(&self, depth: T, held_back: T) -> T {
        let n = T::from_f64;
        let x = n(10.0) * (T::ONE - n(0.99) * window_depth(depth.abs(), self.range)) * held_back;
        (x * x * x).clamped(n(0.01), n(30.0))
    }
}

impl Described for Phenomenological {
    fn constants(&self) -> Vec<(&'static str, String)> {
        vec![("TRANSMISSION", format!("{:?}", self.transmission as f32))]
    }
    fn common(&self) -> &'static [&'static str] {
        &["methods/common/layer", "methods/common/window"]
    }
    fn values(&self) -> Values {
        Values { range: self.range, ..Values::default() }
    }
}

impl<T: Real> Streamed<T> for Phenomenological {
    type State = State<T>;

    fn begin(&self, _: Place) -> State<T> {
        State { sum: [T::ZERO; 4], amount: T::ZERO, transmittance: T::ONE }
    }

    fn turn(&self, _: &mut State<T>, pass: u32) -> bool {
        pass == 0
    }

    fn insert(&self, state: &mut State<T>, fragment: &Fragment<T>, _: u32) {
        let [r, g, b, a] = fragment.color;
        let held_back = a * (T::ONE - T::from_f64(self.transmission));
        let weight = a * self.weight(fragment.depth, held_back);
        state.sum = add_weighted(state.sum, weight, [r, g, b]);
        state.amount = state.transmittance.times_plus(a, state.amount);
        state.transmittance = state.transmittance * (T::ONE - held_back);
    }

    fn end(&self, state: &State<T>, behind: [T; 4]) -> [T; 4] {
        let &State { sum: [r, g, b, weight], amount, transmittance } = state;
        let mean = |sum: T| if weight > T::ZERO { sum / weight * amount } else { T::ZERO };
        let alpha = amount * (T::ONE - T::from_f64(self.transmission));
        Layer { rgba: [mean(r), mean(g), mean(b), alpha], transmittance }.over(behind)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::tests::{fragment, run};

    fn of(transmission: f64) -> Phenomenological {
        Phenomenological { transmission, range: (1.0, 4.0) }
    }

    #[test]
    fn one_fragment_keeps_its_colour_and_lets_light_through() {
        let glass = [fragment(2, [1.0, 0.5, 0.0, 0.5])];
        for (transmission, alpha) in [(0.0, 0.5), (0.5, 0.25), (1.0, 0.0)] {
            assert_eq!(run(&of(transmission), &glass).0, [0.5, 0.25, 0.0, alpha]);
        }
    }

    #[test]
    fn weights_fall_with_the_window_depth_within_their_bounds() {
        let weight = |z: f64, alpha: f64| of(0.0).weight(z, alpha);
        assert_eq!([weight(1.0, 0.2), weight(1.0, 1.0), weight(4.0, 1.0)], [8.0, 30.0, 0.01]);
        assert!((weight(1.6, 0.2) - (2.0_f64 * 0.505).powi(3)).abs() < 1e-15);
    }
}
