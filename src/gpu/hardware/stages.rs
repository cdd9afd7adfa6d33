//! The shaders and pipelines of native forms, each made when it is first used.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use wgpu::ShaderStages;

use super::canvas::Target;
use crate::error::Result;
use crate::gpu::buffers::{Bound, Slot, layout, layout_of};
use crate::gpu::compile::{compile, compute, once, pipeline_layout};
use crate::gpu::device::Gpu;
use crate::gpu::pipelines::DEPTH_FORMAT;
use crate::gpu::variant::Variant;
use crate::methods::Method;
#[cfg(test)]
use crate::methods::tests::some_methods;
use crate::shader::Composed;

pub struct Stages {
    pub scene_layout: wgpu::BindGroupLayout,
    pub behind_layout: wgpu::BindGroupLayout,
    pub totals_layout: wgpu::BindGroupLayout,
    totals: OnceLock<wgpu::ComputePipeline>,
    /// By method and constants.
    modules: Mutex<HashMap<String, wgpu::ShaderModule>>,
    /// By those, and what a pass is like.
    passes: Mutex<HashMap<String, Arc<Pass>>>,
}

pub struct Pass {
    pub pipeline: wgpu::RenderPipeline,
    pub reads: wgpu::BindGroupLayout,
}

/// What a scene requires beside what its variant says.
#[derive(Debug, Clone, Copy)]
pub struct Features {
    pub culls: bool,
    pub cuts_out: bool,
    /// Colours are drawn in 16 bits.
    pub half_targets: bool,
}

/// What a module is made for.
#[derive(Clone, Copy)]
pub struct For<'a> {
    pub variant: &'a Variant,
    pub method: &'a Method,
    pub features: Features,
}

/// A pass over geometry, or over the screen.
pub struct Drawing<'a> {
    pub vertex: &'static str,
    pub fragment: &'static str,
    pub targets: &'a [Target<'a>],
    pub depth: Depth,
    pub samples: u32,
    pub reads: &'a [Bound<'a>],
}

/// What becomes of the depth target. Depth is reversed, and equal passes (see src/gpu/pipelines.rs).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Depth {
    None,
    Tested,
    Written,
}

impl Stages {
    pub fn new(gpu: &Gpu) -> Self {
        use Slot::{Color, Read, ReadWrite, Uniform};
        let (vertex, both) = (ShaderStages::VERTEX, ShaderStages::VERTEX_FRAGMENT);
        let scene = [
            (Uniform, both),
            (Uniform, vertex),
            (Uniform, both),
            (Read, vertex),
            (Read, vertex),
            (Read, vertex),
            (Read, vertex),
            (Read, both),
            (Read, vertex),
        ];
        Self {
            scene_layout: layout_of(gpu, "drawn scene", &scene),
            behind_layout: layout(gpu, "behind", ShaderStages::FRAGMENT, &[Color, Color]),
            totals_layout: layout(gpu, "totals", ShaderStages::COMPUTE, &[Color, ReadWrite, Uniform]),
            totals: OnceLock::new(),
            modules: Default::default(),
            passes: Default::default(),
        }
    }

    pub fn totals(&self, gpu: &Gpu) -> Result<&wgpu::ComputePipeline> {
        once(gpu, &self.totals, || {
            let module = compile(gpu, "totals", &totals()?)?;
            Ok(compute(gpu, &module, "cs_totals", &[&self.totals_layout]))
        })
    }

    fn module(&self, gpu: &Gpu, key: &str, of: For) -> Result<wgpu::ShaderModule> {
        let mut made = self.modules.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(module) = made.get(key) {
            return Ok(module.clone());
        }
        let module = compile(gpu, of.method.id(), &native(of)?)?;
        made.insert(key.to_string(), module.clone());
        Ok(module)
    }

