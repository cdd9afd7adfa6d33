//! Depths brought into −1 … 1 over the depths of a scene: by their logarithms, as Münstermann, Krumpen, Klein and Peters
//! (2018) do, so that a scene and one twice its size are the same; linearly where the range reaches to the eye.

use crate::methods::DepthRange;
use crate::real::Real;

/// Depths beyond the range are at its ends; of a range of one depth, all are 0.
#[inline]
pub fn warped<T: Real>((nearest, farthest): DepthRange, depth: T) -> T {
    let (near, far) = (T::from_f64(nearest), T::from_f64(farthest));
    let z = depth.clamped(near, far);
    // Of quotients, not differences of logarithms: a power of two more or less then changes no bit.
    let (from, all) =
        if near > T::ZERO { ((z / near).ln(), (far / near).ln()) } else { (z - near, far - near) };
    if all > T::ZERO {
        let share = from / all;
        (share + share - T::ONE).clamped(-T::ONE, T::ONE)
    } else {
        T::ZERO
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depths_are_warped_by_their_logarithms_or_linearly_from_the_eye_on() {
        assert_eq!([1.0, 10.0, 100.0, 500.0].map(|z| warped((1.0, 100.0), z)), [-1.0, 0.0, 1.0, 1.0]);
        assert_eq!([-1.0, 0.0, 1.0, 2.0].map(|z| warped((-1.0, 3.0), z)), [-1.0, -0.5, 0.0, 0.5]);
        assert_eq!(warped((2.0, 2.0), 2.0), 0.0);
    }
}
