//! What several methods need, and the methods of users.

pub mod absorbance;
pub mod depth;
pub mod layer;
pub mod nearest;
pub mod own;
pub mod parameters;
pub mod shade;
pub mod window;
