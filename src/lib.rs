//! Exact order-independent transparency.
//!
//! The data goes one way: a [`scene::Scene`] and a [`camera::Camera`] enter a pipeline, the pipeline
//! turns triangles into fragments, a method resolves each pixel's fragments into a colour, and a
//! [`render::Output`] leaves. Modules only look downwards:
//! `python → render → {gpu, cpu} → methods → {fragments, scene, camera} → error`.

pub mod camera;
pub mod cpu;
pub mod error;
pub mod fragments;
pub mod gpu;
pub mod methods;
pub mod png;
pub mod real;
pub mod render;
pub mod scene;
pub mod shader;

#[cfg(feature = "python")]
mod python;
