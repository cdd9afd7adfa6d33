//! The depth that a window of a perspective has, from the nearest to the farthest.

use crate::methods::DepthRange;
use crate::real::Real;

/// 0 at the nearest and 1 at the farthest, as 1/z goes; 0 where the range is empty.
#[inline]
pub fn window_depth<T: Real>(z: T, (nearest, farthest): DepthRange) -> T {
    let (near, far) = (T::from_f64(nearest), T::from_f64(farthest));
    if !(far > near && z > near.larger(T::ZERO)) {
        return T::ZERO;
    }
    ((z - near) / z * (far / (far - near))).clamped(T::ZERO, T::ONE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_linear_in_the_inverse_of_depth_and_finite_everywhere() {
        let d = |z: f64| window_depth(z, (1.0, 4.0));
        assert_eq!([d(1.0), d(1.6), d(4.0)], [0.0, 0.5, 1.0]);
        assert_eq!([d(0.0), d(0.5), d(9.0)], [0.0, 0.0, 1.0]);
        assert_eq!(window_depth(0.0, (-1.0, 1.0)), 0.0);
        assert_eq!(window_depth(2.0_f64, (1.0, 1.0)), 0.0);
        assert_eq!(window_depth(2.0_f32, (1.0, 3e38)), 0.5);
    }
}
