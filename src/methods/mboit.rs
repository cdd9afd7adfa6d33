//! Moment-based order-independent transparency (Münstermann, Krumpen, Klein and Peters 2018).
//!
//! A first pass sums absorbances aᵢ = −ln(1 − αᵢ) and their moments over depth. From these a second one reconstructs how
//! much absorbance F(ζ) is in front of each fragment, and sums colours weighted by T = e^{−F}:
//! C = A Σ α T c / Σ α T + (1 − A) B, with the exact coverage A = 1 − Π (1 − αᵢ). F(ζ) lies between two bounds, `beta`
//! from the lower to the upper. The moments are power moments (common/power_moments.rs), in 32 bits or four of them in
//! 16, or trigonometric ones (common/trigonometric_moments.rs). Exact, up to the bias λ, where beta is 0 and a pixel has
//! no more than one depth more than half the moments: these, the fragment's among them, are then the representation that
//! is looked for.
//!
//! The published code leaves out pixels of b₀ = Σ aᵢ under 0.001 and stops a at 10, and takes 1 − e^{−b₀} as coverage;
//! here a stops at −ln 2⁻²⁴, that of the float next to 1, in the moments alone, and no pixel is left out: normalised
//! moments are as good for thin ones. It weighs with T itself, which is 0 for all fragments of a pixel that is dense
//! enough; here the greatest T of those met so far is divided out.

use super::common::absorbance::absorbance;
use super::common::depth::depth_in_range;
use super::common::interpolation::LEAST_RUN;
use super::common::power_moments::{self, Bits, LEAST_PIVOT, PowerMoments};
use super::common::roots;
use super::common::shade::Shade;
use super::common::trigonometric_moments::{self, TrigonometricMoments};
use super::{DepthRange, Described, Fragment, Parameters, Place, Streamed, Values};
use crate::real::Real;

/// −ln 2⁻²⁴.
const MOST_ABSORBANCE: f64 = 16.635_532_333_438_686;

#[derive(Debug, Clone)]
pub struct Mboit {
    /// Complex moments, or half as many as there are power moments.
    half: usize,
    trigonometric: bool,
    bits: Bits,
    beta: f64,
    range: DepthRange,
}

enum Moments<T> {
    Power(PowerMoments<T>),
    Trigonometric(TrigonometricMoments<T>),
}

pub struct State<T> {
    moments: Moments<T>,
    shade: Shade<T>,
}

impl<T: Real> Moments<T> {
    fn total(&self) -> T {
        match self {
            Self::Power(moments) => moments.total(),
            Self::Trigonometric(moments) => moments.total(),
        }
    }
    fn add(&mut self, absorbance: T, depth: T) {
        match self {
            Self::Power(moments) => moments.add(absorbance, depth),
            Self::Trigonometric(moments) => moments.add(absorbance, depth),
        }
    }
    fn factorise(&mut self) {
        match self {
            Self::Power(moments) => moments.factorise(),
            Self::Trigonometric(moments) => moments.factorise(),
        }
    }
    fn share_before(&self, depth: T, beta: T) -> T {
        match self {
            Self::Power(moments) => moments.share_before(depth, beta),
            Self::Trigonometric(moments) => moments.share_before(depth, beta),
        }
    }
}

/// ζ, from −1 at the nearest of a scene's depths to 1 at the farthest.
fn warped<T: Real>(depth: T, range: DepthRange) -> T {
    let x = depth_in_range(depth, range);
    x + x - T::ONE
}

impl Mboit {
    pub fn of(parameters: &Parameters) -> Self {
        Self {
            half: (parameters.count("moments") / 2).clamp(2, 4),
            trigonometric: parameters.flag("trigonometric"),
            bits: if parameters.count("bits") == 16 { Bits::Sixteen } else { Bits::ThirtyTwo },
            beta: parameters.number("beta"),
            range: parameters.depth_range(),
        }
    }

    pub fn is_trigonometric(&self) -> bool {
        self.trigonometric
    }

    /// More numbers a pixel than four, beside the total.
    pub fn has_high_moments(&self) -> bool {
        self.half > 2
    }
}

