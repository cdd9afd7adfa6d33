//! How much of a whole is in front of a depth, from its moments and the depths of its canonical representation
//! (Münstermann, Krumpen, Klein and Peters 2018, section 3): the moments' product with the polynomial through f, which is 1
//! at depths in front, 0 behind and β at the depth itself, by Newton's divided differences.
//!
//! Of moments of few depths some roots stand for nothing. Where one of them comes close to a layer, what moments round
//! moves both by its square root, in float32 a thousandth. That changes nothing here: the polynomial is the same wherever
//! between them 1 is, as long as differences of equal values are 0, not roundings over roundings. Hence the order: the depth
//! itself, then all in front, then all behind.

use super::complex::Complex;
use crate::real::Real;

/// Below it a root would be the depth itself, up to roundings: of the biased matrix one is at least some λ away.
pub const LEAST_RUN: f64 = 1e-8;

/// Nodes of at most eight moments.
#[derive(Debug, Clone, Copy)]
pub struct Nodes<T> {
    at: [Complex<T>; 5],
    values: [T; 5],
    /// Where the next in front goes, and the last that is free.
    free: (usize, usize),
}

impl<T: Real> Nodes<T> {
    /// The depth itself, with β; `half` others are to come.
    pub fn new(own: Complex<T>, beta: T, half: usize) -> Self {
        Self { at: [own; 5], values: [beta; 5], free: (1, half) }
    }

    /// A root, of which the part `in_front` counts as in front.
    pub fn add(&mut self, place: Complex<T>, in_front: T) {
        let (first, last) = self.free;
        let i = if in_front == T::ONE { first } else { last };
        self.free = if in_front == T::ONE { (first + 1, last) } else { (first, last - 1) };
        (self.at[i], self.values[i]) = (place, in_front);
    }

    /// When all have been added: their polynomial's product with normalised moments b₀ = 1, b₁ to b₄.
    pub fn in_front(&self, half: usize, moments: [Complex<T>; 5]) -> T {
        let mut differences = self.values.map(|value| Complex(value, T::ZERO));
        for level in 1..=half {
            for i in (level..=half).rev() {
                let rise = differences[i] - differences[i - 1];
                differences[i] = slope_between(rise, self.at[i] - self.at[i - level]);
            }
        }
        // Of the distribution times (x − x₀) … (x − x_k).
        let mut moments = moments;
        let mut sum = differences[0].0;
        for k in 0..half {
            for j in 0..half - k {
                moments[j] = moments[j + 1] - self.at[k] * moments[j];
            }
            sum = sum + (differences[k + 1] * moments[0]).0;
        }
        sum.clamped(T::ZERO, T::ONE)
    }
}

fn slope_between<T: Real>(rise: Complex<T>, run: Complex<T>) -> Complex<T> {
    if rise == Complex::ZERO {
        return rise;
    }
    (rise * run.conjugate()).scaled(T::ONE / T::from_f64(LEAST_RUN * LEAST_RUN).larger(run.square()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64) -> Complex<f64> {
        Complex(x, 0.0)
    }

    /// 0.3 of the whole at −0.5, the others at 0.75.
    fn moments() -> [Complex<f64>; 5] {
        std::array::from_fn(|k| at(0.3 * (-0.5_f64).powi(k as i32) + 0.7 * 0.75_f64.powi(k as i32)))
    }

    #[test]
    fn what_is_in_front_is_counted_whatever_the_order_of_roots() {
        for roots in [[(-0.5, 1.0), (0.75, 0.0)], [(0.75, 0.0), (-0.5, 1.0)]] {
            let mut nodes = Nodes::new(at(0.1), 0.25, 2);
            roots.into_iter().for_each(|(x, in_front)| nodes.add(at(x), in_front));
            assert!((nodes.in_front(2, moments()) - 0.3).abs() < 1e-15);
        }
        let mut own = Nodes::new(at(0.75), 0.25, 2);
        own.add(at(-0.5), 1.0);
        own.add(at(9.0), 0.0);
        assert!((own.in_front(2, moments()) - (0.3 + 0.25 * 0.7)).abs() < 1e-15);
    }

    #[test]
    fn a_pair_of_roots_that_is_off_by_a_thousandth_is_off_by_its_square() {
        for off in [0.0, 1e-3] {
            let mut nodes = Nodes::new(at(0.75), 0.0, 3);
            nodes.add(at(-0.5 - off), 1.0);
            nodes.add(at(2.0), 0.0);
            nodes.add(at(-0.5 + off), 1.0);
            assert!((nodes.in_front(3, moments()) - 0.3).abs() <= off * off + 1e-15, "{off}");
        }
    }

    #[test]
    fn a_root_at_the_depth_itself_leaves_a_number() {
        let mut nodes = Nodes::new(Complex(0.5_f32, 0.0), 0.25, 2);
        nodes.add(Complex(0.5, 0.0), 0.0);
        nodes.add(Complex(0.5, 0.0), 1.0);
        let in_front = nodes.in_front(
            2,
            [Complex(1.0, 0.0), Complex(0.5, 0.0), Complex(0.25, 0.0), Complex::ZERO, Complex::ZERO],
        );
        assert!((0.0..=1.0).contains(&in_front));
    }
}
