//! Exact order-independent transparency.
//!
//! The data goes one way: a [`scene::Scene`] and a [`camera::Camera`] enter a pipeline, the pipeline
//! turns triangles into fragments, a method resolves each pixel's fragments into a colour, and a
//! [`frame::Output`] leaves. Modules only look downwards:
//! `python → render → {gpu, cpu, composite} → resolve → {frame, methods} → {fragments, scene, camera} → error`.

pub mod blend;
pub mod camera;
pub mod clip;
pub mod composite;
pub mod cpu;
pub mod error;
pub mod fragments;
pub mod frame;
pub mod gpu;
pub mod memory;
pub mod methods;
pub mod node_format;
pub mod png;
pub mod real;
pub mod render;
pub mod resolve;
pub mod samples;
pub mod scene;
pub mod shader;
pub mod threads;

#[cfg(feature = "python")]
mod python;
