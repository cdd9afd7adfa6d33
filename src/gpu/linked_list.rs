//! The pipelines `linked_list` (GPU Pro 2, chapter III.2) and `prefix_sum`: opaque geometry into depth and colour,
//! translucent geometry into per-pixel lists, lists into an image.
//!
//! The pool of nodes is never guessed. The counter of the build runs past its capacity, so that one pass tells the
//! exact demand; what did not fit is rendered again in a larger pool or, past `memory` or the device's limits, in
//! bands that are cut by the exact number of fragments in each pixel.

use std::time::Instant;

use wgpu::BufferUsages;

use super::background;
use super::buffers::with_contents;
use super::device::Gpu;
use super::extent::Viewpoint;
use super::fill::{Filled, Way};
use super::geometry::{self, Geometry};
use super::kept::Kept;
use super::lists::Reader;
use super::passes::{Frame, Raster};
use super::plan;
use super::pool::{Budget, DEFAULT_MEMORY, Pool};
use super::rect::Rect;
use super::resolve::{Outcome, TILE};
use super::targets::Targets;
use super::tiles::{self, Walker};
use super::variant::Variant;
use super::view::{eye_uniform, view_uniform};
use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::fragments::{Background, Fragments};
use crate::frame::{Lists, Output, Request, Stats, Storage};
use crate::memory::allocate;
use crate::node_format::DepthCodes;
use crate::scene::Scene;
use crate::threads::threads;

