//! A scene and a camera on the device, ready for the stages of tiles.

use std::sync::Arc;

use wgpu::BufferUsages;

use super::Context;
use crate::camera::Camera;
use crate::error::Result;
use crate::fragments::Background;
use crate::frame::Request;
use crate::gpu::buffers::with_contents;
use crate::gpu::device::Gpu;
use crate::gpu::kept::Kept;
use crate::gpu::pipelines::Pipelines;
use crate::gpu::targets::Targets;
use crate::gpu::uniforms::Eye;
use crate::gpu::upload::Uploaded;
use crate::gpu::variant::Variant;
use crate::gpu::view::{eye_uniform, view_uniform};
use crate::scene::Scene;
use crate::threads::threads;

pub struct Ready {
    pub gpu: Arc<Gpu>,
    pipelines: Arc<Pipelines>,
    pub scene: Arc<Uploaded>,
    pub view: wgpu::Buffer,
    pub eye: Eye,
    /// The user's background, where that is an image.
    pub background: wgpu::TextureView,
    pub size: (u32, u32),
}

impl Ready {
    pub fn new(
        kept: &mut Kept,
        variant: &Variant,
        (scene, camera): (&Scene, &Camera),
        request: &Request,
        background: &Background<f32>,
    ) -> Result<Self> {
        let size = (request.width, request.height);
        let depths = threads()?.install(|| camera.depth_extent(scene));
        let center = camera.center(depths);
        let rows = camera.clip_rows(center);
        let scene = kept.scene(scene)?;
        let gpu = &kept.gpu;
        gpu.checked("the view", || {
            let uniform = view_uniform(camera, &rows, depths, request, background);
            Ok(Self {
                gpu: gpu.clone(),
                pipelines: gpu.pipelines(variant),
                scene,
                view: with_contents(gpu, "view", BufferUsages::UNIFORM, &[uniform]),
                eye: eye_uniform(camera, &rows, center, size),
                background: Targets::new(gpu, variant, size, background)?.background,
                size,
            })
        })
    }

    pub fn variant(&self) -> &Variant {
        &self.pipelines.variant
    }

    pub fn context(&self) -> Context<'_> {
        Context { gpu: &self.gpu, pipelines: &self.pipelines, view: &self.view }
    }
}
