//! The shaders and pipelines of the tile rasteriser.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use rayon::{join, prelude::*};
use wgpu::ShaderStages;

#[cfg(test)]
use super::classes::classes_of;
use super::classes::{CLASS_COUNT, Class, Gather, Wanted, classes, constants, own_constants};
use crate::error::Result;
use crate::gpu::buffers::{Slot, layout};
use crate::gpu::compile::{compile, compute_uncleared, once};
use crate::gpu::device::Gpu;
use crate::gpu::variant::{BuildStage, Variant};
use crate::methods::Method;
#[cfg(test)]
use crate::methods::tests::some_methods;
use crate::shader::Composed;
use crate::threads::threads;

/// Bins of an image, at most: what workgroup memory holds masks for.
pub const MAX_BINS: u32 = 512;

/// Made at the first use.
pub struct Stages {
    pub setup_layout: wgpu::BindGroupLayout,
    pub bin_layout: wgpu::BindGroupLayout,
    pub walk_layout: wgpu::BindGroupLayout,
    pub opaque_layout: wgpu::BindGroupLayout,
    setup: OnceLock<Setup>,
    bin: OnceLock<Bin>,
    opaque: OnceLock<wgpu::ComputePipeline>,
    keep: [OnceLock<wgpu::ComputePipeline>; 2],
    pub start_layout: wgpu::BindGroupLayout,
    resolve_layouts: [wgpu::BindGroupLayout; 2],
    pub read_opaque_layout: wgpu::BindGroupLayout,
    pub stream_layout: wgpu::BindGroupLayout,
    /// By method and constants.
    stream: Mutex<HashMap<String, Arc<wgpu::ComputePipeline>>>,
    /// By what they leave, then by class.
    resolve: [[OnceLock<wgpu::ComputePipeline>; CLASS_COUNT]; 3],
}

/// What a resolve leaves of a pixel: its colour, and with it the number of its fragments, and with that the fragments.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Leaves {
    Color,
    Counts,
    Lists,
}

pub struct Setup {
    pub clear: wgpu::ComputePipeline,
    pub setup: wgpu::ComputePipeline,
    pub clip: wgpu::ComputePipeline,
}

pub struct Bin {
    pub count_bins: wgpu::ComputePipeline,
    pub offsets: wgpu::ComputePipeline,
    pub scatter_bins: wgpu::ComputePipeline,
    pub bin_tiles: wgpu::ComputePipeline,
    pub start: wgpu::ComputePipeline,
}

impl Stages {
    pub fn new(gpu: &Gpu) -> Self {
        use Slot::{Read, ReadWrite, Uniform};
        let of = |label: &str, uniforms: usize, read: usize, written: usize| {
            let slots = [vec![Uniform; uniforms], vec![Read; read], vec![ReadWrite; written]].concat();
            layout(gpu, label, ShaderStages::COMPUTE, &slots)
        };
        Self {
            setup_layout: of("tile setup", 2, 5, 9),
            bin_layout: of("tile binning", 2, 3, 8),
            walk_layout: of("tile walk", 2, 10, 0),
            opaque_layout: of("tile opaque", 0, 0, 2),
            setup: OnceLock::new(),
            bin: OnceLock::new(),
            opaque: OnceLock::new(),
            keep: Default::default(),
            start_layout: of("start", 0, 0, 1 + CLASS_COUNT),
            resolve_layouts: [0, 3].map(|lists| {
                let slots = [vec![ReadWrite; 5], vec![Slot::Color], vec![ReadWrite; lists]].concat();
                layout(gpu, "tile resolve", ShaderStages::COMPUTE, &slots)
            }),
            read_opaque_layout: of("opaque surfaces", 0, 2, 0),
            stream_layout: layout(
                gpu,
                "stream",
                ShaderStages::COMPUTE,
                &[ReadWrite, ReadWrite, ReadWrite, Uniform, Slot::Color],
            ),
            stream: Default::default(),
            resolve: Default::default(),
        }
    }

    /// Makes the pipelines of a frame side by side: a driver may take seconds for each.
    pub fn prepare(&self, gpu: &Gpu, variant: &Variant, leaves: Leaves, wanted: &Wanted) -> Result<()> {
        let is_made = self.setup.get().is_some() && self.bin.get().is_some();
        let made = self.made(leaves);
        let missing: Vec<_> = wanted.classes().filter(|&class| !made[class]).collect();
        if is_made && missing.is_empty() {
            return Ok(()); // no thread need wake
        }
        let ((setup, bin), (opaque, resolve)) = threads()?.install(|| {
            join(
                || join(|| self.setup(gpu, variant).map(drop), || self.bin(gpu, variant).map(drop)),
                || {
                    let opaque = || if variant.hides { self.opaque(gpu, variant).map(drop) } else { Ok(()) };
                    let resolve = |class| self.resolve(gpu, variant, leaves, class).map(drop);
                    join(opaque, || missing.into_par_iter().try_for_each(resolve))
                },
            )
        });
        setup.and(bin).and(opaque).and(resolve)
    }

