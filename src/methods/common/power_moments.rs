//! Power moments of absorbance over depth: b_k = Σ aᵢ ζᵢᵏ, k from 0 to n = 2 m, and how much of it may lie in front of a
//! depth (Peters and Klein 2015; Münstermann, Krumpen, Klein and Peters 2018, section 3).
//!
//! Moments normalised by b₀ and biased, b ← (1 − λ) b + λ b*, make a Hankel matrix B. Of all distributions with these
//! moments one has m + 1 depths, ζ itself among them (its canonical representation). The others are the roots of q, with
//! B q = (1, ζ, …, ζᵐ)ᵀ. What is in front of ζ is at least what is at roots in front, and at most that and what is at ζ
//! (interpolation.rs).

use super::complex::Complex;
use super::interpolation::Nodes;
use super::roots::{Polynomial, real_roots};
use crate::real::Real;

/// λ and b* for so many moments of so many bits: of the paper's published code.
pub fn bias(half: usize, bits: Bits) -> (f64, [f64; 8]) {
    match half {
        2 if bits == Bits::Sixteen => (6e-5, [0.0, 0.628, 0.0, 0.628, 0.0, 0.0, 0.0, 0.0]),
        2 => (5e-7, [0.0, 0.375, 0.0, 0.375, 0.0, 0.0, 0.0, 0.0]),
        3 => (5e-6, [0.0, 0.48, 0.0, 0.451, 0.0, 0.45, 0.0, 0.0]),
        _ => (5e-5, [0.0, 0.75, 0.0, 0.676_666_67, 0.0, 0.63, 0.0, 0.600_303_03]),
    }
}

/// Schur complements are concave: a pivot is at least λ times that of b*, which is over this in all the tables here and
/// of trigonometric moments. One that is less was rounded.
pub const LEAST_PIVOT: f64 = 1e-7;
/// Where a depth's powers still fit into float32, and its share of any moments that are left is nothing.
const FAR: f64 = 1e3;

/// What a moment takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bits {
    /// A float.
    ThirtyTwo,
    /// A 16-bit fraction of four moments that are kept normalised, where each fragment reads and writes them anew.
    Sixteen,
}

#[derive(Debug, Clone, Copy)]
pub struct PowerMoments<T> {
    half: usize,
    bits: Bits,
    /// b₀ to b₈.
    sums: [T; 9],
    /// B = L D Lᵀ: L, whose diagonal is 1 and whose first column is that of B, and D.
    lower: [[T; 5]; 5],
    pivots: [T; 5],
}

impl<T: Real> PowerMoments<T> {
    /// `half`: m, from 2 to 4.
    pub fn none(half: usize, bits: Bits) -> Self {
        Self { half, bits, sums: [T::ZERO; 9], lower: [[T::ZERO; 5]; 5], pivots: [T::ONE; 5] }
    }

    pub fn total(&self) -> T {
        self.sums[0]
    }

    pub fn add(&mut self, absorbance: T, depth: T) {
        let mut power = absorbance;
        for sum in &mut self.sums[..=2 * self.half] {
            *sum = *sum + power;
            power = power * depth;
        }
        if self.bits == Bits::Sixteen && self.sums[0] > T::ZERO {
            let normalised = std::array::from_fn(|i| self.sums[i + 1] / self.sums[0]);
            let stored = from_fractions(to_fractions(normalised).map(|x| rounded(x, 65_535)));
            (0..4).for_each(|i| self.sums[i + 1] = self.sums[0] * stored[i]);
        }
    }

    /// When all have been added, and their total is not 0.
    pub fn factorise(&mut self) {
        let (lambda, towards) = bias(self.half, self.bits);
        let keep = T::from_f64(1.0 - lambda);
        let mut b = [T::ONE; 9];
        for k in 1..=2 * self.half {
            b[k] = keep * (self.sums[k] / self.sums[0]) + T::from_f64(lambda * towards[k - 1]);
        }
        for j in 0..=self.half {
            for i in j..=self.half {
                let known = |s| self.lower[i][s] * self.lower[j][s] * self.pivots[s];
                let left = (0..j).fold(b[i + j], |left, s| left - known(s));
                if i == j {
                    self.pivots[j] = T::from_f64(LEAST_PIVOT).larger(left);
                    self.lower[j][j] = T::ONE;
                } else {
                    self.lower[i][j] = left / self.pivots[j];
                }
            }
        }
    }

    /// L⁻¹ (1, x, …, xᵐ)ᵀ: the orthogonal polynomials at x.
    fn orthogonal(&self, x: T) -> [T; 5] {
        let mut y = [T::ONE; 5];
        let mut power = T::ONE;
        for i in 1..=self.half {
            power = power * x;
            y[i] = (0..i).fold(power, |left, s| left - self.lower[i][s] * y[s]);
        }
        y
    }

