//! Depth peeling (Everitt 2001): each pass finds the fragment right behind the last one, and composites it under those
//! in front. A last pass finds none.
//!
//! The paper compares depths alone, and loses all but one of coincident fragments. Here they are peeled by depth and
//! primitive, so that every one has its turn. With `layers` = P, what is behind the P nearest is dropped:
//! |ΔC| ≤ T_{P+1} R for colours in a range R.

use super::{Described, Fragment, Parameters, Place, Streamed};
use crate::blend::Affine;
use crate::real::Real;

#[derive(Debug, Clone)]
pub struct DepthPeeling {
    /// At most so many; 0: all.
    layers: u32,
}

pub struct State<T: Real> {
    /// Those that were peeled.
    front: Affine<T>,
    peeled: u32,
    /// The order of the last one peeled.
    last: Option<T::Entry>,
    /// The nearest one behind that, so far.
    found: Option<Fragment<T>>,
}

impl DepthPeeling {
    pub fn of(parameters: &Parameters) -> Self {
        Self { layers: parameters.count("layers") as u32 }
    }

    /// Of a list of `n` fragments.
    pub fn peeled(&self, n: u32) -> u32 {
        if self.layers == 0 { n } else { n.min(self.layers) }
    }
}

impl Described for DepthPeeling {
    fn constants(&self) -> Vec<(&'static str, String)> {
        vec![("LAYERS", format!("{}u", self.layers))]
    }
    fn common(&self) -> &'static [&'static str] {
        &["blend/compose"]
    }
    fn work(&self, n: u32) -> (u32, u32) {
        let all = n.saturating_add(1);
        (if self.layers == 0 { all } else { all.min(self.layers) }, 0)
    }
    fn drops(&self) -> bool {
        true
    }
}

impl<T: Real> Streamed<T> for DepthPeeling {
    type State = State<T>;

    fn begin(&self, _: Place) -> State<T> {
        State { front: Affine::identity(), peeled: 0, last: None, found: None }
    }

    fn turn(&self, state: &mut State<T>, pass: u32) -> bool {
        if pass == 0 {
            return true;
        }
        let Some(found) = state.found.take() else { return false };
        state.front = state.front.onto(Affine::of(found.mode, found.color));
        state.last = Some(found.order);
        state.peeled += 1;
        self.layers == 0 || state.peeled < self.layers
    }

    fn insert(&self, state: &mut State<T>, fragment: &Fragment<T>, _: u32) {
        let is_behind = state.last.is_none_or(|last| last < fragment.order);
        if is_behind && state.found.is_none_or(|found| fragment.order < found.order) {
            state.found = Some(*fragment);
        }
    }

    fn end(&self, state: &State<T>, behind: [T; 4]) -> [T; 4] {
        state.front.over(behind)
    }

    fn left_out(&self, state: &State<T>, n: u32) -> u32 {
        n - state.peeled
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::tests::{fragment, run};

    /// Two coincident ones behind a third: the later is in front.
    fn three() -> [Fragment<f64>; 3] {
        [
            fragment(2, [1.0, 0.0, 0.0, 0.5]),
            fragment(2, [0.0, 1.0, 0.0, 0.5]),
            fragment(1, [0.0, 0.0, 1.0, 0.5]),
        ]
    }

    #[test]
    fn coincident_fragments_are_all_peeled() {
        assert_eq!(run(&DepthPeeling { layers: 0 }, &three()), ([0.125, 0.25, 0.5, 0.875], 0));
        assert_eq!(run(&DepthPeeling { layers: 0 }, &[]), ([0.0; 4], 0));
    }

    #[test]
    fn layers_beyond_a_limit_are_dropped() {
        assert_eq!(run(&DepthPeeling { layers: 1 }, &three()), ([0.0, 0.0, 0.5, 0.5], 2));
        assert_eq!(run(&DepthPeeling { layers: 2 }, &three()), ([0.0, 0.25, 0.5, 0.75], 1));
        assert_eq!(run(&DepthPeeling { layers: 9 }, &three()), ([0.125, 0.25, 0.5, 0.875], 0));
    }

    #[test]
    fn there_is_a_pass_for_each_layer_and_one_that_finds_none() {
        let method = DepthPeeling { layers: 0 };
        let mut state = Streamed::<f64>::begin(&method, Place::default());
        let mut passes = 0;
        while method.turn(&mut state, passes) {
            let submitted = three().into_iter().zip(0..);
            submitted.for_each(|(f, i)| {
                let order = f64::entry(f.depth.orderable(), !i);
                method.insert(&mut state, &Fragment { order, ..f }, passes);
            });
            passes += 1;
        }
        assert_eq!((passes, 0), method.work(3));
        // Where others of a tile still peel, it is asked again.
        assert!(!method.turn(&mut state, passes + 1));
        assert_eq!(DepthPeeling { layers: 2 }.work(3), (2, 0));
    }
}