pub fn render(
    kept: &mut Kept,
    scene: &Scene,
    camera: &Camera,
    request: &Request,
    background: Background<f32>,
) -> Result<Output<f32>> {
    let gpu = &kept.gpu.clone();
    let (width, height) = (request.width, request.height);
    let variant = plan::variant(gpu, scene, request)?;
    let mut stats = Stats { device: gpu.adapter.name.clone(), ..Stats::default() };
    plan::describe(&variant, scene, request, &mut stats);
    let budget = Budget::of(gpu, &variant, request.memory.unwrap_or(DEFAULT_MEMORY));

    let clock = Instant::now();
    let (mut frame, codes, rect) =
        upload((gpu, kept), &variant, (scene, camera), request, &background, &budget, &mut stats)?;
    stats.rejected_triangles = frame.raster.rejected();
    plan::describe_rect(rect, request, &mut stats);
    stats.stage("upload", clock);
    frame.draw_opaque(&mut stats)?;

    let each = request.image_samples();
    let mut output = Output {
        // Poisoned: a pixel that nothing writes would show.
        image: allocate("the image", request.pixels() * each, [f32::NAN; 4])?,
        counts: (request.lists != Lists::None)
            .then(|| allocate("counts", request.pixels(), -1))
            .transpose()?,
        background: None,
        fragments: None,
        stats,
    };
    let wants_lists = matches!(request.lists, Lists::Translucent | Lists::All);
    // Where nothing is listed opaque surfaces are all that shows; lists are composited over them again.
    let whole = Rect { x0: 0, y0: 0, w: width, h: height };
    let behind = (variant.hides && (wants_lists || rect != Some(whole)))
        .then(|| background::read(&frame, &budget, request))
        .transpose()?;
    match &behind {
        Some(colors) => {
            let samples = request.samples as usize;
            background::fill_outside(&mut output, request, |pixel, s| colors[pixel * samples + s], rect)?;
        }
        None => background::fill_outside(&mut output, request, |pixel, _| background.at(pixel), rect)?,
    }
    output.background = behind.filter(|_| wants_lists);
    // The device counts the pieces of a cut triangle apart: then it takes the lists to count.
    let pieces = matches!(&frame.raster, Raster::Hardware(g) if request.samples > 1 && g.found.listed.is_cut);
    let reader = (wants_lists || (pieces && request.lists == Lists::Count)).then_some(Reader {
        gpu,
        layout: variant.layout,
        storage: variant.storage,
        codes,
    });

    let mut band_lists = Vec::new();
    let pool_key = (variant.clone(), budget.memory);
    let mut pool: Option<Pool> = None;
    let mut outcome = Outcome::default();
    let expected = match &frame.raster {
        Raster::Hardware(geometry) => geometry.found.listed.nodes(),
        Raster::Tiles(_) => 0, // they are counted first
    };
    let mut draws = 0;
    let contiguous = variant.storage == Storage::Contiguous;
    rect.map_or(Ok(()), |rect| budget.check(rect))?;
    // Rectangles to do, and the nodes that each is known to need.
    let bands = match &frame.raster {
        Raster::Hardware(_) => vec![0],
        Raster::Tiles(walker) => walker.bands(),
    };
    let cut = rect.map_or(vec![], |rect| rect.cut(&bands));
    let mut waiting: Vec<(Rect, Option<u64>)> =
        cut.into_iter().flat_map(|rect| rect.parts(budget.pixels)).map(|r| (r, None)).collect();
    let parts = waiting.len();
    while let Some((rect, known)) = waiting.pop() {
        frame.turn_to(rect.y0)?;
        // Of several parts nobody knows yet how much is where.
        let wanted = known.unwrap_or(if parts > 1 { expected.min(budget.nodes) } else { expected });
        let mut fresh = match pool.take() {
            Some(pool) if pool.pixels >= rect.pixels() => pool,
            _ => kept.pool.take_if(
                &pool_key,
                |pool| pool.pixels >= rect.pixels(),
                || Pool::new(gpu, &variant, rect.pixels(), 1),
            )?,
        };
        let way = match (contiguous, !variant.tiles && budget.appends(wanted.max(fresh.capacity))) {
            (false, _) => Way::Link,
            (true, true) => Way::Append,
            (true, false) => Way::Scatter,
        };
        // What is scattered is counted first. What is more than fits is counted too, and cut.
        draws = draws.max(if way == Way::Scatter { 2 } else { 1 });
        let filled = if way != Way::Scatter && wanted > budget.nodes {
            Filled::Overflow { nodes: wanted }
        } else {
            if way != Way::Scatter {
                fresh.grow(gpu, wanted)?;
            }
            frame.fill_and_resolve(way, &mut fresh, &budget, rect, &mut output)?
        };
        let pool = pool.insert(fresh);
        match filled {
            Filled::Done { nodes, outcome: own } => {
                output.stats.fragments += nodes;
                output.stats.bands += 1;
                outcome.join(&own);
                if let Some(reader) = &reader {
                    band_lists.push(reader.read(pool, rect, nodes)?);
                }
            }
            Filled::Overflow { nodes } if nodes <= budget.nodes => waiting.push((rect, Some(nodes))),
            Filled::Overflow { .. } => {
                draws = 2;
                let counts = frame.count(pool, rect, &mut output.stats)?;
                let bands = budget.bands(rect, &counts)?;
                if known.is_some() {
                    return Err(Error::Device(format!(
                        "{} counts other fragments than it stores: its driver is at fault; device=\"cpu\" works",
                        gpu.adapter.name
                    )));
                }
                waiting.extend(bands.into_iter().map(|(rect, nodes)| (rect, Some(nodes))));
            }
        }
    }
    output.stats.bands = output.stats.bands.max(1);
    output.stats.dropped_fragments = outcome.dropped;
    output.stats.max_depth_complexity = Some(outcome.longest);
    plan::describe_outcome(&variant, request, &outcome, draws, &mut output.stats);
    if pieces && reader.is_none() {
        plan::describe_pieces(&mut output.stats);
    }

    let clock = Instant::now();
    if let Some(reader) = &reader {
        let lists = reader.assemble(band_lists, width, height)?;
        if pieces {
            recount(&lists, &mut output);
        }
        output.fragments = wants_lists.then_some(lists);
        output.stats.stage("lists", clock);
    }
    let bytes = &mut output.stats.bytes;
    bytes.extend(frame.raster.bytes());
    bytes.extend(pool.iter().flat_map(Pool::bytes));
    bytes.push(("targets", frame.targets.bytes));
    if let Some(pool) = pool {
        kept.pool.put(pool_key, pool);
    }
    if let Raster::Tiles(walker) = frame.raster {
        walker.leave(kept, &variant);
    }
    Ok(output)
}

