//! What several methods need.

pub mod absorbance;
pub mod layer;
pub mod nearest;
pub mod parameters;
