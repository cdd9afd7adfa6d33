//! Methods: rules that turn the fragments of one pixel into a colour.
//!
//! A method is a state and three functions, `begin`, `insert` and `end`, and one row in [`METHODS`].
//! It sees fragments one at a time, in the order that its row asks for, and knows nothing of pipelines.

pub mod exact;

/// What a method is, for argument checks, tables and docs.
#[derive(Debug)]
pub struct Method {
    pub id: &'static str,
    pub title: &'static str,
    /// The order in which `insert` sees the fragments of a pixel.
    pub order: &'static str,
    pub source: &'static str,
}

pub static METHODS: &[Method] = &[Method {
    id: "exact",
    title: "every fragment, sorted and composited",
    order: "front_to_back",
    source: "Porter and Duff 1984; Carpenter 1984; Yang et al. 2010",
}];
