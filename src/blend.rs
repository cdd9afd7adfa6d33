//! Blend modes as affine maps of what lies behind (GPU Pro 2, section 2.6.4; Porter and Duff 1984).
//!
//! A fragment with straight colour c and alpha α turns the destination d into a + f·d in each channel, and
//! the alpha behind it, A, into a₄ + f₄·A. Affine maps compose: fragments may be taken front to back, with
//! the product of all f so far as a transmittance per channel (underblending: Bavoil and Myers 2008).

use crate::real::Real;

/// The modes by id, as meshes, nodes and lists name them. Ids from here on are a user's own blends.
pub const MODES: [&str; 5] = ["over", "additive", "multiply", "screen", "premultiplied"];
pub const OVER: u8 = 0;
const ADDITIVE: u8 = 1;
const MULTIPLY: u8 = 2;
const SCREEN: u8 = 3;
const PREMULTIPLIED: u8 = 4;

/// (a, f) of a fragment with straight RGBA.
#[inline]
pub fn affine<T: Real>(mode: u8, [r, g, b, alpha]: [T; 4]) -> ([T; 4], [T; 4]) {
    let (zero, one) = (T::ZERO, T::ONE);
    let through = one - alpha;
    let [pr, pg, pb] = [alpha * r, alpha * g, alpha * b];
    let through_plus = |c: T| alpha.times_plus(c, through);
    let one_minus = |c: T| (-alpha).times_plus(c, one);
    match mode {
        ADDITIVE => ([pr, pg, pb, zero], [one; 4]),
        MULTIPLY => ([zero; 4], [through_plus(r), through_plus(g), through_plus(b), one]),
        SCREEN => ([pr, pg, pb, zero], [one_minus(r), one_minus(g), one_minus(b), one]),
        PREMULTIPLIED => ([r, g, b, alpha], [through; 4]),
        _ => ([pr, pg, pb, alpha], [through; 4]),
    }
}

/// Fragments of any affine mode, front to back.
#[derive(Debug, Clone, Copy)]
pub struct State<T> {
    /// Premultiplied RGB, then alpha.
    rgba: [T; 4],
    transmittance: [T; 4],
}

impl<T: Real> State<T> {
    #[inline]
    pub fn begin() -> Self {
        Self { rgba: [T::ZERO; 4], transmittance: [T::ONE; 4] }
    }

    /// Puts a fragment (straight RGBA) behind those inserted before it.
    #[inline]
    pub fn insert(&mut self, mode: u8, color: [T; 4]) {
        let (a, f) = affine(mode, color);
        self.rgba = std::array::from_fn(|i| self.transmittance[i].times_plus(a[i], self.rgba[i]));
        self.transmittance = std::array::from_fn(|i| self.transmittance[i] * f[i]);
    }

    /// Nothing behind can change any channel any more.
    #[inline]
    pub fn is_saturated(&self) -> bool {
        self.transmittance.iter().all(|&t| t == T::ZERO)
    }

    /// The premultiplied colour over a straight background.
    #[inline]
    pub fn end(self, background: [T; 4]) -> [T; 4] {
        let behind = premultiplied(background);
        std::array::from_fn(|i| self.transmittance[i].times_plus(behind[i], self.rgba[i]))
    }
}

/// Straight RGBA as the destination that fragments are blended onto.
#[inline]
pub fn premultiplied<T: Real>([r, g, b, a]: [T; 4]) -> [T; 4] {
    [a * r, a * g, a * b, a]
}

/// One fragment over a premultiplied destination: the step of the way from back to front.
#[inline]
pub fn onto<T: Real>(destination: [T; 4], mode: u8, color: [T; 4]) -> [T; 4] {
    let (a, f) = affine(mode, color);
    std::array::from_fn(|i| f[i].times_plus(destination[i], a[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const COLOR: [f64; 4] = [0.9, 0.4, 0.1, 0.6];
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
            let mut state = State::begin();
            state.insert(mode, COLOR);
            let got = state.end(BEHIND);
            for i in 0..3 {
                let wanted = defined(mode, BEHIND[i], COLOR[i], COLOR[3]);
                assert!((got[i] - wanted).abs() < 1e-15, "{} channel {i}", MODES[mode as usize]);
            }
        }
    }

    #[test]
    fn only_over_and_premultiplied_raise_alpha() {
        for mode in 0..5 {
            let got = onto([0.0; 4], mode, COLOR)[3];
            let raises = ["over", "premultiplied"].contains(&MODES[mode as usize]);
            assert_eq!(got, if raises { 0.6 } else { 0.0 });
        }
    }

    #[test]
    fn both_directions_agree_for_every_pair_of_modes() {
        for front in 0..5 {
            for back in 0..5 {
                let mut state = State::begin();
                state.insert(front, COLOR);
                state.insert(back, [0.3, 0.6, 0.9, 0.25]);
                let under = state.end(BEHIND);
                let over = onto(onto(premultiplied(BEHIND), back, [0.3, 0.6, 0.9, 0.25]), front, COLOR);
                assert!((0..4).all(|i| (under[i] - over[i]).abs() < 1e-15), "{front} {back}");
            }
        }
    }

    #[test]
    fn additive_and_multiply_commute_with_themselves_and_over_does_not() {
        let other = [0.3, 0.6, 0.9, 0.25];
        let changes = |mode: u8| {
            let one = onto(onto(BEHIND, mode, COLOR), mode, other);
            let two = onto(onto(BEHIND, mode, other), mode, COLOR);
            (0..4).any(|i| (one[i] - two[i]).abs() > 1e-12)
        };
        assert!(!changes(ADDITIVE) && !changes(MULTIPLY) && !changes(SCREEN));
        assert!(changes(OVER) && changes(PREMULTIPLIED));
    }
}
