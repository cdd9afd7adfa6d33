//! The pipelines of a variant, each made when it is first used.

use std::sync::OnceLock;

use rayon::prelude::*;
use wgpu::{ShaderStages, TextureFormat};

use super::buffers::{Slot, layout};
use super::compile::{Once, compile, compute, compute_uncleared, once, pipeline_layout};
use super::device::Gpu;
use super::hardware;
use super::tiles::Stages;
use super::variant::{BuildStage, Variant};
use crate::error::Result;
use crate::frame::Sort;
use crate::threads::threads;

pub const DEPTH_FORMAT: TextureFormat = TextureFormat::Depth32Float;
pub const COLOR_FORMAT: TextureFormat = TextureFormat::Rgba32Float;
/// A target that nothing is written to, where a pass needs no other: it only says how large a pass is, and with
/// how many samples.
pub const COVERAGE_FORMAT: TextureFormat = TextureFormat::R8Unorm;

pub struct Pipelines {
    pub variant: Variant,
    pub layouts: Layouts,
    opaque: Once<wgpu::RenderPipeline>,
    build: [Once<wgpu::RenderPipeline>; 4],
    gather: Once<wgpu::ComputePipeline>,
    classify: Once<Classify>,
    classes: Vec<Once<wgpu::ComputePipeline>>,
    fullscreen: Vec<Once<wgpu::RenderPipeline>>,
    average: Once<wgpu::ComputePipeline>,
    background: Once<wgpu::ComputePipeline>,
    long: Once<Long>,
    scan: Once<Scan>,
    pub tiles: Stages,
    pub hardware: hardware::Stages,
}

/// Bind group layouts, by what is bound.
pub struct Layouts {
    /// Group 0 of the raster stages: view, batch, and the geometry.
    pub geometry: wgpu::BindGroupLayout,
    /// Group 1 of the passes over translucent geometry.
    pub link: wgpu::BindGroupLayout,
    pub count: wgpu::BindGroupLayout,
    pub scatter: wgpu::BindGroupLayout,
    /// Group 2 of those where the shader compares depths.
    pub depth: Option<wgpu::BindGroupLayout>,
    /// Group 0 of the stages after them: the lists, to read, and the results.
    pub read: wgpu::BindGroupLayout,
    pub classify: wgpu::BindGroupLayout,
    pub class: wgpu::BindGroupLayout,
    pub average: wgpu::BindGroupLayout,
    pub background: wgpu::BindGroupLayout,
    pub long: wgpu::BindGroupLayout,
    pub scan: wgpu::BindGroupLayout,
    pub gather: wgpu::BindGroupLayout,
}

pub struct Classify {
    pub classify: wgpu::ComputePipeline,
    pub plan: wgpu::ComputePipeline,
    pub place: wgpu::ComputePipeline,
}

/// The stages for long lists.
pub struct Long {
    pub begin: wgpu::ComputePipeline,
    pub gather: wgpu::ComputePipeline,
    /// Of blocks, by a workgroup each, or of chunks, by an invocation each.
    pub sort_runs: wgpu::ComputePipeline,
    pub in_blocks: bool,
    pub merge: wgpu::ComputePipeline,
    pub limit: wgpu::ComputePipeline,
    pub truncate: wgpu::ComputePipeline,
    pub composite: wgpu::ComputePipeline,
    pub finish: wgpu::ComputePipeline,
}

pub struct Scan {
    pub scan: wgpu::ComputePipeline,
    pub add: wgpu::ComputePipeline,
}

