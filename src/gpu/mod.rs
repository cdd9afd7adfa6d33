//! The `linked_list` pipeline on Vulkan, Metal or DX12. Only this folder names wgpu.

mod buffers;
pub mod device;
mod geometry;
mod linked_list;
mod lists;
mod long;
mod passes;
mod pipelines;
mod pool;
mod targets;
mod timing;
mod uniforms;

pub use linked_list::render;
