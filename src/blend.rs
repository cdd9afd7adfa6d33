//! Blend modes as affine maps of what lies behind (GPU Pro 2, section 2.6.4; Porter and Duff 1984).
//!
//! A fragment with straight colour c and alpha α turns the destination d into a + f·d in each channel, and
//! the alpha behind it, A, into a₄ + f₄·A. Affine maps compose: fragments may be taken front to back, with
//! the product of all f so far as a transmittance per channel (underblending: Bavoil and Myers 2008), or in any
//! other order that puts one in front of the other.

use crate::real::Real;

/// The modes by id, as meshes, nodes and lists name them. Ids from here on are a user's own blends.
pub const MODES: [&str; 5] = ["over", "additive", "multiply", "screen", "premultiplied"];
pub const OVER: u8 = 0;
const ADDITIVE: u8 = 1;
const MULTIPLY: u8 = 2;
const SCREEN: u8 = 3;
const PREMULTIPLIED: u8 = 4;

/// What fragments, one or several, make of the destination behind them: a + f·d in each channel.
#[derive(Debug, Clone, Copy)]
pub struct Affine<T> {
    /// Premultiplied RGB, then alpha.
    a: [T; 4],
    /// The transmittance.
    f: [T; 4],
}

impl<T: Real> Affine<T> {
    /// Of no fragment.
    #[inline]
    pub fn identity() -> Self {
        Self { a: [T::ZERO; 4], f: [T::ONE; 4] }
    }

    /// Of one fragment, straight.
    #[inline]
    pub fn of(mode: u8, [r, g, b, alpha]: [T; 4]) -> Self {
        let (zero, one) = (T::ZERO, T::ONE);
        let through = one - alpha;
        let [pr, pg, pb] = [alpha * r, alpha * g, alpha * b];
        let through_plus = |c: T| alpha.times_plus(c, through);
        let one_minus = |c: T| (-alpha).times_plus(c, one);
        let (a, f) = match mode {
            ADDITIVE => ([pr, pg, pb, zero], [one; 4]),
            MULTIPLY => ([zero; 4], [through_plus(r), through_plus(g), through_plus(b), one]),
            SCREEN => ([pr, pg, pb, zero], [one_minus(r), one_minus(g), one_minus(b), one]),
            PREMULTIPLIED => ([r, g, b, alpha], [through; 4]),
            _ => ([pr, pg, pb, alpha], [through; 4]),
        };
        Self { a, f }
    }

    /// These fragments in front of others.
    #[inline]
    pub fn onto(self, back: Self) -> Self {
        Self { a: self.of_destination(back.a), f: std::array::from_fn(|i| self.f[i] * back.f[i]) }
    }

    /// The premultiplied colour over a straight background.
    #[inline]
    pub fn over(self, background: [T; 4]) -> [T; 4] {
        self.of_destination(premultiplied(background))
    }

    /// What becomes of a premultiplied destination.
    #[inline]
    pub fn of_destination(self, destination: [T; 4]) -> [T; 4] {
        std::array::from_fn(|i| self.f[i].times_plus(destination[i], self.a[i]))
    }

    /// Nothing behind can change any channel any more.
    #[inline]
    pub fn is_saturated(&self) -> bool {
        self.f.iter().all(|&f| f == T::ZERO)
    }
}

/// Straight RGBA as the destination that fragments are blended onto.
#[inline]
pub fn premultiplied<T: Real>([r, g, b, a]: [T; 4]) -> [T; 4] {
    [a * r, a * g, a * b, a]
}

#[cfg(test)]
mod tests {
    use super::*;

    const COLOR: [f64; 4] = [0.9, 0.4, 0.1, 0.6];
    const OTHER: [f64; 4] = [0.3, 0.6, 0.9, 0.25];
    const BEHIND: [f64; 4] = [0.2, 0.5, 0.8, 1.0];

    /// The definitions of section 2.6.4's modes, channel by channel.
    fn defined(mode: u8, d: f64, c: f64, alpha: f64) -> f64 {
        match MODES[mode as usize] {
            "over" => d * (1.0 - alpha) + alpha * c,
            "additive" => d + alpha * c,
            "multiply" => d * (1.0 - alpha + alpha * c),
            "screen" => 1.0 - (1.0 - d) * (1.0 - alpha * c),
            _ => d * (1.0 - alpha) + c,
        }
    }

    #[test]
    fn one_fragment_of_each_mode_is_what_the_mode_says() {
        for mode in 0..5 {
            let got = Affine::of(mode, COLOR).over(BEHIND);
            for i in 0..3 {
                let wanted = defined(mode, BEHIND[i], COLOR[i], COLOR[3]);
                assert!((got[i] - wanted).abs() < 1e-15, "{} channel {i}", MODES[mode as usize]);
            }
        }
    }

    #[test]
    fn only_over_and_premultiplied_raise_alpha() {
        for mode in 0..5 {
            let got = Affine::of(mode, COLOR).of_destination([0.0; 4])[3];
            let raises = ["over", "premultiplied"].contains(&MODES[mode as usize]);
            assert_eq!(got, if raises { 0.6 } else { 0.0 });
        }
    }

    #[test]
    fn both_directions_agree_for_every_pair_of_modes() {
        for front in 0..5 {
            for back in 0..5 {
                let (a, b) = (Affine::of(front, COLOR), Affine::of(back, OTHER));
                let under = Affine::identity().onto(a).onto(b).over(BEHIND);
                let over = a.of_destination(b.over(BEHIND));
                assert!((0..4).all(|i| (under[i] - over[i]).abs() < 1e-15), "{front} {back}");
            }
        }
    }

    #[test]
    fn additive_and_multiply_commute_with_themselves_and_over_does_not() {
        let changes = |mode: u8| {
            let (a, b) = (Affine::of(mode, COLOR), Affine::of(mode, OTHER));
            let (one, two) = (b.onto(a).over(BEHIND), a.onto(b).over(BEHIND));
            (0..4).any(|i| (one[i] - two[i]).abs() > 1e-12)
        };
        assert!(!changes(ADDITIVE) && !changes(MULTIPLY) && !changes(SCREEN));
        assert!(changes(OVER) && changes(PREMULTIPLIED));
    }
}
