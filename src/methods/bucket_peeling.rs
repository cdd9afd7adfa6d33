//! Bucket depth peeling (Liu, Huang, Liu and Wu 2009): the nearest fragment of each of so many equal parts of a pixel's
//! depth range, composited exactly.
//!
//! A first pass finds the range, a second puts a fragment of depth z in bucket ⌊K (z − z_min) / (z_max − z_min)⌋, at most
//! K − 1; bucket 0 if the range is empty. Of those that meet in one, all but the nearest are dropped. The ends of the
//! range are fragments themselves: of n that are uniform in between, 2 + (K − 2) (1 − (1 − 1/K)ⁿ⁻²) are kept on average.

use arrayvec::ArrayVec;

use super::common::layer::Layer;
use super::common::nearest::MOST;
use super::{Described, Fragment, Parameters, Place, Streamed};
use crate::real::Real;

#[derive(Debug, Clone)]
pub struct BucketPeeling {
    buckets: usize,
}

pub struct State<T: Real> {
    /// The least and the greatest depth.
    range: Option<(T, T)>,
    buckets: ArrayVec<Option<Fragment<T>>, MOST>,
    kept: u32,
}

impl BucketPeeling {
    pub fn of(parameters: &Parameters) -> Self {
        Self { buckets: parameters.count("buckets") }
    }

    fn bucket<T: Real>(&self, depth: T, (least, greatest): (T, T)) -> usize {
        let range = greatest - least;
        if range > T::ZERO {
            let place = (depth - least) / range * T::from_i32(self.buckets as i32);
            (place.floor_to_i32() as usize).min(self.buckets - 1)
        } else {
            0
        }
    }
}

impl Described for BucketPeeling {
    fn constants(&self) -> Vec<(&'static str, String)> {
        vec![("BUCKETS", format!("{}u", self.buckets))]
    }
    fn common(&self) -> &'static [&'static str] {
        &["methods/common/layer", "methods/common/slots"]
    }
    fn work(&self, _: u32) -> (u32, u32) {
        (2, 0)
    }
    fn drops(&self) -> bool {
        true
    }
}

impl<T: Real> Streamed<T> for BucketPeeling {
    type State = State<T>;

    fn begin(&self, _: Place) -> State<T> {
        State { range: None, buckets: (0..self.buckets).map(|_| None).collect(), kept: 0 }
    }

    fn turn(&self, state: &mut State<T>, pass: u32) -> bool {
        pass == 0 || (pass == 1 && state.range.is_some())
    }

    fn insert(&self, state: &mut State<T>, fragment: &Fragment<T>, pass: u32) {
        let depth = fragment.depth;
        let (least, greatest) = state.range.unwrap_or((depth, depth));
        if pass == 0 {
            state.range = Some((least.smaller(depth), greatest.larger(depth)));
            return;
        }
        let bucket = &mut state.buckets[self.bucket(depth, (least, greatest))];
        state.kept += u32::from(bucket.is_none());
        if bucket.is_none_or(|nearest| fragment.order < nearest.order) {
            *bucket = Some(*fragment);
        }
    }

    fn end(&self, state: &State<T>, behind: [T; 4]) -> [T; 4] {
        let kept = state.buckets.iter().flatten();
        kept.fold(Layer::clear(), |front, fragment| front.onto(Layer::of(fragment.color))).over(behind)
    }

    fn left_out(&self, state: &State<T>, n: u32) -> u32 {
        n - state.kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::tests::{fragment, run};

    const RED: [f64; 4] = [1.0, 0.0, 0.0, 0.5];
    const GREEN: [f64; 4] = [0.0, 1.0, 0.0, 0.5];
    const BLUE: [f64; 4] = [0.0, 0.0, 1.0, 0.5];

    #[test]
    fn the_nearest_of_a_bucket_is_kept_and_the_others_are_counted() {
        let fragments = [fragment(10, BLUE), fragment(4, GREEN), fragment(0, RED)];
        // Depth 4 is in the first of two buckets from 0 to 10, and in the second of three.
        assert_eq!(run(&BucketPeeling { buckets: 2 }, &fragments), ([0.5, 0.0, 0.25, 0.75], 1));
        assert_eq!(run(&BucketPeeling { buckets: 3 }, &fragments), ([0.5, 0.25, 0.125, 0.875], 0));
    }

    #[test]
    fn at_one_depth_the_later_is_kept() {
        let fragments = [fragment(3, RED), fragment(3, GREEN)];
        assert_eq!(run(&BucketPeeling { buckets: 8 }, &fragments), ([0.0, 0.5, 0.0, 0.5], 1));
        assert_eq!(run(&BucketPeeling { buckets: 8 }, &[]), ([0.0; 4], 0));
    }
}
