//! Depths brought to 0 at the nearest of a scene's, 1 at the farthest.

use crate::methods::DepthRange;
use crate::real::Real;

/// By its logarithm where all are in front of the eye, as perspective spreads them; else linear. ½ where there is no
/// range.
pub fn depth_in_range<T: Real>(depth: T, (nearest, farthest): DepthRange) -> T {
    let (near, far) = (T::from_f64(nearest), T::from_f64(farthest));
    if near >= far {
        return T::from_f64(0.5);
    }
    let z = depth.clamped(near, far);
    let x =
        if near > T::ZERO { log_ratio(z, near) / log_ratio(far, near) } else { (z - near) / (far - near) };
    x.clamped(T::ZERO, T::ONE)
}

/// ln (a / b) of a ≥ b > 0: it keeps its digits where they are close, and does not overflow where they are not.
fn log_ratio<T: Real>(a: T, b: T) -> T {
    if a < b + b { ((a - b) / b).ln_1p() } else { a.ln() - b.ln() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_runs_from_0_to_1_by_logarithm_or_linearly_or_is_a_half() {
        let of = |depth| depth_in_range::<f64>(depth, (1.0, 100.0));
        assert_eq!([0.5, 1.0, 100.0, 1e9].map(of), [0.0, 0.0, 1.0, 1.0]);
        assert!((of(10.0) - 0.5).abs() < 1e-15);
        assert_eq!(depth_in_range(1.0_f64, (-1.0, 7.0)), 0.25);
        assert_eq!(depth_in_range(3.0_f32, (3.0, 3.0)), 0.5);
        assert!((depth_in_range(1.0_f32, (1e-38, 1e38)) - 0.5).abs() < 1e-6);
        // A middle that float32 still tells from the ends.
        let middle = depth_in_range(1.0 + 2.0_f32.powi(-22), (1.0, 1.0 + 2.0_f64.powi(-21)));
        assert!((middle - 0.5).abs() < 1e-6);
    }
}
