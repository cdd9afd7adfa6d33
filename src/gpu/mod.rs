//! The pipelines `linked_list` and `prefix_sum` on Vulkan, Metal or DX12. Only this folder names wgpu.

mod background;
mod buffers;
pub mod device;
mod extent;
mod fill;
mod geometry;
mod linked_list;
mod lists;
mod long;
mod passes;
mod pipelines;
mod plan;
mod pool;
mod resolve;
mod scan;
mod targets;
mod tiles;
mod timing;
mod uniforms;
mod unrolled;
mod upload;
mod variant;

pub use linked_list::render;
