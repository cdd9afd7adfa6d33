//! The pipelines `tiles`, `linked_list`, `prefix_sum` and `hardware` on Vulkan, Metal or DX12. Only this folder names wgpu.

mod background;
mod buffers;
mod compile;
pub mod device;
mod extent;
mod fill;
mod geometry;
mod hardware;
mod kept;
mod linked_list;
mod lists;
mod long;
mod modules;
mod passes;
mod pipelines;
mod plan;
mod pool;
mod readback;
mod rect;
mod resolve;
mod scan;
mod targets;
mod tiles;
mod timing;
mod uniforms;
mod unrolled;
mod upload;
mod variant;
mod view;

use crate::camera::Camera;
use crate::error::Result;
use crate::fragments::Background;
use crate::frame::{Output, Rasteriser, Request};
use crate::scene::Scene;

pub use kept::Kept;
pub use tiles::{Begun, Times, begin, measure};

/// Renders with the pipeline that is asked for. `kept` is of this scene. Methods other than exact leave no lists.
pub fn render(
    kept: &mut Kept,
    scene: &Scene,
    camera: &Camera,
    request: &Request,
    background: Background<f32>,
) -> Result<Output<f32>> {
    if !request.method.is_exact() {
        return match request.lists_on_gpu.rasteriser {
            Rasteriser::Tiles => tiles::stream(kept, scene, camera, request, &background),
            Rasteriser::Hardware => hardware::render(kept, scene, camera, request, &background),
        };
    }
    match tiles::render(kept, scene, camera, request, &background)? {
        Some(output) => Ok(output),
        None => linked_list::render(kept, scene, camera, request, background),
    }
}