impl Layouts {
    fn new(gpu: &Gpu, variant: &Variant) -> Self {
        use Slot::{Color, Colors, Depth, Depths, Read, ReadWrite, Uniform};
        let (raster, fragment) = (ShaderStages::VERTEX_FRAGMENT, ShaderStages::FRAGMENT);
        // The resolve runs as a dispatch or as a full-screen pass.
        let (resolve, compute) = (ShaderStages::COMPUTE | ShaderStages::FRAGMENT, ShaderStages::COMPUTE);
        let samples = variant.layout.samples > 1;
        let (color, depth) = if samples { (Colors, Depths) } else { (Color, Depth) };
        let opaque = if variant.tiles { Read } else { color };
        let either = fragment | compute; // rasterised by hardware or by tiles
        let of = |label: &str, stages, slots: &[Slot]| layout(gpu, label, stages, slots);
        Self {
            geometry: of("geometry", raster, &[Uniform, Uniform, Read, Read, Read, Read]),
            link: of("link", fragment, &[Uniform, ReadWrite, ReadWrite, ReadWrite, ReadWrite]),
            count: of("count", either, &[Uniform, ReadWrite]),
            scatter: of("scatter", either, &[Uniform, ReadWrite, ReadWrite]),
            depth: variant.compares_depth().then(|| of("opaque depth", fragment, &[depth])),
            read: of("read", resolve, &[Uniform, Uniform, Read, Read, ReadWrite, ReadWrite, Color, opaque]),
            classify: of("classify", compute, &[ReadWrite, ReadWrite, ReadWrite, ReadWrite]),
            class: of("class", resolve, &[ReadWrite, Read, ReadWrite]),
            average: of("average", compute, &[Read]),
            background: of("background", compute, &[ReadWrite]),
            long: of(
                "long",
                compute,
                &[ReadWrite, ReadWrite, ReadWrite, ReadWrite, Read, Uniform, Read, ReadWrite, Read],
            ),
            scan: of("scan", compute, &[ReadWrite, ReadWrite, Uniform, ReadWrite]),
            gather: of("gather", compute, &[Uniform, Uniform, Read, Read, ReadWrite, ReadWrite]),
        }
    }
}

impl Pipelines {
    pub fn new(gpu: &Gpu, variant: Variant) -> Self {
        let classes = variant.classes.len();
        Self {
            layouts: Layouts::new(gpu, &variant),
            opaque: OnceLock::new(),
            build: Default::default(),
            gather: OnceLock::new(),
            classify: OnceLock::new(),
            classes: (0..classes).map(|_| OnceLock::new()).collect(),
            fullscreen: (0..classes).map(|_| OnceLock::new()).collect(),
            average: OnceLock::new(),
            background: OnceLock::new(),
            long: OnceLock::new(),
            scan: OnceLock::new(),
            tiles: Stages::new(gpu),
            hardware: hardware::Stages::new(gpu),
            variant,
        }
    }

    /// Opaque geometry: writes colour and depth.
    pub fn opaque(&self, gpu: &Gpu) -> Result<&wgpu::RenderPipeline> {
        once(gpu, &self.opaque, || {
            let module = compile(gpu, "opaque", &self.variant.opaque()?)?;
            let color = Some(wgpu::ColorTargetState {
                format: COLOR_FORMAT,
                blend: None,
                write_mask: wgpu::ColorWrites::ALL,
            });
            let format = self.variant.opaque_format().unwrap_or(DEPTH_FORMAT);
            let depth = self.depth_state(format, true, false);
            let samples = self.variant.layout.samples;
            Ok(self.render(
                gpu,
                &module,
                ("opaque", samples),
                &[&self.layouts.geometry],
                Some(depth),
                &[color],
            ))
        })
    }

    /// A pass over translucent geometry. It writes no target: it tests depth, counts in the stencil, or does
    /// neither, and has no colour target beside a depth target, since Mesa's llvmpipe loses storage writes of
    /// draws that write colour.
    pub fn build(&self, gpu: &Gpu, stage: BuildStage) -> Result<&wgpu::RenderPipeline> {
        once(gpu, &self.build[stage as usize], || {
            let module = compile(gpu, "build", &self.variant.build(stage)?)?;
            let lists = match stage {
                BuildStage::Link | BuildStage::Append => &self.layouts.link,
                BuildStage::Count => &self.layouts.count,
                BuildStage::Scatter => &self.layouts.scatter,
            };
            let mut groups = vec![&self.layouts.geometry, lists];
            groups.extend(&self.layouts.depth);
            let samples = self.variant.layout.samples;
            if let Some(format) = self.variant.build_format() {
                let depth = self.depth_state(format, false, true);
                return Ok(self.render(gpu, &module, ("build", samples), &groups, Some(depth), &[]));
            }
            Ok(self.render(gpu, &module, ("build", samples), &groups, None, &[nothing()]))
        })
    }

