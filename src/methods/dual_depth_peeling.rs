//! Dual depth peeling (Bavoil and Myers 2008): each pass peels the nearest and the farthest of the fragments that are
//! left. The nearest goes under those in front, the farthest over those behind; one that is both is counted once, in
//! front. ⌈n/2⌉ passes, and one that finds none.
//!
//! As with other peelings, orders are by depth and primitive here, so that coincident fragments all have their turn.

use super::{Described, Fragment, Parameters, Place, Streamed};
use crate::blend::Affine;
use crate::real::Real;

#[derive(Debug, Clone)]
pub struct DualDepthPeeling;

pub struct State<T: Real> {
    front: Affine<T>,
    back: Affine<T>,
    /// Orders of the last ones peeled on either side.
    last: Option<(T::Entry, T::Entry)>,
    /// The nearest and the farthest between those, so far.
    found: Option<(Fragment<T>, Fragment<T>)>,
}

impl DualDepthPeeling {
    pub fn of(_: &Parameters) -> Self {
        Self
    }
}

impl Described for DualDepthPeeling {
    fn common(&self) -> &'static [&'static str] {
        &["blend/compose"]
    }
    fn work(&self, n: u32) -> (u32, u32) {
        (n.div_ceil(2) + 1, 0)
    }
}

impl<T: Real> Streamed<T> for DualDepthPeeling {
    type State = State<T>;

    fn begin(&self, _: Place) -> State<T> {
        State { front: Affine::identity(), back: Affine::identity(), last: None, found: None }
    }

    fn turn(&self, state: &mut State<T>, pass: u32) -> bool {
        if pass == 0 {
            return true;
        }
        let Some((near, far)) = state.found.take() else { return false };
        state.front = state.front.onto(Affine::of(near.mode, near.color));
        if near.order != far.order {
            state.back = Affine::of(far.mode, far.color).onto(state.back);
        }
        state.last = Some((near.order, far.order));
        true
    }

    fn insert(&self, state: &mut State<T>, fragment: &Fragment<T>, _: u32) {
        let order = fragment.order;
        if !state.last.is_none_or(|(near, far)| near < order && order < far) {
            return;
        }
        let (near, far) = state.found.get_or_insert((*fragment, *fragment));
        if order < near.order {
            *near = *fragment;
        }
        if far.order < order {
            *far = *fragment;
        }
    }

    fn end(&self, state: &State<T>, behind: [T; 4]) -> [T; 4] {
        state.front.onto(state.back).over(behind)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::tests::{fragment, run};

    #[test]
    fn the_one_in_the_middle_counts_once() {
        let stack =
            [2, 1, 3].map(|depth| fragment(depth, [f64::from(depth % 2), f64::from(depth / 3), 1.0, 0.5]));
        assert_eq!(run(&DualDepthPeeling, &stack[..1]).0, [0.0, 0.0, 0.5, 0.5]);
        assert_eq!(run(&DualDepthPeeling, &stack[..2]).0, [0.5, 0.0, 0.75, 0.75]);
        assert_eq!(run(&DualDepthPeeling, &stack).0, [0.625, 0.125, 0.875, 0.875]);
        assert_eq!(run(&DualDepthPeeling, &[]).0, [0.0; 4]);
    }

    #[test]
    fn two_layers_go_with_each_pass_and_one_finds_none() {
        for n in 0..7 {
            let mut state = Streamed::<f64>::begin(&DualDepthPeeling, Place::default());
            let mut passes = 0;
            while DualDepthPeeling.turn(&mut state, passes) {
                for depth in 0..n {
                    let order = f64::entry(f64::from(depth).orderable(), 0);
                    let own = Fragment { order, ..fragment(depth, [0.5; 4]) };
                    DualDepthPeeling.insert(&mut state, &own, passes);
                }
                passes += 1;
            }
            assert_eq!((passes, 0), DualDepthPeeling.work(n), "{n}");
        }
    }
}
