//! A render whose fragments never leave a tile.

use std::time::Instant;

use super::bins::Counted;
use super::classes::{CLASS_COUNT, CLASS_NAMES};
use super::image::{Canvas, Found};
use super::is_enough;
use super::ready::Ready;
use crate::camera::Camera;
use crate::error::Result;
use crate::fragments::Background;
use crate::frame::{Lists, Output, Request, Stats, allocate};
use crate::gpu::device::Gpu;
use crate::gpu::plan;
use crate::gpu::pool::{DEFAULT_MEMORY, Rect};
use crate::gpu::resolve::TILE;
use crate::gpu::targets::place;
use crate::gpu::variant::Variant;
use crate::resolve::Resolve;
use crate::scene::Scene;

/// Renders, or leaves it to the stages that keep lists: `None` where something asks for those, or a pixel is too deep.
pub fn render(
    gpu: &Gpu,
    scene: &Scene,
    camera: &Camera,
    request: &Request,
    background: &Background<f32>,
) -> Result<Option<Output<f32>>> {
    let variant = plan::variant(gpu, scene, request)?;
    if !is_enough(gpu, &variant, request) {
        return Ok(None);
    }
    let (width, height) = (request.width, request.height);
    let memory = request.memory.unwrap_or(DEFAULT_MEMORY);
    if 16 * request.pixels() as u64 > gpu.adapter.max_binding {
        return Ok(None); // an image in parts is what lists have
    }
    let mut stats = Stats { device: gpu.adapter.name.clone(), ..Stats::default() };
    let wants_counts = request.lists == Lists::Count;
    let clock = Instant::now();
    let ready = Ready::new(gpu, &variant, (scene, camera), request, background)?;
    let mut canvas = Canvas::new(&ready, wants_counts, memory)?;
    stats.stage("upload", clock);

    let Some(found) = canvas.render(&ready, wants_counts, memory)? else {
        return Ok(None);
    };
    let mut image = allocate("the image", request.pixels(), [f32::NAN; 4])?;
    let whole = Rect { x0: 0, y0: 0, w: width, h: height };
    place(&found.image, &mut image, width, whole, 1);
    let counts = match &found.counts {
        Some(words) => {
            let mut counts = allocate("counts", request.pixels(), -1)?;
            place(words, &mut counts, width, whole, 1);
            Some(counts)
        }
        None => None,
    };
    describe(&variant, scene, request, &found, &mut stats);
    stats.bytes = canvas.bytes();
    stats.bytes.push(("geometry", ready.scene.bytes));
    Ok(Some(Output { image, counts, background: None, fragments: None, stats }))
}

fn describe(variant: &Variant, scene: &Scene, request: &Request, found: &Found, stats: &mut Stats) {
    found.times.iter().for_each(|(stage, ms)| stats.add(stage.clone(), *ms));
    stats.gpu_ms = found.gpu_ms;
    stats.rejected_triangles = found.counted.rejected;
    stats.fragments = found.fragments;
    stats.max_depth_complexity = Some(found.deepest);
    stats.bands = found.bands;
    stats.choose("samples", "1", "no masks");
    Resolve::of(request, scene).describe(scene, "known from the triangle", stats);
    stats.choose("lists", "none", "each tile's fragments are sorted in registers");
    if variant.hides {
        stats.choose("opaque geometry", "walked first", "the nearest of each pixel hides what is behind it");
    }
    plan::describe_rect(found.counted.rect, request, stats);
    let tiles = request.width.div_ceil(TILE) * request.height.div_ceil(TILE);
    stats.choose(
        "tiles",
        format!("{} of {tiles} hold translucent geometry", found.filled_tiles),
        format!("{TILE}×{TILE} pixels each"),
    );
    let used: Vec<_> = (0..CLASS_COUNT).filter(|&c| found.parts[c] > 0).map(|c| CLASS_NAMES[c]).collect();
    let Counted { longest, entries, .. } = found.counted;
    let why = format!("{entries} triangles in all tiles together, {longest} at most in one");
    stats.choose("tile classes", used.join(", "), why);
}
