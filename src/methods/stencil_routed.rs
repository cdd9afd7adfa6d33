//! Stencil-routed A-buffer (Myers and Bavoil 2007): the first k fragments that are submitted, sorted and composited
//! exactly. Those that come later find no sample of the multisampled buffer free, and are dropped, however near they are.

use super::common::nearest::Nearest;
use super::{Described, Fragment, Parameters, Place, Streamed};
use crate::real::Real;

#[derive(Debug, Clone)]
pub struct StencilRouted {
    k: usize,
}

pub struct State<T: Real> {
    /// Sorted as they come, and never more than fit.
    first: Nearest<T>,
    count: usize,
}

impl StencilRouted {
    pub fn of(parameters: &Parameters) -> Self {
        Self { k: parameters.count("k") }
    }
}

impl Described for StencilRouted {
    fn constants(&self) -> Vec<(&'static str, String)> {
        vec![("K", format!("{}u", self.k))]
    }
    fn common(&self) -> &'static [&'static str] {
        &["methods/common/layer", "methods/common/slots", "methods/common/nearest"]
    }
    fn work(&self, _: u32) -> (u32, u32) {
        (1, self.k as u32)
    }
    fn drops(&self) -> bool {
        true
    }
}

impl<T: Real> Streamed<T> for StencilRouted {
    type State = State<T>;

    fn begin(&self, _: Place) -> State<T> {
        State { first: Nearest::none(), count: 0 }
    }

    fn turn(&self, _: &mut State<T>, pass: u32) -> bool {
        pass == 0
    }

    fn insert(&self, state: &mut State<T>, fragment: &Fragment<T>, _: u32) {
        if state.count < self.k {
            state.first.insert(*fragment, self.k);
        }
        state.count += 1;
    }

    fn end(&self, state: &State<T>, behind: [T; 4]) -> [T; 4] {
        state.first.layer().over(behind)
    }

    fn left_out(&self, _: &State<T>, n: u32) -> u32 {
        n.saturating_sub(self.k as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::tests::{fragment, run};

    #[test]
    fn the_first_are_sorted_and_a_nearer_one_that_comes_later_is_dropped() {
        let fragments = [
            fragment(3, [0.0, 0.0, 1.0, 0.5]),
            fragment(2, [0.0, 1.0, 0.0, 0.5]),
            fragment(1, [1.0, 0.0, 0.0, 1.0]),
        ];
        assert_eq!(run(&StencilRouted { k: 2 }, &fragments), ([0.0, 0.5, 0.25, 0.75], 1));
        assert_eq!(run(&StencilRouted { k: 3 }, &fragments), ([1.0, 0.0, 0.0, 1.0], 0));
    }
}
