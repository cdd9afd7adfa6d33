//! Trigonometric moments of absorbance over depth: b_j = Σ aᵢ e^{i j φᵢ}, j from 0 to m, with depths around a circle,
//! φ = (ζ + 1) (π − θ/2) (Münstermann, Krumpen, Klein and Peters 2018, section 3). The zone θ keeps the farthest depth from
//! being next to the nearest.
//!
//! As power moments (of that name, in this folder) they make a matrix, B_jk = b_{j−k}, Hermitian and Toeplitz, and the
//! canonical representation of a phase has it and m other points of the circle, where v(x)ᴴ q = 0, with
//! B q = v(e^{iφ}). Around the circle that is a real polynomial of t = tan((ψ − φ)/2): B is its own transpose on reversing
//! both orders, so that e^{i m (ψ − φ)/2} v(e^{iψ})ᴴ q is real.

use super::complex::Complex;
use super::interpolation::Nodes;
use super::power_moments::LEAST_PIVOT;
use super::roots::{Polynomial, real_roots};
use crate::real::Real;
use std::f64::consts::PI;

/// θ, as published.
pub const ZONE: f64 = PI / 10.0;

/// λ for m moments, for 32-bit floats: of the paper's published code. What they are biased towards is 0, a circle with
/// the same everywhere.
pub fn bias(half: usize) -> f64 {
    match half {
        2 => 4e-7,
        3 => 8e-7,
        _ => 1.5e-6,
    }
}

/// e^{iφ} of a depth. From φ − π, which is in the range where all devices have sines.
fn point_of<T: Real>(depth: T) -> Complex<T> {
    let angle = depth * T::from_f64(PI - ZONE / 2.0) - T::from_f64(ZONE / 2.0);
    let (sin, cos) = angle.sin_cos();
    Complex(-cos, -sin)
}

/// That of a depth, which is not in the zone: the nearest, at 0, may be rounded to the zone's end.
fn place_of<T: Real>(point: Complex<T>) -> T {
    let place = around(point);
    if place > T::from_f64((zone_start() + 7.0) / 2.0) { T::from_f64(-1.0) } else { place }
}

/// Rises once around the circle, from −1 to 7, as the phase does from 0 on; piecewise rational (paper's published code).
fn around<T: Real>(Complex(x, y): Complex<T>) -> T {
    let r = y.abs() - x.abs();
    let r = if x < T::ZERO { T::from_f64(2.0) - r } else { r };
    if y < T::ZERO { T::from_f64(6.0) - r } else { r }
}

/// Where the zone begins, by `around`.
pub fn zone_start() -> f64 {
    around(Complex((2.0 * PI - ZONE).cos(), (2.0 * PI - ZONE).sin()))
}

#[derive(Debug, Clone, Copy)]
pub struct TrigonometricMoments<T> {
    half: usize,
    total: T,
    /// b₁ to b₄.
    sums: [Complex<T>; 4],
    /// B = L D Lᴴ: L, whose diagonal is 1 and whose first column is that of B, and D.
    lower: [[Complex<T>; 5]; 5],
    pivots: [T; 5],
}

impl<T: Real> TrigonometricMoments<T> {
    /// `half`: m, from 2 to 4.
    pub fn none(half: usize) -> Self {
        let lower = [[Complex::ZERO; 5]; 5];
        Self { half, total: T::ZERO, sums: [Complex::ZERO; 4], lower, pivots: [T::ONE; 5] }
    }

    pub fn total(&self) -> T {
        self.total
    }

    pub fn add(&mut self, absorbance: T, depth: T) {
        self.total = self.total + absorbance;
        let point = point_of(depth);
        let mut power = Complex(absorbance, T::ZERO);
        for sum in &mut self.sums[..self.half] {
            power = power * point;
            *sum = *sum + power;
        }
    }

    /// When all have been added, and their total is not 0.
    pub fn factorise(&mut self) {
        let keep = T::from_f64(1.0 - bias(self.half));
        let mut b = [Complex::ONE; 5];
        for (b, sum) in b[1..].iter_mut().zip(self.sums) {
            *b = Complex(sum.0 / self.total, sum.1 / self.total).scaled(keep);
        }
        for j in 0..=self.half {
            for i in j..=self.half {
                let known =
                    |s: usize| (self.lower[i][s] * self.lower[j][s].conjugate()).scaled(self.pivots[s]);
                let left = (0..j).fold(b[i - j], |left, s| left - known(s));
                if i == j {
                    self.pivots[j] = T::from_f64(LEAST_PIVOT).larger(left.0);
                    self.lower[j][j] = Complex::ONE;
                } else {
                    self.lower[i][j] = Complex(left.0 / self.pivots[j], left.1 / self.pivots[j]);
                }
            }
        }
    }

