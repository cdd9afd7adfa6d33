//! One render: a checked request goes to a pipeline.

use crate::camera::Camera;
use crate::cpu;
use crate::error::Result;
use crate::fragments::Background;
use crate::frame::{Output, Request};
use crate::gpu;
use crate::scene::Scene;
use crate::threads::threads;

/// Renders on the CPU.
pub fn on_cpu<T: cpu::Precision>(
    scene: &Scene,
    camera: &Camera,
    request: &Request,
    background: Background<T>,
) -> Result<Output<T>> {
    request.check(&background)?;
    threads()?.install(|| cpu::render(scene, camera, request, background))
}

/// Measures frames of tiles and of plain blending in turns (see [`gpu::measure`]).
pub fn measure(
    adapter: usize,
    scene: &Scene,
    camera: &Camera,
    request: &Request,
    background: Background<f32>,
    frames: usize,
) -> Result<[gpu::Times; 2]> {
    request.check(&background)?;
    let gpu = gpu::device::open(adapter)?;
    gpu.exclusively(|| {
        gpu.checked("measuring", || gpu::measure(&gpu, scene, camera, request, &background, frames))
    })
}

/// Renders on the adapter at this place of [`gpu::device::adapters`].
pub fn on_gpu(
    adapter: usize,
    scene: &Scene,
    camera: &Camera,
    request: &Request,
    background: Background<f32>,
) -> Result<Output<f32>> {
    request.check(&background)?;
    let gpu = gpu::device::open(adapter)?;
    gpu.exclusively(|| gpu.checked("a render", || gpu::render(&gpu, scene, camera, request, background)))
}