    pub fn gather(&self, gpu: &Gpu) -> Result<&wgpu::ComputePipeline> {
        once(gpu, &self.gather, || {
            let module = compile(gpu, "gather", &self.variant.gather()?)?;
            Ok(compute(gpu, &module, "cs_gather", &[&self.layouts.gather]))
        })
    }

    pub fn classify(&self, gpu: &Gpu) -> Result<&Classify> {
        once(gpu, &self.classify, || {
            let module = compile(gpu, "classify", &self.variant.classify()?)?;
            let groups = [&self.layouts.read, &self.layouts.classify];
            let of = |entry: &str| compute(gpu, &module, entry, &groups);
            Ok(Classify { classify: of("cs_classify"), plan: of("cs_plan"), place: of("cs_place") })
        })
    }

    /// Makes the pipelines of those classes side by side: a driver may take seconds for each.
    pub fn prepare_classes(&self, gpu: &Gpu, classes: &[usize]) -> Result<()> {
        let is_made = |class: usize| match self.variant.fullscreen {
            true => self.fullscreen[class].get().is_some(),
            false => self.classes[class].get().is_some(),
        };
        let missing: Vec<_> = classes.iter().copied().filter(|&class| !is_made(class)).collect();
        if missing.is_empty() {
            return Ok(()); // no thread need wake
        }
        let make = |class| match self.variant.fullscreen {
            true => self.fullscreen(gpu, class).map(drop),
            false => self.class(gpu, class).map(drop),
        };
        threads()?.install(|| missing.into_par_iter().try_for_each(make))
    }

    pub fn class(&self, gpu: &Gpu, class: usize) -> Result<&wgpu::ComputePipeline> {
        once(gpu, &self.classes[class], || {
            let module = compile(gpu, "class", &self.variant.class(class)?)?;
            Ok(compute(gpu, &module, "cs_resolve", &[&self.layouts.read, &self.layouts.class]))
        })
    }

    pub fn fullscreen(&self, gpu: &Gpu, class: usize) -> Result<&wgpu::RenderPipeline> {
        once(gpu, &self.fullscreen[class], || {
            let module = compile(gpu, "class", &self.variant.class(class)?)?;
            let groups = [&self.layouts.read, &self.layouts.class];
            let Some(format) = self.variant.build_format().filter(|_| self.variant.counts_in_stencil())
            else {
                return Ok(self.render(gpu, &module, ("resolve", 1), &groups, None, &[nothing()]));
            };
            let mut depth = self.depth_state(format, false, false);
            depth.depth_compare = depth.depth_compare.map(|_| wgpu::CompareFunction::Always);
            let face = wgpu::StencilFaceState {
                compare: wgpu::CompareFunction::NotEqual, // to 0: something is listed
                ..wgpu::StencilFaceState::IGNORE
            };
            depth.stencil = wgpu::StencilState { front: face, back: face, read_mask: 0xff, write_mask: 0 };
            Ok(self.render(gpu, &module, ("resolve", 1), &groups, Some(depth), &[]))
        })
    }

    pub fn average(&self, gpu: &Gpu) -> Result<&wgpu::ComputePipeline> {
        once(gpu, &self.average, || {
            let module = compile(gpu, "average", &self.variant.average()?)?;
            Ok(compute(gpu, &module, "cs_average", &[&self.layouts.read, &self.layouts.average]))
        })
    }

