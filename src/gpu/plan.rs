//! What a render is specialised for, and why, in words: a scene that does not need a thing pays neither bits nor
//! passes for it.

use super::device::Gpu;
use super::rect::Rect;
use super::resolve::{Outcome, TILE, class_name};
use super::variant::{ColorsOf, Variant};
use crate::error::{Error, Result};
use crate::frame::{LimitPolicy, Lists, Rasteriser, Request, Stats, Storage};
use crate::node_format::{NodeFormat, NodeLayout};
use crate::resolve::Resolve;
use crate::scene::{Rate, Scene};
use crate::shader::{has_loop, user_blend};

/// Measured: an H100 sorts lists of 33 to 64 four times faster by a network than by insertion. A software driver gains
/// nothing from 17 on, and takes seconds to compile the longer ones.
const UNROLLED_ON_GPU: u32 = 64;
const UNROLLED_ON_CPU: u32 = 16;

/// Checks what the device can do, and chooses the rest.
pub fn variant(gpu: &Gpu, scene: &Scene, request: &Request) -> Result<Variant> {
    let name = &gpu.adapter.name;
    let limit = gpu.limits.max_texture_dimension_2d;
    let tiles = request.lists_on_gpu.rasteriser == Rasteriser::Tiles;
    if request.width.max(request.height) > limit && !tiles {
        return Err(Error::Unsupported(format!(
            "{name} renders up to {limit} pixels a side, got {}×{}; device=\"cpu\" renders up to 16384",
            request.width, request.height
        )));
    }
    if !gpu.adapter.samples.contains(&request.samples) && !tiles {
        return Err(Error::Unsupported(format!(
            "{name} has no {} samples a pixel: it has {:?}; device=\"cpu\" has 1, 2, 4, 8 and 16",
            request.samples, gpu.adapter.samples
        )));
    }
    let options = &request.lists_on_gpu;
    let hides = scene.has_opaque() && request.lists != Lists::All;
    // A stencil beside depth is a feature; where the shader compares depths the two are apart.
    let stencil_apart = options.fullscreen && hides && !gpu.has(wgpu::Features::DEPTH32FLOAT_STENCIL8);
    let blends = options.blends.iter().enumerate();
    let blends = blends.map(|(i, (name, text))| user_blend(i, name, text)).collect::<Result<Vec<_>>>()?;
    if gpu.adapter.is_software() && blends.iter().any(|blend| has_loop(blend)) {
        return Err(Error::Unsupported(format!(
            "a Blend with a loop is not for {name}: software drivers may end loops early, and silently; write the loop \
             out, or use the CPU"
        )));
    }
    let wants_lists = matches!(request.lists, Lists::Translucent | Lists::All);
    // Counts with samples too: the pieces of a cut triangle are told by their primitive.
    let counts_pieces = request.lists == Lists::Count && request.samples > 1;
    let limits_pieces = request.limit.is_some() && request.samples > 1;
    let by_order = limits_pieces || matches!(request.limit, Some((_, LimitPolicy::LastSubmitted)));
    let wants_order = wants_lists || counts_pieces || by_order;
    let layout = NodeLayout::new(options.format, request.samples, scene.mixes_modes(), wants_order);
    let triangles = scene.triangle_count();
    if triangles > layout.most_triangles() {
        return Err(Error::Unsupported(format!(
            "{triangles} triangles given; with blend modes beside them nodes number up to {}",
            layout.most_triangles()
        )));
    }
    let rates: Vec<_> = scene.meshes.iter().filter(|m| m.face_count() > 0).map(|m| m.colors.rate).collect();
    let colors = if !tiles || rates.iter().any(|r| matches!(r, Rate::Vertex | Rate::Corner)) {
        ColorsOf::Corners
    } else if rates.iter().all(|r| *r == Rate::Face) {
        ColorsOf::Triangle
    } else {
        ColorsOf::Flat
    };
    Ok(Variant {
        colors,
        tiles,
        // Measured: Mesa's software drivers round every quotient to the nearest, NVIDIA's GPUs 70 % of them.
        divides_exactly: gpu.adapter.is_software(),
        storage: options.storage,
        layout,
        hides,
        msaa: request.msaa_resolve,
        sort: request.sort,
        limit: request.limit,
        order: request.blend_order,
        classes: options.classes.clone(),
        fullscreen: options.fullscreen,
        blends: blends.into(),
        early: gpu.has(wgpu::Features::SHADER_EARLY_DEPTH_TEST) && !stencil_apart,
        subgroups: gpu.has(wgpu::Features::SUBGROUP),
        longest_unrolled: if gpu.adapter.is_software() { UNROLLED_ON_CPU } else { UNROLLED_ON_GPU },
    })
}

/// Where the geometry came from.
pub fn describe_upload(is_kept: bool, stats: &mut Stats) {
    if is_kept {
        stats.choose("geometry", "kept", "an earlier frame brought it to the device");
    }
}

