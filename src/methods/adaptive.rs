//! Adaptive transparency (Salvi, Montgomery and Lefohn 2011): the transmittance along the view ray as a step function of
//! k nodes, which a second pass over the fragments weighs them by.
//!
//! C = Σ V(zᵢ) αᵢ cᵢ + T B, with V what the fragments in front let through as far as nodes tell, and the exact T. A node
//! is a depth d and what is let through behind it, t. A fragment becomes a node, t = (1 − α) times that of the node in
//! front, and multiplies the t of those behind. Where that makes one too many, the one goes whose removal changes the
//! area under V least, (d_j − d_{j−1}) (t_{j−1} − t_j), and t_{j−1} ← t_j: never the first, and the last t stays. (The
//! criterion is as recalled from the paper and from slides on adaptive volumetric shadow maps, its predecessor, not
//! verified in its text.) What is occluded too early makes V too small, and the image too dark; `renormalise` takes
//! (Σ V α c / Σ V α) (1 − T) for the sum.

use arrayvec::ArrayVec;

use super::common::layer::{Coverage, Layer, add_weighted};
use super::common::nearest::MOST;
use super::{Described, Fragment, Parameters, Place, Streamed};
use crate::real::Real;

#[derive(Debug, Clone)]
pub struct Adaptive {
    k: usize,
    renormalise: bool,
}

#[derive(Clone, Copy)]
struct Node<T: Real> {
    order: T::Entry,
    depth: T,
    /// Of it and all in front of it.
    transmittance: T,
}

pub struct State<T: Real> {
    /// One more than k, while one is removed.
    nodes: ArrayVec<Node<T>, { MOST + 1 }>,
    removed: u32,
    coverage: Coverage<T>,
    /// Σ V α c, and last Σ V α.
    sum: [T; 4],
}

impl Adaptive {
    pub fn of(parameters: &Parameters) -> Self {
        Self { k: parameters.count("k"), renormalise: parameters.flag("renormalise") }
    }
}

impl<T: Real> State<T> {
    /// Nodes in front of a fragment.
    fn place(&self, fragment: &Fragment<T>) -> usize {
        self.nodes.iter().rposition(|node| node.order < fragment.order).map_or(0, |i| i + 1)
    }

    /// What the first `place` nodes let through.
    fn visibility(&self, place: usize) -> T {
        if place == 0 { T::ONE } else { self.nodes[place - 1].transmittance }
    }

    fn remove_least(&mut self) {
        let cost = |pair: &[Node<T>]| {
            (pair[1].depth - pair[0].depth) * (pair[0].transmittance - pair[1].transmittance)
        };
        let mut least = (1, cost(&self.nodes[..2]));
        for (j, pair) in self.nodes.windows(2).enumerate().skip(1) {
            let own = cost(pair);
            // The farthest of equals: behind alpha 1 there are many of area 0, and no one sees them.
            if own <= least.1 {
                least = (j + 1, own);
            }
        }
        let removed = self.nodes.remove(least.0);
        self.nodes[least.0 - 1].transmittance = removed.transmittance;
        self.removed += 1;
    }
}

impl Described for Adaptive {
    fn constants(&self) -> Vec<(&'static str, String)> {
        vec![("K", format!("{}u", self.k)), ("RENORMALISES", self.renormalise.to_string())]
    }
    fn work(&self, _: u32) -> (u32, u32) {
        // Nodes move back, areas are compared, nodes move forward.
        (2, 3 * self.k as u32)
    }
}

impl<T: Real> Streamed<T> for Adaptive {
    type State = State<T>;

    fn begin(&self, _: Place) -> State<T> {
        State { nodes: ArrayVec::new(), removed: 0, coverage: Coverage::none(), sum: [T::ZERO; 4] }
    }

    fn turn(&self, state: &mut State<T>, pass: u32) -> bool {
        pass == 0 || (pass == 1 && !state.nodes.is_empty())
    }

    fn insert(&self, state: &mut State<T>, fragment: &Fragment<T>, pass: u32) {
        let [r, g, b, a] = fragment.color;
        // No step, and were it the first node Σ V α might come to nothing.
        if a == T::ZERO {
            return;
        }
        let place = state.place(fragment);
        let visibility = state.visibility(place);
        if pass == 1 {
            let weight = visibility * a;
            state.sum = add_weighted(state.sum, weight, [r, g, b]);
            return;
        }
        state.coverage.add(a);
        let Fragment { order, depth, .. } = *fragment;
        state.nodes.insert(place, Node { order, depth, transmittance: visibility });
        for node in &mut state.nodes[place..] {
            node.transmittance = node.transmittance * (T::ONE - a);
        }
        if state.nodes.len() > self.k {
            state.remove_least();
        }
    }

    fn end(&self, state: &State<T>, behind: [T; 4]) -> [T; 4] {
        let Coverage { alpha, transmittance } = state.coverage;
        let [r, g, b, _] = state.sum;
        let layer = match self.renormalise {
            true => state.coverage.of_mean(state.sum),
            false => Layer { rgba: [r, g, b, alpha], transmittance },
        };
        layer.over(behind)
    }

    fn left_out(&self, state: &State<T>, _: u32) -> u32 {
        state.removed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::tests::{fragment, run};

    fn of(k: usize, renormalise: bool) -> Adaptive {
        Adaptive { k, renormalise }
    }

    /// White halves at depths 1, 2 and 9: with two nodes that of depth 2 goes, of area (2 − 1)(½ − ¼) and not
    /// (9 − 2)(¼ − ⅛), and the first lets ¼ through. V is 1, ¼, ¼.
    #[test]
    fn the_node_goes_that_changes_the_area_least() {
        let halves = [9, 1, 2].map(|depth| fragment(depth, [1.0, 1.0, 1.0, 0.5]));
        assert_eq!(run(&of(3, false), &halves), ([0.875; 4], 0));
        assert_eq!(run(&of(2, false), &halves), ([0.75, 0.75, 0.75, 0.875], 1));
        assert_eq!(run(&of(2, true), &halves), ([0.875; 4], 1));
    }

    #[test]
    fn nothing_shows_from_behind_alpha_1_and_nothing_is_divided_by_0() {
        let red = fragment(1, [1.0, 0.0, 0.0, 1.0]);
        let behind = [2, 3, 4].map(|depth| fragment(depth, [0.0, 1.0, 0.0, 1.0]));
        for k in 1..4 {
            for renormalise in [false, true] {
                let image = run(&of(k, renormalise), &[behind[1], red, behind[0], behind[2]]).0;
                assert_eq!(image, [1.0, 0.0, 0.0, 1.0]);
            }
        }
        // Were the invisible first a node, with k = 1 the second would have V = 0.
        let image = run(&of(1, true), &[fragment(0, [1.0, 1.0, 1.0, 0.0]), red]).0;
        assert_eq!(image, [1.0, 0.0, 0.0, 1.0]);
        assert_eq!(run(&of(1, true), &[fragment(0, [1.0, 1.0, 1.0, 0.0])]).0, [0.0; 4]);
    }
}