    pub fn background(&self, gpu: &Gpu) -> Result<&wgpu::ComputePipeline> {
        once(gpu, &self.background, || {
            let module = compile(gpu, "background", &self.variant.background()?)?;
            Ok(compute(gpu, &module, "cs_background", &[&self.layouts.read, &self.layouts.background]))
        })
    }

    pub fn long(&self, gpu: &Gpu) -> Result<&Long> {
        once(gpu, &self.long, || {
            let module = compile(gpu, "long", &self.variant.long()?)?;
            let groups = [&self.layouts.read, &self.layouts.long];
            let of = |entry: &str| compute(gpu, &module, entry, &groups);
            let in_blocks = match self.variant.sort {
                Sort::Bitonic => true,
                // A software driver takes up to ten times as long over them: a barrier there is a switch of all
                // invocations.
                Sort::Auto => !gpu.adapter.is_software(),
                _ => false,
            };
            Ok(Long {
                begin: of("cs_begin"),
                gather: of("cs_gather"),
                sort_runs: if in_blocks {
                    compute_uncleared(gpu, &module, "cs_sort_blocks", &groups)
                } else {
                    of("cs_sort_chunks")
                },
                in_blocks,
                merge: of("cs_merge"),
                limit: of("cs_limit"),
                truncate: of("cs_truncate"),
                composite: of("cs_composite"),
                finish: of("cs_finish"),
            })
        })
    }

    pub fn scan(&self, gpu: &Gpu) -> Result<&Scan> {
        once(gpu, &self.scan, || {
            let module = compile(gpu, "scan", &self.variant.scan()?)?;
            let of = |entry: &str| compute(gpu, &module, entry, &[&self.layouts.scan]);
            Ok(Scan { scan: of("cs_scan"), add: of("cs_add") })
        })
    }

    fn depth_state(&self, format: TextureFormat, writes: bool, counts: bool) -> wgpu::DepthStencilState {
        let face = wgpu::StencilFaceState {
            compare: wgpu::CompareFunction::Always,
            fail_op: wgpu::StencilOperation::Keep,
            depth_fail_op: wgpu::StencilOperation::Keep,
            // Clamped: 256 fragments must not count as none.
            pass_op: wgpu::StencilOperation::IncrementClamp,
        };
        let stencil = if counts && self.variant.counts_in_stencil() {
            wgpu::StencilState { front: face, back: face, read_mask: 0xff, write_mask: 0xff }
        } else {
            wgpu::StencilState::default()
        };
        // Depth is reversed. Equal passes: a fragment at the opaque depth is kept, and of two opaque ones the
        // later wins. Where the shader compares samples, the hardware must not decide first, by other roundings.
        let compare = if self.variant.layout.samples > 1 && !writes {
            wgpu::CompareFunction::Always
        } else {
            wgpu::CompareFunction::GreaterEqual
        };
        let has_depth = format.has_depth_aspect();
        wgpu::DepthStencilState {
            format,
            depth_write_enabled: has_depth.then_some(writes),
            depth_compare: has_depth.then_some(compare),
            stencil,
            bias: wgpu::DepthBiasState::default(),
        }
    }

    fn render(
        &self,
        gpu: &Gpu,
        module: &wgpu::ShaderModule,
        (stage, samples): (&str, u32),
        groups: &[&wgpu::BindGroupLayout],
        depth_stencil: Option<wgpu::DepthStencilState>,
        targets: &[Option<wgpu::ColorTargetState>],
    ) -> wgpu::RenderPipeline {
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
            depth_stencil,
            multisample: wgpu::MultisampleState { count: samples, ..wgpu::MultisampleState::default() },
            fragment: Some(wgpu::FragmentState {
                module,
                entry_point: Some(&format!("fs_{stage}")),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets,
            }),
            multiview_mask: None,
            cache: None,
        })
    }
}

/// A target that nothing is written to.
fn nothing() -> Option<wgpu::ColorTargetState> {
    Some(wgpu::ColorTargetState {
        format: COVERAGE_FORMAT,
        blend: None,
        write_mask: wgpu::ColorWrites::empty(),
    })
}