    /// L⁻¹ (1, x, …, xᵐ)ᵀ: the orthogonal polynomials at x.
    fn orthogonal(&self, x: Complex<T>) -> [Complex<T>; 5] {
        let mut y = [Complex::ONE; 5];
        let mut power = Complex::ONE;
        for i in 1..=self.half {
            power = power * x;
            y[i] = (0..i).fold(power, |left, s| left - self.lower[i][s] * y[s]);
        }
        y
    }

    /// e^{i m (ψ − φ)/2} v(e^{iψ})ᴴ q, as a polynomial of t = tan((ψ − φ)/2) over (1 + t²)^{m/2}: Σ p_j (1 + i t)^{m−j}
    /// (1 − i t)ʲ with p_j = q_j e^{−i j φ}.
    fn polynomial(&self, point: Complex<T>, y: &[Complex<T>; 5]) -> Polynomial<T> {
        let n = T::from_f64;
        let m = self.half;
        let mut q = [Complex::ZERO; 5];
        for i in (0..=m).rev() {
            let own = Complex(y[i].0 / self.pivots[i], y[i].1 / self.pivots[i]);
            q[i] = (i + 1..=m).fold(own, |left, s| left - self.lower[s][i].conjugate() * q[s]);
        }
        let mut back = Complex::ONE;
        let mut p = q;
        for p in &mut p[..=m] {
            *p = *p * back;
            back = back * point.conjugate();
        }
        // p_{m−j} is the conjugate of p_j but for roundings, which 1/λ magnifies: what is not so is none of q.
        let half_of = |j: usize| (p[j] + p[m - j].conjugate()).scaled(n(0.5));
        let (Complex(a0, c0), Complex(a1, c1)) = (half_of(0), half_of(1));
        let (two, three, four) = (n(2.0), n(3.0), n(4.0));
        match m {
            2 => [a1 - two * a0, -(four * c0), two * a0 + a1, T::ZERO, T::ZERO],
            3 => [c0 - c1, a1 - three * a0, -(three * c0 + c1), a0 + a1, T::ZERO],
            _ => {
                let a2 = half_of(2).0;
                let (even, odd) = (two * a0 + a2, n(8.0) * c0);
                [
                    even - two * a1,
                    odd - four * c1,
                    two * a2 - n(12.0) * a0,
                    -(odd + four * c1),
                    even + two * a1,
                ]
            }
        }
    }

    /// How much of the whole is in front of a depth: `beta` is 0 for the least, 1 for the most that it may be.
    pub fn share_before(&self, depth: T, beta: T) -> T {
        let n = T::from_f64;
        let point = point_of(depth);
        let y = self.orthogonal(point);
        // In the zone it rises from 0 to 1: what is there is neither far nor near.
        let start = n(zone_start());
        let own_place = place_of(point);
        let scale = T::ONE / (n(7.0) - start);
        let mut nodes = Nodes::new(point, beta, self.half);
        let (roots, count) = real_roots(self.polynomial(point, &y), self.half);
        for t in &roots[..count] {
            let square = *t * *t;
            let below = T::ONE / (T::ONE + square);
            let turned = Complex((T::ONE - square) * below, (*t + *t) * below) * point;
            let place = around(turned);
            let zone = ((place - start) * scale).clamped(T::ZERO, T::ONE);
            nodes.add(turned, if place < own_place { T::ONE } else { zone });
        }
        nodes.in_front(self.half, self.lower.map(|row| row[0]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_depths_as_moments_are_told_apart() {
        let all = [(-0.8, 0.3), (-0.1, 1.2), (0.4, 0.1), (0.9, 2.0)];
        for half in 2..=4 {
            let mut moments = TrigonometricMoments::<f64>::none(half);
            for (depth, a) in &all[..half] {
                moments.add(*a, *depth);
            }
            moments.factorise();
            let mut before = 0.0;
            for (depth, a) in &all[..half] {
                for (beta, wanted) in [(0.0, before), (1.0, before + a)] {
                    let share = moments.share_before(*depth, beta);
                    assert!((share - wanted / moments.total()).abs() < 1e-5, "{half} {depth} {share}");
                }
                before += a;
            }
        }
    }

    #[test]
    fn places_rise_around_the_circle() {
        let places: Vec<f64> = (0..=20).map(|i| around(point_of(f64::from(i) / 10.0 - 1.0))).collect();
        assert!(places.windows(2).all(|pair| pair[0] < pair[1]));
        assert!((places[0] + 1.0).abs() < 1e-12 && (places[20] - zone_start()).abs() < 1e-12);
    }
}
