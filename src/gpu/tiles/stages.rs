//! The shaders and pipelines of the tile rasteriser.

use std::sync::OnceLock;

use wgpu::ShaderStages;

use crate::error::Result;
use crate::gpu::buffers::{Slot, layout};
use crate::gpu::device::Gpu;
use crate::gpu::pipelines::{compile, compute, once};
use crate::gpu::variant::{BuildStage, Variant};
use crate::shader::Composed;

/// Bins of an image, at most: what workgroup memory holds masks for.
pub const MAX_BINS: u32 = 512;

/// Made at the first use.
pub struct Stages {
    pub setup_layout: wgpu::BindGroupLayout,
    pub bin_layout: wgpu::BindGroupLayout,
    pub walk_layout: wgpu::BindGroupLayout,
    pub opaque_layout: wgpu::BindGroupLayout,
    pub hidden_layout: wgpu::BindGroupLayout,
    setup: OnceLock<Setup>,
    bin: OnceLock<Bin>,
    opaque: OnceLock<wgpu::ComputePipeline>,
    keep: [OnceLock<wgpu::ComputePipeline>; 2],
}

pub struct Setup {
    pub setup: wgpu::ComputePipeline,
    pub clip: wgpu::ComputePipeline,
}

pub struct Bin {
    pub count_bins: wgpu::ComputePipeline,
    pub offsets: wgpu::ComputePipeline,
    pub scatter_bins: wgpu::ComputePipeline,
    pub bin_tiles: wgpu::ComputePipeline,
}

impl Stages {
    pub fn new(gpu: &Gpu) -> Self {
        use Slot::{Read, ReadWrite, Uniform};
        let of = |label: &str, uniforms: usize, read: usize, written: usize| {
            let slots = [vec![Uniform; uniforms], vec![Read; read], vec![ReadWrite; written]].concat();
            layout(gpu, label, ShaderStages::COMPUTE, &slots)
        };
        Self {
            setup_layout: of("tile setup", 2, 5, 6),
            bin_layout: of("tile binning", 2, 2, 6),
            walk_layout: of("tile walk", 2, 8, 0),
            opaque_layout: of("tile opaque", 0, 0, 2),
            hidden_layout: of("tile hidden", 0, 1, 0),
            setup: OnceLock::new(),
            bin: OnceLock::new(),
            opaque: OnceLock::new(),
            keep: Default::default(),
        }
    }

    pub fn setup(&self, gpu: &Gpu, variant: &Variant) -> Result<&Setup> {
        once(gpu, &self.setup, || {
            let module = compile(gpu, "tile setup", &setup(variant)?)?;
            let of = |entry: &str| compute(gpu, &module, entry, &[&self.setup_layout]);
            Ok(Setup { setup: of("cs_setup"), clip: of("cs_clip") })
        })
    }

    pub fn bin(&self, gpu: &Gpu, variant: &Variant) -> Result<&Bin> {
        once(gpu, &self.bin, || {
            let module = compile(gpu, "tile binning", &bin(variant)?)?;
            let of = |entry: &str| compute(gpu, &module, entry, &[&self.bin_layout]);
            Ok(Bin {
                count_bins: of("cs_count_bins"),
                offsets: of("cs_offsets"),
                scatter_bins: of("cs_scatter_bins"),
                bin_tiles: of("cs_bin_tiles"),
            })
        })
    }

    pub fn opaque(&self, gpu: &Gpu, variant: &Variant) -> Result<&wgpu::ComputePipeline> {
        once(gpu, &self.opaque, || {
            let module = compile(gpu, "tile opaque", &opaque(variant)?)?;
            Ok(compute(gpu, &module, "cs_opaque", &[&self.walk_layout, &self.opaque_layout]))
        })
    }

    /// Counts fragments, or scatters them into lists. `lists`: what that stage binds as group 1.
    pub fn keep(
        &self,
        gpu: &Gpu,
        variant: &Variant,
        stage: BuildStage,
        lists: &wgpu::BindGroupLayout,
    ) -> Result<&wgpu::ComputePipeline> {
        once(gpu, &self.keep[usize::from(stage == BuildStage::Scatter)], || {
            let module = compile(gpu, "tile lists", &keep(variant, stage)?)?;
            let mut groups = vec![&self.walk_layout, lists];
            if variant.hides {
                groups.push(&self.hidden_layout);
            }
            Ok(compute(gpu, &module, "cs_keep", &groups))
        })
    }
}

const WALK: [&str; 6] = ["common", "exact", "tiles/triangle", "tiles/edges", "tiles/walk", "tiles/lists"];

/// Every module, for the tests that read them all.
#[cfg(test)]
pub fn modules(v: &Variant) -> Vec<Composed> {
    let all = [setup(v), bin(v), opaque(v), keep(v, BuildStage::Count), keep(v, BuildStage::Scatter)];
    all.into_iter().map(Result::unwrap).collect()
}

fn text(variant: &Variant, files: &[&str]) -> Result<Composed> {
    let mut prelude = variant.prelude(1, 0);
    prelude.push_str(&format!("const MAX_BINS = {MAX_BINS}u;\n"));
    Composed::new(prelude, files)
}

fn setup(variant: &Variant) -> Result<Composed> {
    text(variant, &["common", "exact", "tiles/triangle", "tiles/setup", "tiles/clip"])
}

fn bin(variant: &Variant) -> Result<Composed> {
    text(variant, &["common", "exact", "tiles/triangle", "tiles/edges", "tiles/bin"])
}

fn opaque(variant: &Variant) -> Result<Composed> {
    text(variant, &[&WALK[..], &["tiles/opaque"]].concat())
}

fn keep(variant: &Variant, stage: BuildStage) -> Result<Composed> {
    let hidden = if variant.hides { "tiles/hidden" } else { "tiles/hidden_none" };
    let mut files = [&WALK[..], &["tiles/keep", hidden], &variant.nodes()].concat();
    match stage {
        BuildStage::Scatter => files.extend(["build/scatter", "build/write"]),
        _ => files.extend(["build/count", "build/read_none"]),
    }
    text(variant, &files)
}
