//! Fourier opacity mapping (Jansen and Bavoil 2010) as a method of order-independent transparency.
//!
//! The density Σ aᵢ δ(x − xᵢ) of absorbance over a normalised depth x has the coefficients a_k = 2 Σ aᵢ cos 2πk xᵢ and
//! b_k = 2 Σ aᵢ sin 2πk xᵢ, sums in any order. With `terms` of them, what is in front of x is
//!   F(x) = a₀ x / 2 + Σ_k [a_k sin 2πk x + b_k (1 − cos 2πk x)] / 2πk,
//! and F(1) is the absorbance of all. It rings: F falls in places, even below 0, where the transmittance is clamped
//! to 1. It is periodic: a layer at x = 0 counts like one at x = 1. In the sums here the factors of 2 are left out.

use super::common::depth::depth_in_range;
use super::common::shade::{Shade, bounded_absorbance};
use super::{DepthRange, Described, Fragment, Parameters, Place, Streamed, Values};
use crate::real::Real;

const MOST_TERMS: usize = 16;

#[derive(Debug, Clone)]
pub struct Fourier {
    terms: usize,
    range: DepthRange,
}

pub struct State<T> {
    /// Σ a cos 2πk x and Σ a sin 2πk x, of k from 1 on.
    coefficients: [[T; 2]; MOST_TERMS],
    total: T,
    shade: Shade<T>,
}

impl Fourier {
    pub fn of(parameters: &Parameters) -> Self {
        Self { terms: parameters.count("terms"), range: parameters.depth_range() }
    }

    /// cos and sin of 2πk x, for k = 1 … terms, by turning.
    fn waves<T: Real>(&self, x: T) -> impl Iterator<Item = [T; 2]> + use<T> {
        let (sin, cos) = (x * T::from_f64(std::f64::consts::TAU)).sin_cos();
        let turned = move |&[c, s]: &[T; 2]| Some([c * cos - s * sin, s * cos + c * sin]);
        std::iter::successors(Some([cos, sin]), turned).take(self.terms)
    }

    /// F, at least 0.
    fn in_front<T: Real>(&self, state: &State<T>, x: T) -> T {
        let mut sum = state.total * x;
        for (k, ([c, s], [a, b])) in (1..).zip(self.waves(x).zip(state.coefficients)) {
            sum = sum + (a * s + b * (T::ONE - c)) * T::from_f64(std::f64::consts::FRAC_1_PI / f64::from(k));
        }
        sum.larger(T::ZERO)
    }
}

impl Described for Fourier {
    fn constants(&self) -> Vec<(&'static str, String)> {
        vec![("TERMS", format!("{}u", self.terms))]
    }
    fn common(&self) -> &'static [&'static str] {
        &["methods/common/layer", "methods/common/absorbance", "methods/common/depth", "methods/common/shade"]
    }
    fn values(&self) -> Values {
        Values { range: self.range, ..Values::default() }
    }
    fn work(&self, _: u32) -> (u32, u32) {
        (2, self.terms as u32)
    }
}

impl<T: Real> Streamed<T> for Fourier {
    type State = State<T>;

    fn begin(&self, _: Place) -> State<T> {
        State { coefficients: [[T::ZERO; 2]; MOST_TERMS], total: T::ZERO, shade: Shade::none() }
    }

    fn turn(&self, _: &mut State<T>, pass: u32) -> bool {
        pass < 2
    }

    fn insert(&self, state: &mut State<T>, fragment: &Fragment<T>, pass: u32) {
        let x = depth_in_range(fragment.depth, self.range);
        if pass == 1 {
            let in_front = self.in_front(state, x);
            state.shade.add(fragment.color, in_front);
            return;
        }
        let absorbance = bounded_absorbance(fragment.color[3]);
        for ([a, b], [c, s]) in state.coefficients.iter_mut().zip(self.waves(x)) {
            (*a, *b) = (*a + absorbance * c, *b + absorbance * s);
        }
        state.total = state.total + absorbance;
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
    fn two_layers_at_the_ends_of_the_range_are_0_and_all_absorbance_deep() {
        // Weights 1 and (1 − α₁)(1 − α₂): at the end a layer is behind itself too.
        let two = [fragment(9, [0.0, 1.0, 0.0, 0.5]), fragment(1, [1.0, 0.0, 0.0, 0.25])];
        for terms in [1, 3, 16] {
            let image = run(&Fourier { terms, range: (1.0, 9.0) }, &two).0;
            let green = 0.5 * 0.375;
            for (got, weight) in image.into_iter().zip([0.25, green, 0.0, 0.25 + green]) {
                let wanted = weight / (0.25 + green) * 0.625;
                assert!((got - wanted).abs() < 1e-13, "{image:?}");
            }
        }
    }

    #[test]
    fn a_layer_is_half_in_front_of_itself() {
        // All sines of a step at its own place cancel, but for half of it: F(x) = a x − … is odd about (½, a / 2).
        let fourier = Fourier { terms: 16, range: (0.0, 1.0) };
        let mut state: State<f64> = fourier.begin(Place::default());
        let own = Fragment { depth: 0.5, ..fragment(0, [1.0, 1.0, 1.0, 0.75]) };
        fourier.insert(&mut state, &own, 0);
        let [half, all] = [0.5, 1.0].map(|x| fourier.in_front(&state, x));
        assert!((all - 4.0_f64.ln()).abs() < 1e-14 && (half - all / 2.0).abs() < 1e-14);
    }
}