impl Described for Mboit {
    fn constants(&self) -> Vec<(&'static str, String)> {
        let mut constants = vec![
            ("HALF", format!("{}u", self.half)),
            ("LEAST_PIVOT", format!("{LEAST_PIVOT:?}")),
            ("LEAST_RUN", format!("{LEAST_RUN:?}")),
            ("FAR_ROOT", format!("{:?}", roots::FAR)),
            ("ROOT_STEPS", format!("{}u", roots::STEPS)),
            ("MOST_ABSORBANCE", format!("{MOST_ABSORBANCE:?}")),
        ];
        if self.trigonometric {
            constants.push(("BIAS", format!("{:?}", trigonometric_moments::bias(self.half))));
            constants.push(("ZONE", format!("{:?}", trigonometric_moments::ZONE)));
            constants.push(("ZONE_START", format!("{:?}", trigonometric_moments::zone_start())));
        } else {
            let (bias, towards) = power_moments::bias(self.half, self.bits);
            let vector =
                |of: &[f64]| format!("vec4f({})", of.iter().map(|v| format!("{v:?}, ")).collect::<String>());
            constants.push(("BIAS", format!("{bias:?}")));
            constants.push(("SIXTEEN_BITS", format!("{}", self.bits == Bits::Sixteen)));
            constants.push(("TOWARDS_LOW", vector(&towards[..4])));
            constants.push(("TOWARDS_HIGH", vector(&towards[4..])));
        }
        constants
    }
    fn common(&self) -> &'static [&'static str] {
        if self.trigonometric {
            &[
                "methods/common/layer",
                "methods/common/absorbance",
                "methods/common/depth",
                "methods/common/shade",
                "methods/common/roots",
                "methods/common/interpolation",
                "methods/common/trigonometric_moments",
            ]
        } else {
            &[
                "methods/common/layer",
                "methods/common/absorbance",
                "methods/common/depth",
                "methods/common/shade",
                "methods/common/roots",
                "methods/common/interpolation",
                "methods/common/power_moments",
            ]
        }
    }
    fn values(&self) -> Values {
        Values { range: self.range, beta: self.beta, ..Values::default() }
    }
    fn work(&self, _: u32) -> (u32, u32) {
        (2, roots::STEPS * (self.half as u32 - 2))
    }
}

impl<T: Real> Streamed<T> for Mboit {
    type State = State<T>;

    fn begin(&self, _: Place) -> State<T> {
        let moments = if self.trigonometric {
            Moments::Trigonometric(TrigonometricMoments::none(self.half))
        } else {
            Moments::Power(PowerMoments::none(self.half, self.bits))
        };
        State { moments, shade: Shade::none() }
    }

    fn turn(&self, state: &mut State<T>, pass: u32) -> bool {
        if pass == 1 && state.moments.total() > T::ZERO {
            state.moments.factorise();
            return true;
        }
        pass == 0
    }

    fn insert(&self, state: &mut State<T>, fragment: &Fragment<T>, pass: u32) {
        let a = fragment.color[3];
        if a <= T::ZERO {
            return;
        }
        let depth = warped(fragment.depth, self.range);
        if pass == 0 {
            state.moments.add(absorbance(a).smaller(T::from_f64(MOST_ABSORBANCE)), depth);
            return;
        }
        let share = state.moments.share_before(depth, T::from_f64(self.beta));
        let before = share * state.moments.total();
        state.shade.add(fragment.color, before);
    }

    fn end(&self, state: &State<T>, behind: [T; 4]) -> [T; 4] {
        state.shade.layer().over(behind)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::tests::{fragment, run};

    fn of(half: usize, trigonometric: bool, beta: f64) -> Mboit {
        Mboit { half, trigonometric, bits: Bits::ThirtyTwo, beta, range: (1.0, 4.0) }
    }

    #[test]
    fn two_depths_are_exact_without_overestimation_and_not_with_it() {
        let two = [fragment(4, [0.0, 1.0, 0.0, 0.5]), fragment(1, [1.0, 0.0, 0.0, 0.5])];
        for trigonometric in [false, true] {
            for half in 2..=4 {
                let off = |beta| (run(&of(half, trigonometric, beta), &two).0[0] - 0.5).abs();
                assert!(off(0.0) < 1e-5, "{half} {trigonometric}");
                // The one in front keeps T = ½^¼, the other ½ · ½^¼: the same in proportion.
                assert!(off(0.25) < 1e-4, "{half} {trigonometric}");
            }
        }
        let unequal = [fragment(4, [0.0, 1.0, 0.0, 0.9]), fragment(1, [1.0, 0.0, 0.0, 0.5])];
        assert!((run(&of(2, false, 0.25), &unequal).0[0] - 0.5).abs() > 0.01);
    }

    #[test]
    fn alpha_1_covers_all_and_dense_pixels_keep_a_color() {
        assert_eq!(run(&of(2, false, 0.25), &[fragment(1, [1.0; 4])]).0, [1.0; 4]);
        let dense: Vec<_> = (0..3000).map(|i| fragment(i % 4 + 1, [0.5, 0.25, 1.0, 1.0])).collect();
        assert_eq!(run(&of(4, false, 1.0), &dense).0, [0.5, 0.25, 1.0, 1.0]);
        assert_eq!(run(&of(2, true, 0.25), &[fragment(1, [1.0, 1.0, 1.0, 0.0])]).0, [0.0; 4]);
    }
}