    /// How much of the whole is in front of a depth: `beta` is 0 for the least, 1 for the most that it may be.
    pub fn share_before(&self, depth: T, beta: T) -> T {
        let m = self.half;
        let y = self.orthogonal(depth);
        let mut q = [T::ZERO; 5];
        for i in (0..=m).rev() {
            q[i] = (i + 1..=m).fold(y[i] / self.pivots[i], |left, s| left - self.lower[s][i] * q[s]);
        }
        let mut leading_first: Polynomial<T> = [T::ZERO; 5];
        for i in 0..=m {
            leading_first[i] = q[m - i];
        }
        let (roots, count) = real_roots(leading_first, m);
        let far = T::from_f64(FAR);
        let real = |x| Complex(x, T::ZERO);
        let mut nodes = Nodes::new(real(depth), beta, m);
        for root in &roots[..count] {
            nodes.add(real(root.clamped(-far, far)), if *root < depth { T::ONE } else { T::ZERO });
        }
        nodes.in_front(m, self.lower.map(|row| real(row[0])))
    }
}

/// Moments b₁ to b₄, of ζ in −1 … 1, as four numbers in 0 … 1 that use all of it (paper's published code).
fn to_fractions<T: Real>([b1, b2, b3, b4]: [T; 4]) -> [T; 4] {
    let n = T::from_f64;
    [
        n(1.5) * b1 - n(2.0) * b3 + n(0.5),
        n(4.0) * b2 - n(4.0) * b4,
        n(0.5 * 3.0_f64.sqrt()) * b1 - n(2.0 / 9.0 * 3.0_f64.sqrt()) * b3 + n(0.5),
        n(0.5) * b2 + n(0.5) * b4,
    ]
}

/// The inverse.
fn from_fractions<T: Real>([q1, q2, q3, q4]: [T; 4]) -> [T; 4] {
    let n = T::from_f64;
    let (q1, q3) = (q1 - n(0.5), q3 - n(0.5));
    [
        n(3.0_f64.sqrt()) * q3 - n(1.0 / 3.0) * q1,
        n(0.125) * q2 + q4,
        n(0.75 * 3.0_f64.sqrt()) * q3 - n(0.75) * q1,
        q4 - n(0.125) * q2,
    ]
}

/// To the nearest of so many steps from 0 to 1.
fn rounded<T: Real>(x: T, steps: i32) -> T {
    let steps = T::from_i32(steps);
    let nearest = x.clamped(T::ZERO, T::ONE) * steps + T::from_f64(0.5);
    T::from_i32(nearest.floor_to_i32()) / steps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_depths_as_half_the_moments_are_told_apart() {
        let all = [(-0.8, 0.3), (-0.1, 1.2), (0.4, 0.1), (0.9, 2.0)];
        for half in 2..=4 {
            let mut moments = PowerMoments::<f64>::none(half, Bits::ThirtyTwo);
            for (depth, a) in &all[..half] {
                moments.add(*a, *depth);
            }
            moments.factorise();
            let mut before = 0.0;
            for (depth, a) in &all[..half] {
                for (beta, wanted) in [(0.0, before), (1.0, before + a)] {
                    let share = moments.share_before(*depth, beta);
                    // The bias moves a few λ; in the matrix of eight moments these depths are close together.
                    assert!((share - wanted / moments.total()).abs() < 2e-4, "{half} {depth} {share}");
                }
                before += a;
            }
        }
    }

    #[test]
    fn moments_as_fractions_are_in_0_to_1_and_come_back() {
        let at = |x: f64| [x, x * x, x * x * x, x * x * x * x];
        for step in 0..=1000 {
            let moments = at(f64::from(step) / 500.0 - 1.0);
            let fractions = to_fractions(moments);
            assert!(fractions.iter().all(|q| (-1e-15..=1.0 + 1e-15).contains(q)), "{fractions:?}");
            let back = from_fractions(fractions);
            assert!(
                moments.iter().zip(back).all(|(b, back)| (b - back).abs() < 1e-15),
                "{moments:?} {back:?}"
            );
        }
    }

    #[test]
    fn sixteen_bits_are_the_nearest_step_of_each_fraction_and_stay_it() {
        for step in 0..=100 {
            let depth = f64::from(step) / 50.0 - 1.0;
            let mut moments = PowerMoments::<f64>::none(2, Bits::Sixteen);
            moments.add(0.7, depth);
            let normalised =
                |m: &PowerMoments<f64>| std::array::from_fn::<f64, 4, _>(|i| m.sums[i + 1] / m.sums[0]);
            let exact = to_fractions([depth, depth.powi(2), depth.powi(3), depth.powi(4)]);
            for (q, stored) in exact.iter().zip(to_fractions(normalised(&moments))) {
                assert!((q - stored).abs() <= 0.5 / 65_535.0 + 1e-15, "{depth} {q} {stored}");
                assert!((stored * 65_535.0 - (stored * 65_535.0).round()).abs() < 1e-9);
            }
            let before = normalised(&moments);
            moments.add(0.0, 0.3);
            assert!(before.iter().zip(normalised(&moments)).all(|(a, b)| (a - b).abs() < 1e-15));
        }
    }

    #[test]
    fn one_depth_has_everything_and_nothing_in_front() {
        let mut moments = PowerMoments::<f32>::none(2, Bits::ThirtyTwo);
        moments.add(0.7, 1.0);
        moments.factorise();
        assert!(moments.share_before(1.0, 0.0) < 1e-5);
        assert!((moments.share_before(1.0, 1.0) - 1.0).abs() < 1e-5);
    }
}
