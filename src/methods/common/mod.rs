//! What several methods need, and the methods of users.

pub mod absorbance;
pub mod complex;
pub mod depth;
pub mod interpolation;
pub mod layer;
pub mod nearest;
pub mod own;
pub mod parameters;
pub mod power_moments;
pub mod roots;
pub mod shade;
pub mod trigonometric_moments;
pub mod window;
