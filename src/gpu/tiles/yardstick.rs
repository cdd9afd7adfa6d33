//! How long a frame's GPU stages take, back to back, beside the hardware's plain blending of the same draw, which sorts
//! nothing: for the benchmarks.

use std::time::{Duration, Instant};

use wgpu::{BufferUsages, ShaderStages};

use super::canvas::Canvas;
use super::is_enough;
use super::ready::Ready;
use super::stages::Leaves;
use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::fragments::Background;
use crate::frame::Request;
use crate::gpu::buffers::{Slot, bind, layout, with_contents};
use crate::gpu::compile::{compile, pipeline_layout};
use crate::gpu::device::Gpu;
use crate::gpu::kept::Kept;
use crate::gpu::plan;
use crate::gpu::pool::DEFAULT_MEMORY;
use crate::gpu::timing::Timing;
use crate::scene::Scene;
use crate::shader::Composed;

/// Milliseconds of each frame's stages, and of all of it from the first begin to the last end ("gpu"); of tiles, then of
/// plain blending, in turns.
pub type Times = Vec<Vec<(String, f64)>>;

const WARM_UP: Duration = Duration::from_millis(500);
const TARGET: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;

pub fn measure(
    kept: &mut Kept,
    scene: &Scene,
    camera: &Camera,
    request: &Request,
    background: &Background<f32>,
    frames: usize,
) -> Result<[Times; 2]> {
    let gpu = &kept.gpu.clone();
    let variant = plan::variant(gpu, scene, request)?;
    if !is_enough(gpu, &variant, scene, request) {
        return Err(Error::Parameter("only an image with one sample and no lists is measured".into()));
    }
    let ready = Ready::new(kept, &variant, (scene, camera), request, background)?;
    let memory = request.memory.unwrap_or(DEFAULT_MEMORY);
    let mut canvas = Canvas::new(&ready, Leaves::Color, memory, kept)?;
    let Some(found) = canvas.render(&ready)? else {
        return Err(Error::Parameter("some pixel is too deep for registers".into()));
    };
    if found.bands != 1 {
        return Err(Error::Parameter("bands are not measured: raise memory=".into()));
    }
    let eye = with_contents(gpu, "eye", BufferUsages::UNIFORM, &[ready.eye]);
    let blending = Blending::new(gpu, &ready, &eye)?;
    // Until the device's clock has risen.
    let clock = Instant::now();
    while clock.elapsed() < WARM_UP {
        canvas.render(&ready)?;
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        gpu.checked("a frame", || {
            for _ in 0..20 {
                blending.encode(3 * ready.scene.triangles, &mut encoder, &Timing::new(gpu));
            }
            Ok(())
        })?;
        gpu.submit_and_read(encoder, &[])?;
    }
    let mut timings = Vec::new();
    for _ in 0..frames {
        for side in 0..2 {
            let timing = Timing::new(gpu);
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            gpu.checked("a frame", || {
                if side == 0 {
                    canvas.encode(&ready, &mut encoder, &timing)?;
                } else {
                    blending.encode(3 * ready.scene.triangles, &mut encoder, &timing);
                }
                timing.finish(&mut encoder);
                gpu.queue.submit([encoder.finish()]);
                Ok(())
            })?;
            timings.push(timing);
        }
    }
    let buffers: Vec<&wgpu::Buffer> = timings.iter().filter_map(Timing::buffer).collect();
    let words = gpu.submit_and_read(gpu.device.create_command_encoder(&Default::default()), &buffers)?;
    // What was timed must have done the work.
    let counted = canvas.count_fragments(gpu)?;
    if counted != found.fragments {
        let what = format!("a timed frame has {counted} fragments of {}", found.fragments);
        return Err(Error::Device(what));
    }
    let mut times: [Times; 2] = Default::default();
    for (i, (timing, words)) in timings.iter().zip(&words).enumerate() {
        let mut own: Vec<(String, f64)> =
            timing.read(words).into_iter().map(|(name, ms)| (name.into_owned(), ms)).collect();
        own.extend(timing.span(words).map(|ms| ("gpu".into(), ms)));
        times[i % 2].push(own);
    }
    Ok(times)
}

struct Blending {
    pipeline: wgpu::RenderPipeline,
    group: wgpu::BindGroup,
    target: wgpu::TextureView,
}

impl Blending {
    fn new(gpu: &Gpu, ready: &Ready, eye: &wgpu::Buffer) -> Result<Self> {
        let (scene, (width, height)) = (&ready.scene, ready.size);
        use Slot::{Read, Uniform};
        let module = compile(
            gpu,
            "blending",
            &Composed::new(String::new(), &["common", "tiles/scene", "tiles/blending"])?,
        )?;
        gpu.checked("plain blending", || {
            let slots = [Uniform, Uniform, Read, Read, Read, Read, Read];
            let layout = layout(gpu, "blending", ShaderStages::VERTEX, &slots);
            let arrays = [&scene.positions, &scene.faces, &scene.mesh_ids, &scene.meshes, &scene.colors];
            let slots: Vec<_> = [&ready.view, eye].into_iter().chain(arrays).map(Into::into).collect();
            let group = bind(gpu, "blending", &layout, &slots);
            let target = wgpu::ColorTargetState {
                format: TARGET,
                blend: Some(wgpu::BlendState::ALPHA_BLENDING),
                write_mask: wgpu::ColorWrites::ALL,
            };
            let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some("blending"),
                layout: Some(&pipeline_layout(gpu, &[&layout])),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some("vs_blending"),
                    compilation_options: Default::default(),
                    buffers: &[],
                },
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: None,
                multisample: wgpu::MultisampleState::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some("fs_blending"),
                    compilation_options: Default::default(),
                    targets: &[Some(target)],
                }),
                multiview_mask: None,
                cache: None,
            });
            let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some("blending"),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: TARGET,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
                view_formats: &[],
            });
            Ok(Self { pipeline, group, target: texture.create_view(&Default::default()) })
        })
    }

    fn encode(&self, vertices: u32, encoder: &mut wgpu::CommandEncoder, timing: &Timing) {
        let attachment = wgpu::RenderPassColorAttachment {
            view: &self.target,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations {
                load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                store: wgpu::StoreOp::Store,
            },
        };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("blending"),
            color_attachments: &[Some(attachment)],
            timestamp_writes: timing.render("blending"),
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        pass.draw(0..vertices, 0..1);
    }
}
