//! Every pipeline of a device, made once.

use pollster::block_on;
use wgpu::ShaderStages;

use super::buffers::{Slot, layout};
use super::device::Gpu;
use crate::error::{Error, Result};
use crate::shader::Composed;

pub const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
pub const COLOR_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;

pub struct Pipelines {
    /// Group 0 of the raster stages: view, batch, and the geometry.
    pub geometry: wgpu::BindGroupLayout,
    /// Group 1 of the build: the lists, to write.
    pub lists: wgpu::BindGroupLayout,
    /// Group 2 of the build where the shader compares depths; `None` where the test is early.
    pub depth: Option<wgpu::BindGroupLayout>,
    /// Group 0 of the stages after it: the lists, to read, and the results.
    pub read: wgpu::BindGroupLayout,
    /// Group 1 of the resolve: the pixels with long lists.
    pub long_pixels: wgpu::BindGroupLayout,
    /// Group 1 of the stages for long lists.
    pub long: wgpu::BindGroupLayout,
    pub opaque: wgpu::RenderPipeline,
    pub build: wgpu::RenderPipeline,
    pub resolve: wgpu::ComputePipeline,
    pub begin: wgpu::ComputePipeline,
    pub count: wgpu::ComputePipeline,
    pub gather: wgpu::ComputePipeline,
    pub sort_chunks: wgpu::ComputePipeline,
    pub merge: wgpu::ComputePipeline,
    pub composite: wgpu::ComputePipeline,
}

impl Pipelines {
    pub fn new(gpu: &Gpu) -> Result<Self> {
        use Slot::{Color, Depth, Read, ReadWrite, Uniform};
        let raster = ShaderStages::VERTEX_FRAGMENT;
        let compute = ShaderStages::COMPUTE;
        let early = gpu.features.contains(wgpu::Features::SHADER_EARLY_DEPTH_TEST);
        let (opaque, build) =
            (module(gpu, "opaque")?, module(gpu, if early { "build_early" } else { "build_compare" })?);
        let (resolve, long_module) = (module(gpu, "resolve")?, module(gpu, "long")?);
        gpu.checked("making pipelines", || {
            let geometry = layout(gpu, "geometry", raster, &[Uniform, Uniform, Read, Read, Read, Read]);
            let lists = layout(
                gpu,
                "lists",
                ShaderStages::FRAGMENT,
                &[Uniform, ReadWrite, ReadWrite, ReadWrite, ReadWrite, ReadWrite],
            );
            let depth = (!early).then(|| layout(gpu, "opaque depth", ShaderStages::FRAGMENT, &[Depth]));
            let read = layout(
                gpu,
                "read",
                compute,
                &[Uniform, Uniform, Read, Read, Read, Read, ReadWrite, ReadWrite, Color],
            );
            let long_pixels = layout(gpu, "long pixels", compute, &[ReadWrite]);
            let long = layout(
                gpu,
                "long",
                compute,
                &[ReadWrite, ReadWrite, ReadWrite, ReadWrite, Read, Uniform, Read],
            );
            let of_long = |entry: &str| compute_pipeline(gpu, &long_module, entry, &[&read, &long]);
            let mut build_groups = vec![&geometry, &lists];
            build_groups.extend(&depth);
            Ok(Self {
                opaque: render_pipeline(gpu, &opaque, "opaque", &[&geometry], true),
                build: render_pipeline(gpu, &build, "build", &build_groups, false),
                resolve: compute_pipeline(gpu, &resolve, "cs_resolve", &[&read, &long_pixels]),
                begin: of_long("cs_begin"),
                count: of_long("cs_count"),
                gather: of_long("cs_gather"),
                sort_chunks: of_long("cs_sort_chunks"),
                merge: of_long("cs_merge"),
                composite: of_long("cs_composite"),
                geometry,
                lists,
                depth,
                read,
                long_pixels,
                long,
            })
        })
    }
}

/// Compiles a module; what is wrong with it is told in the lines of its own files.
fn module(gpu: &Gpu, name: &str) -> Result<wgpu::ShaderModule> {
    let composed = Composed::module(name)?;
    let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::Validation);
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(name),
        source: wgpu::ShaderSource::Wgsl(composed.text.as_str().into()),
    });
    let Some(error) = block_on(scope.pop()) else {
        return Ok(module);
    };
    let messages = block_on(module.get_compilation_info()).messages;
    let message = messages.into_iter().find(|m| m.message_type == wgpu::CompilationMessageType::Error);
    Err(match message {
        Some(m) => composed.error(m.location.map_or(1, |l| l.line_number as usize), &m.message),
        None => Error::Device(format!("shader {name} does not compile: {error}")),
    })
}

fn pipeline_layout(gpu: &Gpu, groups: &[&wgpu::BindGroupLayout]) -> wgpu::PipelineLayout {
    let groups: Vec<_> = groups.iter().map(|g| Some(*g)).collect();
    gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: &groups,
        immediate_size: 0,
    })
}

fn compute_pipeline(
    gpu: &Gpu,
    module: &wgpu::ShaderModule,
    entry: &str,
    groups: &[&wgpu::BindGroupLayout],
) -> wgpu::ComputePipeline {
    gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(entry),
        layout: Some(&pipeline_layout(gpu, groups)),
        module,
        entry_point: Some(entry),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    })
}

/// The opaque pass writes colour and depth. The build writes neither: it only tests depth, and has no colour
/// target at all, since Mesa's llvmpipe loses storage writes of draws that write colour.
fn render_pipeline(
    gpu: &Gpu,
    module: &wgpu::ShaderModule,
    stage: &str,
    groups: &[&wgpu::BindGroupLayout],
    writes: bool,
) -> wgpu::RenderPipeline {
    let color = [Some(wgpu::ColorTargetState {
        format: COLOR_FORMAT,
        blend: None,
        write_mask: wgpu::ColorWrites::ALL,
    })];
    gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(stage),
        layout: Some(&pipeline_layout(gpu, groups)),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(&format!("vs_{stage}")),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        // Two-sided: the vertex stage culls, by the winding that the user gave.
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(writes),
            // Depth is reversed. Equal passes: a fragment at the opaque depth is kept, and of two opaque
            // ones the later wins.
            depth_compare: Some(wgpu::CompareFunction::GreaterEqual),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(&format!("fs_{stage}")),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: if writes { &color } else { &[] },
        }),
        multiview_mask: None,
        cache: None,
    })
}
