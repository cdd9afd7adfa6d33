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

/// λ and b* for so many moments, for 32-bit floats: of the paper's published code.
pub fn bias(half: usize) -> (f64, [f64; 8]) {
    match half {
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

#[derive(Debug, Clone, Copy)]
pub struct PowerMoments<T> {
    half: usize,
    /// b₀ to b₈.
    sums: [T; 9],
    /// B = L D Lᵀ: L, whose diagonal is 1 and whose first column is that of B, and D.
    lower: [[T; 5]; 5],
    pivots: [T; 5],
}

impl<T: Real> PowerMoments<T> {
    /// `half`: m, from 2 to 4.
    pub fn none(half: usize) -> Self {
        Self { half, sums: [T::ZERO; 9], lower: [[T::ZERO; 5]; 5], pivots: [T::ONE; 5] }
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
    }

    /// When all have been added, and their total is not 0.
    pub fn factorise(&mut self) {
        let (lambda, towards) = bias(self.half);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_depths_as_half_the_moments_are_told_apart() {
        let all = [(-0.8, 0.3), (-0.1, 1.2), (0.4, 0.1), (0.9, 2.0)];
        for half in 2..=4 {
            let mut moments = PowerMoments::<f64>::none(half);
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
    fn one_depth_has_everything_and_nothing_in_front() {
        let mut moments = PowerMoments::<f32>::none(2);
        moments.add(0.7, 1.0);
        moments.factorise();
        assert!(moments.share_before(1.0, 0.0) < 1e-5);
        assert!((moments.share_before(1.0, 1.0) - 1.0).abs() < 1e-5);
    }
}
