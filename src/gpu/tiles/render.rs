//! A render whose fragments never leave a tile.

use std::time::Instant;

use wgpu::BufferUsages;

use super::bins::Counted;
use super::classes::{CLASS_COUNT, CLASS_NAMES};
use super::image::{Canvas, Found};
use super::{Context, is_enough};
use crate::camera::Camera;
use crate::error::Result;
use crate::fragments::Background;
use crate::frame::{Lists, Output, Request, Stats, allocate};
use crate::gpu::buffers::with_contents;
use crate::gpu::device::Gpu;
use crate::gpu::plan;
use crate::gpu::pool::{DEFAULT_MEMORY, Rect};
use crate::gpu::resolve::TILE;
use crate::gpu::targets::{Targets, place};
use crate::gpu::upload::Uploaded;
use crate::gpu::variant::Variant;
use crate::gpu::view::{eye_uniform, view_uniform};
use crate::resolve::Resolve;
use crate::scene::Scene;
use crate::threads::threads;

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
    let uploaded = Uploaded::new(gpu, scene)?;
    let depths = threads()?.install(|| camera.depth_extent(scene));
    let center = camera.center(depths);
    let rows = camera.clip_rows(center);
    let pipelines = gpu.pipelines(&variant);
    let (view, targets) = gpu.checked("the view", || {
        let uniform = view_uniform(camera, &rows, depths, request, background);
        let view = with_contents(gpu, "view", BufferUsages::UNIFORM, &[uniform]);
        Ok((view, Targets::new(gpu, &variant, (width, height), background)?))
    })?;
    let of = Context { gpu, pipelines: &pipelines, view: &view };
    let eye = eye_uniform(camera, &rows, center, (width, height));
    let mut canvas = Canvas::new(of, &uploaded, (width, height), wants_counts, memory)?;
    stats.stage("upload", clock);

    let Some(found) = canvas.render(of, &uploaded, eye, &targets.background, wants_counts, memory)? else {
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
    stats.bytes.push(("geometry", uploaded.bytes));
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