/// What is known before anything is drawn.
pub fn describe(variant: &Variant, scene: &Scene, request: &Request, stats: &mut Stats) {
    let layout = &variant.layout;
    let samples = request.samples;
    stats.choose(
        "samples",
        samples.to_string(),
        match (samples, layout.has_coverage) {
            (1, _) => "no coverage bits",
            (_, true) => "a word of coverage in each node",
            (_, false) => "coverage in the spare bits of depth",
        },
    );
    let ids = match (layout.mixed, layout.has_order) {
        (false, _) => "no mode ids",
        (true, true) => "mode ids beside the primitive",
        (true, false) => "mode ids in the spare bits of depth",
    };
    Resolve::of(request, scene).describe(scene, ids, stats);
    let bytes = layout.bytes();
    let holds = match (layout.format, layout.has_order) {
        (NodeFormat::Float32, _) => "nothing is lost",
        (_, true) => "with the primitive, for lists, limits or modes",
        (_, false) => "no primitive: fragments at one depth code go by colour",
    };
    stats.choose("node format", format!("{}, {bytes} bytes", layout.format.name()), holds);
    let storage = match variant.storage {
        Storage::Contiguous => ("contiguous", "a pixel's fragments side by side"),
        Storage::Linked if variant.aggregates() => {
            ("linked", "one atomic addition a subgroup hands out nodes")
        }
        Storage::Linked => ("linked", "one atomic addition a fragment hands out nodes"),
    };
    stats.choose("lists", storage.0, storage.1);
    let opaque = match (variant.hides, samples, variant.early) {
        (false, ..) => ("none", "no depth target, no depth test"),
        (true, 1, true) => ("depth test", "forced before the shader"),
        (true, 1, false) => ("compared", "in the shader: no early test can be forced here"),
        (true, ..) => ("compared", "in the shader, for each sample"),
    };
    stats.choose("opaque geometry", opaque.0, opaque.1);
    let resolve = match (variant.fullscreen, variant.counts_in_stencil(), variant.early) {
        (false, ..) => ("dispatches", "indirect, a pipeline for each class of list lengths"),
        (true, true, true) => ("full-screen passes", "as asked; a stencil keeps empty pixels away"),
        (true, true, false) => {
            ("full-screen passes", "as asked; the stencil test cannot be forced before the shader")
        }
        (true, false, _) => ("full-screen passes", "as asked; no stencil goes with several samples"),
    };
    stats.choose("resolve", resolve.0, resolve.1);
}

/// Where there is anything to do.
pub fn describe_rect(rect: Option<Rect>, request: &Request, stats: &mut Stats) {
    let (choice, why) = match rect {
        None => ("none".into(), "nothing translucent is in view"),
        Some(r) if (r.w, r.h) == (request.width, request.height) => {
            (format!("0..{} × 0..{}", r.w, r.h), "the whole image")
        }
        Some(r) => (
            format!("{}..{} × {}..{}", r.x0, r.x0 + r.w, r.y0, r.y0 + r.h),
            "where geometry lands; elsewhere is background",
        ),
    };
    stats.choose("rectangle", choice, why);
}

/// What was found.
/// `draws`: passes over the translucent geometry, of the rectangle that took most.
pub fn describe_outcome(
    variant: &Variant,
    request: &Request,
    outcome: &Outcome,
    draws: u32,
    stats: &mut Stats,
) {
    let whole = u64::from(request.width.div_ceil(TILE)) * u64::from(request.height.div_ceil(TILE));
    // Bands may cut tiles, whose parts count apart.
    let filled = outcome.filled_tiles.min(whole);
    stats.choose(
        "tiles",
        format!("{filled} of {whole} hold translucent geometry"),
        format!("{TILE}×{TILE} pixels each; empty pixels are not resolved"),
    );
    let used: Vec<_> = (outcome.totals.iter().enumerate())
        .filter(|(_, pixels)| **pixels > 0)
        .map(|(class, _)| class_name(variant, class))
        .collect();
    let longest = format!("longest list {}", outcome.longest);
    stats.choose("resolve classes", if used.is_empty() { "none".into() } else { used.join(", ") }, longest);
    let why = match (draws, variant.storage) {
        (2.., _) if variant.tiles => "counted, then scattered: nodes are held once",
        (0, _) => "nothing translucent is in view",
        (1, Storage::Linked) => "fragments are linked as they come",
        (1, Storage::Contiguous) => "appended, then gathered: nodes fit memory twice",
        (_, Storage::Linked) => "counted first, to cut bands by",
        (_, Storage::Contiguous) => "counted, then scattered: nodes do not fit memory twice",
    };
    stats.choose("passes over geometry", draws.to_string(), why);
    if let Some((n, policy)) = request.limit {
        let kept = match policy {
            LimitPolicy::Nearest => "the nearest",
            LimitPolicy::LastSubmitted => "the last submitted",
        };
        let ignored = format!("{} fragments beyond that are ignored", outcome.dropped);
        stats.choose("limit", format!("{kept} {n} of a pixel"), ignored);
    }
}

/// Notes what numbers mean where pieces of triangles were counted.
pub fn describe_pieces(stats: &mut Stats) {
    stats.max_depth_complexity = None; // counting whole fragments would cost the lists
    stats.choose(
        "fragments",
        format!("{} or fewer", stats.fragments),
        "pieces of triangles that the view cuts count apart: fragments=\"count\" counts whole ones",
    );
}
