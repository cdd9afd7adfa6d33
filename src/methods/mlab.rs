//! Multi-layer alpha blending (Salvi and Vaidyanathan 2014): k nodes, front to back, each a layer of fragments that were
//! merged and the depth of the nearest of them.
//!
//! A fragment becomes a node, in front of those of its own depth. Where that makes one too many, the last two are merged:
//! P ← P + t P', t ← t t', which is exact for true neighbours. So the image is exact for k + 1 fragments at most, and for
//! any number that arrive front to back or back to front. Alpha always is, since products commute. Otherwise a fragment
//! that belongs between two merged ones comes out behind both: k = 2 and depths arriving as 1, 2, 4, 3 are off by
//! T₃ α₃ α₄ (c₄ − c₃).

use arrayvec::ArrayVec;

use super::common::layer::Layer;
use super::common::nearest::MOST;
use super::{Described, Fragment, Parameters, Place, Streamed};
use crate::real::Real;

#[derive(Debug, Clone)]
pub struct Mlab {
    k: usize,
}

struct Node<T: Real> {
    /// Of the nearest fragment in it.
    order: T::Entry,
    layer: Layer<T>,
}

pub struct State<T: Real> {
    nodes: ArrayVec<Node<T>, MOST>,
    merged: u32,
}

impl Mlab {
    pub fn of(parameters: &Parameters) -> Self {
        Self { k: parameters.count("k") }
    }
}

impl Described for Mlab {
    fn constants(&self) -> Vec<(&'static str, String)> {
        vec![("K", format!("{}u", self.k))]
    }
    fn common(&self) -> &'static [&'static str] {
        &["methods/common/layer", "methods/common/slots"]
    }
    fn work(&self, _: u32) -> (u32, u32) {
        (1, self.k as u32)
    }
}

impl<T: Real> Streamed<T> for Mlab {
    type State = State<T>;

    fn begin(&self, _: Place) -> State<T> {
        State { nodes: ArrayVec::new(), merged: 0 }
    }

    fn turn(&self, _: &mut State<T>, pass: u32) -> bool {
        pass == 0
    }

    fn insert(&self, state: &mut State<T>, fragment: &Fragment<T>, _: u32) {
        // What is invisible would take a node from what is not.
        if fragment.color[3] == T::ZERO {
            return;
        }
        let State { nodes, merged } = state;
        let place = nodes.iter().rposition(|node| node.order < fragment.order).map_or(0, |i| i + 1);
        let new = Node { order: fragment.order, layer: Layer::of(fragment.color) };
        if nodes.len() < self.k {
            nodes.insert(place, new);
            return;
        }
        *merged += 1;
        let behind = if place == self.k {
            new.layer
        } else {
            let last = nodes.remove(self.k - 1);
            nodes.insert(place, new);
            last.layer
        };
        let last = &mut nodes[self.k - 1];
        last.layer = last.layer.onto(behind);
    }

    fn end(&self, state: &State<T>, behind: [T; 4]) -> [T; 4] {
        state.nodes.iter().fold(Layer::clear(), |front, node| front.onto(node.layer)).over(behind)
    }

    fn left_out(&self, state: &State<T>, _: u32) -> u32 {
        state.merged
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::tests::{fragment, run};

    /// Of depths 1 to 4.
    const COLORS: [[f64; 4]; 4] =
        [[1.0, 0.0, 0.0, 0.5], [0.0, 1.0, 0.0, 0.5], [0.0, 0.0, 1.0, 0.5], [1.0, 1.0, 1.0, 0.5]];

    fn arriving(depths: [u32; 4], k: usize) -> ([f64; 4], u32) {
        run(&Mlab { k }, &depths.map(|depth| fragment(depth, COLORS[depth as usize - 1])))
    }

    #[test]
    fn nodes_merge_neighbours_exactly_where_fragments_arrive_in_order() {
        // Σ Tᵢ αᵢ cᵢ with Tᵢ = 2^(1−i).
        let exact = [0.5 + 0.0625, 0.25 + 0.0625, 0.125 + 0.0625, 0.9375];
        for k in 1..=4 {
            let merged = 4 - k as u32;
            assert_eq!(arriving([1, 2, 3, 4], k), (exact, merged));
            assert_eq!(arriving([4, 3, 2, 1], k), (exact, merged));
        }
    }

    #[test]
    fn what_belongs_between_merged_fragments_comes_out_behind_both() {
        // T₃ α₃ α₄ (c₄ − c₃) = 1/16 (1, 1, 0).
        let exact = [0.5625, 0.3125, 0.1875, 0.9375];
        let off = [0.0625, 0.0625, 0.0, 0.0];
        let (image, _) = arriving([1, 2, 4, 3], 2);
        assert_eq!(image, std::array::from_fn(|i| exact[i] + off[i]));
    }
}