    pub fn setup(&self, gpu: &Gpu, variant: &Variant) -> Result<&Setup> {
        once(gpu, &self.setup, || {
            let module = compile(gpu, "tile setup", &setup(variant)?)?;
            let of = |entry: &str| compute_uncleared(gpu, &module, entry, &[&self.setup_layout]);
            Ok(Setup { clear: of("cs_clear"), setup: of("cs_setup"), clip: of("cs_clip") })
        })
    }

    pub fn bin(&self, gpu: &Gpu, variant: &Variant) -> Result<&Bin> {
        once(gpu, &self.bin, || {
            let classes = classes(gpu);
            let module = compile(gpu, "tile binning", &bin(variant, &classes)?)?;
            let of = |entry: &str| compute_uncleared(gpu, &module, entry, &[&self.bin_layout]);
            Ok(Bin {
                count_bins: of("cs_count_bins"),
                offsets: of("cs_offsets"),
                scatter_bins: of("cs_scatter_bins"),
                bin_tiles: of("cs_bin_tiles"),
                start: {
                    let module = compile(gpu, "start", &start(&classes)?)?;
                    compute_uncleared(gpu, &module, "cs_start", &[&self.start_layout])
                },
            })
        })
    }

    pub fn opaque(&self, gpu: &Gpu, variant: &Variant) -> Result<&wgpu::ComputePipeline> {
        once(gpu, &self.opaque, || {
            let module = compile(gpu, "tile opaque", &opaque(variant)?)?;
            Ok(compute_uncleared(gpu, &module, "cs_opaque", &[&self.walk_layout, &self.opaque_layout]))
        })
    }

    /// Of group 1.
    pub fn resolve_layout(&self, leaves: Leaves) -> &wgpu::BindGroupLayout {
        &self.resolve_layouts[usize::from(leaves == Leaves::Lists)]
    }

    /// The classes whose pipelines are made.
    pub fn made(&self, leaves: Leaves) -> [bool; CLASS_COUNT] {
        std::array::from_fn(|class| self.resolve[leaves as usize][class].get().is_some())
    }

    /// Resolves tiles of a class, whose fragments are sorted as they are found.
    pub fn resolve(
        &self,
        gpu: &Gpu,
        variant: &Variant,
        leaves: Leaves,
        class: usize,
    ) -> Result<&wgpu::ComputePipeline> {
        once(gpu, &self.resolve[leaves as usize][class], || {
            let mut groups = vec![&self.walk_layout, self.resolve_layout(leaves)];
            if variant.hides {
                groups.push(&self.read_opaque_layout);
            }
            let module = compile(gpu, "tile resolve", &resolve(variant, &classes(gpu), class, leaves)?)?;
            Ok(compute_uncleared(gpu, &module, "cs_resolve", &groups))
        })
    }

    /// Streams fragments into a method.
    pub fn stream(
        &self,
        gpu: &Gpu,
        variant: &Variant,
        method: &Method,
    ) -> Result<Arc<wgpu::ComputePipeline>> {
        let text = if let Method::Own(own) = method { &own.wgsl } else { "" };
        let key = format!("{} {} {text}", method.id(), method.constants_text());
        let mut made = self.stream.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(pipeline) = made.get(&key) {
            return Ok(pipeline.clone());
        }
        let pipeline = gpu.checked("making pipelines", || {
            let module = compile(gpu, method.id(), &stream(variant, method)?)?;
            let mut groups = vec![&self.walk_layout, &self.stream_layout];
            if variant.hides {
                groups.push(&self.read_opaque_layout);
            }
            Ok(Arc::new(compute_uncleared(gpu, &module, "cs_stream", &groups)))
        })?;
        made.insert(key, pipeline.clone());
        Ok(pipeline)
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
                groups.push(&self.read_opaque_layout);
            }
            Ok(compute_uncleared(gpu, &module, "cs_keep", &groups))
        })
    }
}

const WALK: [&str; 6] = ["common", "exact", "tiles/triangle", "tiles/edges", "tiles/walk", "tiles/lists"];