/// Counts again what the lists hold.
fn recount(lists: &Fragments<f32>, output: &mut Output<f32>) {
    let counts: Vec<i32> = lists.offsets.windows(2).map(|w| (w[1] - w[0]) as i32).collect();
    output.stats.fragments = lists.color.len() as u64;
    output.stats.max_depth_complexity = counts.iter().max().map(|&n| n as u32);
    output.counts = Some(counts);
}

/// Brings the scene to the device. Also gives the codes of depths, and the rectangle that lists are made for.
fn upload<'g>(
    (gpu, kept): (&'g Gpu, &mut Kept),
    variant: &Variant,
    (scene, camera): (&Scene, &Camera),
    request: &Request,
    background: &Background<f32>,
    budget: &Budget,
    stats: &mut Stats,
) -> Result<(Frame<'g>, DepthCodes, Option<Rect>)> {
    let (width, height) = (request.width, request.height);
    let pipelines = gpu.pipelines(variant);
    gpu.checked("uploading the scene", || {
        let depths = threads()?.install(|| camera.depth_extent(scene));
        let center = camera.center(depths);
        let rows = camera.clip_rows(center);
        let mut uniform = view_uniform(camera, &rows, depths, request, background);
        let view = with_contents(gpu, "view", BufferUsages::UNIFORM, &[uniform]);
        if variant.tiles {
            let eye = eye_uniform(camera, &rows, center, (width, height));
            let of = tiles::Context { gpu, pipelines: &pipelines, view: &view };
            plan::describe_upload(kept.is_kept, stats);
            let scene = kept.scene(scene)?;
            let add_time = |stage, ms| stats.add(stage, ms);
            let walker = Walker::new(of, (kept, scene), eye, (width, height), budget.memory, add_time)?;
            let rect = walker.counted.rect;
            let frame = Frame {
                gpu,
                targets: Targets::new(gpu, variant, (width, height), background)?,
                pipelines: pipelines.clone(),
                raster: Raster::Tiles(Box::new(walker)),
                view,
                width,
                scratch: budget.scratch,
            };
            let codes = DepthCodes::new((0.0, 1.0), None, rows.perspective);
            return Ok((frame, codes, rect.map(|rect| aligned(rect, width, height))));
        }
        let eye = geometry::Eye {
            rows: &rows,
            center,
            viewpoint: Viewpoint::new(camera, &rows, (width, height), request.samples > 1),
            list_opaque: request.lists == Lists::All,
        };
        let geometry = Geometry::upload(gpu, &pipelines.layouts.geometry, scene, &eye, &view)?;
        let found = &geometry.found;
        let last_code = variant.layout.format.last_code();
        let codes = DepthCodes::new(found.listed.values(), last_code, rows.perspective);
        (uniform.code_origin, uniform.code_scale, uniform.code_step) =
            (codes.origin, codes.scale, codes.step);
        gpu.queue.write_buffer(&view, 0, bytemuck::bytes_of(&uniform));
        let rect = found.listed.rect(width, height).map(|rect| aligned(rect, width, height));
        Ok((
            Frame {
                gpu,
                targets: Targets::new(gpu, variant, (width, height), background)?,
                pipelines: pipelines.clone(),
                raster: Raster::Hardware(geometry),
                view,
                width,
                scratch: budget.scratch,
            },
            codes,
            rect,
        ))
    })
}

/// Grown to whole tiles.
fn aligned(rect: Rect, width: u32, height: u32) -> Rect {
    let (x0, y0) = (rect.x0 / TILE * TILE, rect.y0 / TILE * TILE);
    let end = |start: u32, length: u32, most: u32| (start + length).next_multiple_of(TILE).min(most);
    Rect { x0, y0, w: end(rect.x0, rect.w, width) - x0, h: end(rect.y0, rect.h, height) - y0 }
}
