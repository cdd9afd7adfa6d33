//! Unsorted blending: fragments are composited in the order of submission, as if painted. A baseline.
//!
//! Exact where they come back to front. Two that are next to each other in depth and come the other way are off by
//! ΔC = T_a α_a α_b (c_a − c_b), a being the one in front.

use super::{Described, Fragment, Parameters, Place, Streamed};
use crate::blend::Affine;
use crate::real::Real;

#[derive(Debug, Clone)]
pub struct Unsorted;

impl Unsorted {
    pub fn of(_: &Parameters) -> Self {
        Self
    }
}

impl Described for Unsorted {
    fn common(&self) -> &'static [&'static str] {
        &["blend/compose"]
    }
}

impl<T: Real> Streamed<T> for Unsorted {
    type State = Affine<T>;

    fn begin(&self, _: Place) -> Affine<T> {
        Affine::identity()
    }

    fn turn(&self, _: &mut Affine<T>, pass: u32) -> bool {
        pass == 0
    }

    fn insert(&self, painted: &mut Affine<T>, fragment: &Fragment<T>, _: u32) {
        *painted = Affine::of(fragment.mode, fragment.color).onto(*painted);
    }

    fn end(&self, painted: &Affine<T>, behind: [T; 4]) -> [T; 4] {
        painted.over(behind)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::tests::{fragment, run};

    #[test]
    fn the_last_is_in_front_whatever_its_depth() {
        let (red, blue) = ([1.0, 0.0, 0.0, 0.5], [0.0, 0.0, 1.0, 0.5]);
        for depths in [[1, 2], [2, 1]] {
            let painted = [fragment(depths[0], red), fragment(depths[1], blue)];
            assert_eq!(run(&Unsorted, &painted).0, [0.25, 0.0, 0.5, 0.75]);
        }
    }
}