/// Every module, for the tests that read them all.
#[cfg(test)]
pub fn modules(v: &Variant) -> Vec<Composed> {
    let classes = classes_of([2, 4, 8]);
    let all = [
        setup(v),
        bin(v, &classes),
        start(&classes),
        opaque(v),
        keep(v, BuildStage::Count),
        keep(v, BuildStage::Scatter),
        Composed::new(String::new(), &["common", "tiles/scene", "tiles/blending"]),
    ];
    let leaves = [Leaves::Color, Leaves::Counts, Leaves::Lists];
    let resolves = (0..CLASS_COUNT).map(|class| resolve(v, &classes, class, leaves[class % 3]));
    // Long, and the same for most variants.
    let resolves = resolves.filter(|_| v.tiles);
    let methods = some_methods();
    let streams = methods.iter().filter(|_| v.tiles).map(|method| stream(v, method));
    all.into_iter().chain(resolves).chain(streams).map(Result::unwrap).collect()
}

fn text(variant: &Variant, files: &[&str]) -> Result<Composed> {
    let mut prelude = variant.prelude(1, 0);
    prelude.push_str(&format!("const MAX_BINS = {MAX_BINS}u;\n"));
    Composed::new(prelude, files)
}

fn setup(variant: &Variant) -> Result<Composed> {
    text(
        variant,
        &[
            "common",
            "exact",
            "tiles/triangle",
            "tiles/edges",
            "tiles/scene",
            "tiles/setup",
            "tiles/planes",
            "tiles/clip",
        ],
    )
}

fn bin(variant: &Variant, classes: &[Class]) -> Result<Composed> {
    let files = [
        "common",
        "exact",
        "tiles/triangle",
        "tiles/edges",
        "sums",
        variant.sums_file(),
        "tiles/classes",
        "tiles/bin",
        "tiles/bin_chunks",
        "tiles/bin_tiles",
    ];
    let mut composed = text(variant, &files)?;
    composed.push(&constants(classes), "classes".into());
    Ok(composed)
}

fn start(classes: &[Class]) -> Result<Composed> {
    Composed::new(constants(classes), &["tiles/classes", "tiles/start"])
}

fn resolve(variant: &Variant, classes: &[Class], class: usize, leaves: Leaves) -> Result<Composed> {
    let own = classes[class];
    let mut files = vec![
        "common",
        "exact",
        "tiles/triangle",
        "tiles/edges",
        "tiles/walk",
        "tiles/classes",
        "tiles/resolve",
        match own.gather {
            Gather::Triangles => "tiles/gather_triangles",
            Gather::Masks => "tiles/gather_masks",
            Gather::Deep => "tiles/gather_deep",
            Gather::Staged => "tiles/gather_staged",
        },
        if variant.hides { "tiles/opaque_read" } else { "tiles/opaque_none" },
        if leaves == Leaves::Lists { "tiles/listed" } else { "tiles/listed_none" },
        if variant.subgroups { "tiles/widest_subgroup" } else { "tiles/widest" },
        "methods/exact",
    ];
    match own.gather {
        Gather::Triangles | Gather::Deep => {
            files.extend(["tiles/block", "tiles/places", "tiles/composite_taken"])
        }
        Gather::Masks => files.push("tiles/composite_taken"),
        Gather::Staged => files.push("tiles/composite_staged"),
    }
    let mut composed = text(variant, &files)?;
    if let Some(sort) = own.sort() {
        composed.push(&sort, "sort".into());
    }
    let counts = format!("const COUNTS = {};\n", leaves != Leaves::Color);
    composed.push(&(constants(classes) + &own_constants(classes, class) + &counts), "classes".into());
    Ok(composed)
}

fn opaque(variant: &Variant) -> Result<Composed> {
    text(variant, &[&WALK[..], &["tiles/opaque"]].concat())
}

fn stream(variant: &Variant, method: &Method) -> Result<Composed> {
    let (id, common, constants) = (method.id(), method.common(), method.constants_text());
    let hidden = if variant.hides {
        &["tiles/opaque_read", "tiles/hidden"][..]
    } else {
        &["tiles/opaque_none", "tiles/hidden_none"]
    };
    let file = format!("methods/{id}");
    let mut files = [&WALK[..], &["methods/common/fragment", "tiles/stream"], hidden, common].concat();
    if !matches!(method, Method::Own(_)) {
        files.extend([variant.affine_file(), &file]);
    }
    let mut composed = text(variant, &files)?;
    composed.push(&constants, "parameters".into());
    if let Method::Own(own) = method {
        composed.push_foreign(&own.wgsl, &own.id);
    }
    Ok(composed)
}

fn keep(variant: &Variant, stage: BuildStage) -> Result<Composed> {
    let mut files = [&WALK[..], &["tiles/keep"], &variant.nodes()].concat();
    files.extend(if variant.hides {
        &["tiles/opaque_read", "tiles/hidden"][..]
    } else {
        &["tiles/hidden_none"]
    });
    match stage {
        BuildStage::Scatter => files.extend(["build/scatter", "build/write"]),
        _ => files.extend(["build/count", "build/read_none"]),
    }
    text(variant, &files)
}