    pub fn pass(&self, gpu: &Gpu, made_for: For, of: &Drawing) -> Result<Arc<Pass>> {
        let slots: Vec<Slot> = of.reads.iter().map(Slot::of).collect();
        let targets: Vec<_> = of.targets.iter().map(Target::state).collect();
        let For { method, features, .. } = made_for;
        let module = format!("{} {} {features:?}", method.id(), method.constants_text());
        let key = format!(
            "{module} {} {} {targets:?} {:?} {} {slots:?}",
            of.vertex, of.fragment, of.depth, of.samples
        );
        let mut made = self.passes.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(pass) = made.get(&key) {
            return Ok(pass.clone());
        }
        let pass = gpu.checked("making pipelines", || {
            let module = self.module(gpu, &module, made_for)?;
            let reads = layout(gpu, of.fragment, ShaderStages::FRAGMENT, &slots);
            let mut groups = vec![&self.scene_layout, &reads];
            if of.vertex == SCREEN {
                groups.push(&self.behind_layout);
            }
            let depth_stencil = (of.depth != Depth::None).then(|| wgpu::DepthStencilState {
                format: DEPTH_FORMAT,
                depth_write_enabled: Some(of.depth == Depth::Written),
                depth_compare: Some(wgpu::CompareFunction::GreaterEqual),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            });
            let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(of.fragment),
                layout: Some(&pipeline_layout(gpu, &groups)),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some(of.vertex),
                    compilation_options: Default::default(),
                    buffers: &[],
                },
                // Two-sided: the fragment stage culls.
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil,
                multisample: wgpu::MultisampleState { count: of.samples, ..Default::default() },
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some(of.fragment),
                    compilation_options: Default::default(),
                    targets: &targets,
                }),
                multiview_mask: None,
                cache: None,
            });
            Ok(Arc::new(Pass { pipeline, reads }))
        })?;
        made.insert(key, pass.clone());
        Ok(pass)
    }
}

/// The vertex stage of passes over the screen.
pub const SCREEN: &str = "vs_screen";

fn totals() -> Result<Composed> {
    Composed::new(String::new(), &["hardware/totals"])
}

/// Files of a method's native form, after those that all have; none where it has no such form.
pub fn files(method: &Method) -> &'static [&'static str] {
    match method {
        Method::Additive(_) => &["hardware/blended", "hardware/additive"],
        Method::Unsorted(_) => &["hardware/blended", "hardware/unsorted"],
        Method::WeightedAverage(_) => &["hardware/blended", "hardware/weighted_average"],
        Method::Wboit(_) => &["hardware/blended", "hardware/wboit"],
        Method::Mboit(own) => {
            if own.is_trigonometric() {
                &MBOIT_TRIGONOMETRIC
            } else {
                &MBOIT
            }
        }
        Method::Stochastic(_) => &["hardware/stochastic", "hardware/stochastic_composite"],
        Method::DepthPeeling(_) => {
            &["hardware/depth_peeling", "hardware/peeled_under", "hardware/peeled_composite"]
        }
        Method::DualDepthPeeling(_) => {
            &["hardware/dual_depth_peeling", "hardware/dual_merge", "hardware/dual_composite"]
        }
        _ => &[],
    }
}

const MBOIT: [&str; 4] =
    ["hardware/blended", "hardware/blended_second", "hardware/mboit", "hardware/power_moments"];
const MBOIT_TRIGONOMETRIC: [&str; 4] =
    ["hardware/blended", "hardware/blended_second", "hardware/mboit", "hardware/trigonometric_moments"];

fn native(For { variant, method, features }: For) -> Result<Composed> {
    let Features { culls, cuts_out, half_targets } = features;
    let own = format!(
        "const CULLS = {culls};\nconst CUTS_OUT = {cuts_out};\nconst HALF_TARGETS = {half_targets};\n"
    );
    let prelude = variant.prelude(1, 0) + &own;
    let own = format!("methods/{}", method.id());
    let mut all = vec!["common", "exact", "tiles/triangle", "tiles/scene", "methods/common/fragment"];
    all.extend([
        "hardware/raster",
        "hardware/screen",
        "hardware/coverage",
        "hardware/absorbed",
        variant.affine_file(),
    ]);
    // Which some methods have anyway.
    const HAVE: [&str; 2] = ["methods/common/layer", "methods/common/absorbance"];
    all.extend(HAVE);
    all.extend(method.common().iter().filter(|file| !HAVE.contains(file)));
    all.push(&own);
    all.extend(files(method));
    let mut composed = Composed::new(prelude, &all)?;
    composed.push(&method.constants_text(), "parameters".into());
    Ok(composed)
}

/// Every module, for the tests that read them all.
#[cfg(test)]
pub fn modules(variant: &Variant) -> Vec<Composed> {
    let features = Features { culls: variant.hides, cuts_out: variant.hides, half_targets: variant.hides };
    let methods = some_methods();
    // For over alone.
    let is_drawn = variant.tiles && !variant.layout.mixed;
    let natives = methods.iter().filter(|method| is_drawn && !files(method).is_empty());
    let all = natives.map(|method| native(For { variant, method, features }));
    all.chain([totals()]).map(Result::unwrap).collect()
}
