//! The roots of polynomials that have real roots alone, of degree 2 to 4.
//!
//! Closed forms lose digits where roots lie close together, or where the leading coefficient is next to nothing and one
//! root is far away: the resolvent of a quartic (Neumark 1965) then has a double root. Laguerre's method converges to the
//! first root on its way whatever the roots are, as long as they are real (Householder 1970). It starts at infinity, in
//! 1/x, so that the root it finds is an outermost one, and dividing that out keeps the digits of the others (Peters and
//! Wilkinson 1971); the last two are a quadratic's.

use crate::real::Real;

/// Roots are brought into −FAR … FAR. One of a leading coefficient 0 is there.
pub const FAR: f64 = 1e6;
/// The steps triple the number of right digits, from one or none to 52.
pub const STEPS: u32 = 8;

/// Coefficients of a polynomial, the leading one first; behind the last of its degree, 0.
pub type Polynomial<T> = [T; 5];

/// The `degree` roots, in no order.
pub fn real_roots<T: Real>(coefficients: Polynomial<T>, degree: usize) -> ([T; 4], usize) {
    let n = T::from_f64;
    let greatest = coefficients.iter().fold(n(1e-30), |most, c| most.larger(c.abs()));
    let mut c = coefficients.map(|c| c / greatest);
    let mut roots = [T::ZERO; 4];
    for left in (3..=degree).rev() {
        let y = outermost(&c, left);
        roots[left - 1] = inverse(y);
        c = without(&c, y);
    }
    let [x0, x1] = quadratic(c[0], c[1], c[2]);
    (roots[0], roots[1]) = (x0, x1);
    (roots, degree)
}

/// 1/x of an outermost root x, by Laguerre's method from 0.
fn outermost<T: Real>(&[c0, c1, c2, c3, c4]: &Polynomial<T>, degree: usize) -> T {
    let n = T::from_f64;
    let degree = T::from_i32(degree as i32);
    let less = degree - T::ONE;
    let mut y = T::ZERO;
    for _ in 0..STEPS {
        let p = (((c4 * y + c3) * y + c2) * y + c1) * y + c0;
        let slope = ((n(4.0) * c4 * y + n(3.0) * c3) * y + n(2.0) * c2) * y + c1;
        let half_bend = (n(6.0) * c4 * y + n(3.0) * c3) * y + c2;
        let square = less * (less * slope * slope - n(2.0) * degree * p * half_bend);
        let root = T::ZERO.larger(square).sqrt();
        let below = if slope < T::ZERO { slope - root } else { slope + root };
        if below != T::ZERO {
            // Bounded, so that fourth powers are.
            y = (y - degree * p / below).clamped(n(-1e5), n(1e5));
        }
    }
    y
}

/// Divided by 1 − y x, from the constant term on: stable where 1/y is the root of greatest magnitude.
fn without<T: Real>(&[_, c1, c2, c3, c4]: &Polynomial<T>, y: T) -> Polynomial<T> {
    let d3 = c4;
    let d2 = c3 + y * d3;
    let d1 = c2 + y * d2;
    [c1 + y * d1, d1, d2, d3, T::ZERO]
}

/// Of a x² + b x + c, without the difference of b and the discriminant's root.
fn quadratic<T: Real>(a: T, b: T, c: T) -> [T; 2] {
    let n = T::from_f64;
    let root = T::ZERO.larger(b * b - n(4.0) * a * c).sqrt();
    let t = n(-0.5) * if b < T::ZERO { b - root } else { b + root };
    if t.abs() < n(1e-20) {
        return [T::ZERO; 2];
    }
    [inverse(a / t), (c / t).clamped(n(-FAR), n(FAR))]
}

fn inverse<T: Real>(y: T) -> T {
    let far = T::from_f64(FAR);
    if y.abs() * far > T::ONE {
        T::ONE / y
    } else if y < T::ZERO {
        -far
    } else {
        far
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The leading coefficient first, of a polynomial of some roots.
    fn of_roots(roots: &[f64]) -> Polynomial<f64> {
        let mut c = [1.0, 0.0, 0.0, 0.0, 0.0];
        for root in roots {
            for i in (1..5).rev() {
                c[i] -= root * c[i - 1];
            }
        }
        c
    }

    fn sorted(c: Polynomial<f64>, degree: usize) -> Vec<f64> {
        let (roots, count) = real_roots(c, degree);
        let mut roots = roots[..count].to_vec();
        roots.sort_by(f64::total_cmp);
        roots
    }

    #[test]
    fn roots_are_found_where_they_are() {
        for (roots, tolerance) in [
            (&[-0.5, 0.25][..], 1e-14),
            (&[-0.7, 0.0, 0.9], 1e-14),
            (&[-0.9, -0.2, 0.3, 0.8], 1e-14),
            (&[-300.0, -0.2, 0.3, 0.8], 1e-13),
            // Ill-conditioned: moved by what coefficients round, 2⁻⁵³, over the distance.
            (&[-0.2, -0.199, 0.3, 0.301], 1e-11),
        ] {
            for (found, wanted) in sorted(of_roots(roots), roots.len()).iter().zip(roots) {
                assert!((found - wanted).abs() <= tolerance * wanted.abs().max(1.0), "{roots:?} {found}");
            }
        }
    }

    #[test]
    fn a_leading_coefficient_of_nothing_puts_one_root_far_away() {
        let [c0, c1, c2, c3, _] = of_roots(&[-0.5, 0.1, 0.7]);
        let roots = sorted([0.0, c0, c1, c2, c3], 4);
        assert_eq!(roots[3], FAR);
        for (found, wanted) in roots.iter().zip([-0.5, 0.1, 0.7]) {
            assert!((found - wanted).abs() < 1e-14, "{roots:?}");
        }
        assert!(sorted([0.0; 5], 4).iter().all(|x| x.is_finite()));
    }
}
