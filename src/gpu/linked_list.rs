//! The `linked_list` pipeline (GPU Pro 2, chapter III.2): opaque geometry into depth and colour, translucent
//! geometry into per-pixel lists, lists into an image.
//!
//! The pool of nodes is never guessed. The counter of the build runs past its capacity, so that one pass
//! tells the exact demand; what did not fit is rendered again in a larger pool or, past `memory` or the
//! device's limits, in two halves of its rectangle, down to a pixel.

use std::time::Instant;

use wgpu::BufferUsages;

use super::buffers::with_contents;
use super::device::Gpu;
use super::geometry::Geometry;
use super::lists::{BandLists, assemble};
use super::passes::Frame;
use super::pipelines::{COLOR_FORMAT, DEPTH_FORMAT};
use super::pool::{Budget, DEFAULT_MEMORY, Pool, first_rects};
use super::targets::{read_texture, texture, write_texture};
use super::uniforms::View;
use crate::camera::{Camera, ClipRows};
use crate::error::{Error, Result};
use crate::fragments::Background;
use crate::frame::{Lists, Output, Request, Stats, allocate};
use crate::scene::Scene;
use crate::threads::threads;

pub fn render(
    gpu: &Gpu,
    scene: &Scene,
    camera: &Camera,
    request: &Request,
    background: Background<f32>,
) -> Result<Output<f32>> {
    let (width, height) = (request.width, request.height);
    let limit = gpu.limits.max_texture_dimension_2d;
    if width.max(height) > limit {
        return Err(Error::Unsupported(format!(
            "{} renders up to {limit} pixels a side, got {width}×{height}; device=\"cpu\" renders up to 16384",
            gpu.adapter.name
        )));
    }
    let pipelines = gpu.pipelines()?;
    let hides = scene.has_opaque() && request.lists != Lists::All;
    let mut stats = Stats { device: gpu.adapter.name.clone(), ..Stats::default() };
    let budget = Budget::of(gpu, request.memory.unwrap_or(DEFAULT_MEMORY));

    let clock = Instant::now();
    let frame = gpu.checked("uploading the scene", || {
        let depths = threads()?.install(|| camera.depth_extent(scene));
        let center = camera.center(depths);
        let rows = camera.clip_rows(center);
        let view = view_uniform(camera, &rows, depths, request, &background);
        let view = with_contents(gpu, "view", BufferUsages::UNIFORM, &[view]);
        let geometry = Geometry::upload(gpu, pipelines, scene, &rows, center, &view)?;
        let background_is_texture = hides || matches!(background, Background::Image(_));
        let (w, h) = if background_is_texture { (width, height) } else { (1, 1) };
        let color = texture(gpu, "background", COLOR_FORMAT, w, h);
        if let Background::Image(pixels) = background {
            write_texture(gpu, &color, pixels, width, height);
        }
        Ok(Frame {
            gpu,
            pipelines,
            geometry,
            view,
            depth: texture(gpu, "depth", DEPTH_FORMAT, width, height).create_view(&Default::default()),
            background: color.create_view(&Default::default()),
            background_is_texture,
            width,
            scratch: budget.scratch,
        })
    })?;
    stats.rejected_triangles = frame.geometry.rejected;
    stats.stage("upload", clock);

    let constant = match background {
        Background::Constant(c) => Some(c),
        Background::Image(_) => None,
    };
    frame.draw_opaque(hides, constant, &mut stats)?;

    let mut output = Output {
        // Poisoned: a pixel that no rectangle writes would show.
        image: allocate("the image", request.pixels(), [f32::NAN; 4])?,
        counts: (request.lists != Lists::None)
            .then(|| allocate("counts", request.pixels(), -1))
            .transpose()?,
        background: None,
        fragments: None,
        stats,
    };
    let mut band_lists = Vec::new();
    let mut pool: Option<Pool> = None;
    let mut waiting = first_rects(width, height, budget.pixels);
    while let Some(rect) = waiting.pop() {
        let wanted = (4 * rect.pixels()).max(4096).min(budget.nodes);
        let fresh = match pool.take() {
            Some(pool) if pool.pixels >= rect.pixels() => pool,
            old => Pool::new(gpu, rect.pixels(), old.map_or(wanted, |p| p.capacity.max(wanted)))?,
        };
        let pool = pool.insert(fresh);
        let demand = frame.fill_and_resolve(pool, rect, &mut output)?;
        if demand <= pool.capacity {
            output.stats.fragments += demand;
            output.stats.bands += 1;
            if matches!(request.lists, Lists::Translucent | Lists::All) {
                band_lists.push(BandLists::read(gpu, pool, rect, demand, camera.is_perspective())?);
            }
        } else if demand <= budget.nodes {
            *pool = Pool::new(gpu, pool.pixels, demand)?;
            waiting.push(rect);
        } else {
            let halves = rect.halves().ok_or_else(|| budget.exceeded(rect, demand))?;
            waiting.extend(halves.into_iter().rev());
        }
    }
    let clock = Instant::now();
    if !band_lists.is_empty() {
        output.fragments = Some(assemble(band_lists, width, height)?);
        output.stats.stage("lists", clock);
        if hides {
            output.background = Some(read_texture(gpu, frame.background.texture())?);
        }
    }
    if let Some(counts) = &output.counts {
        output.stats.max_depth_complexity = counts.iter().max().map(|&n| n as u32);
    }
    let bytes = &mut output.stats.bytes;
    bytes.push(("geometry", frame.geometry.bytes));
    bytes.push(("pool", pool.as_ref().map_or(0, Pool::bytes)));
    let pixel_bytes = 4 + if frame.background_is_texture { 16 } else { 0 };
    bytes.push((
        "targets",
        pixel_bytes * request.pixels() as u64 + pool.as_ref().map_or(0, |p| 48 * p.pixels),
    ));
    Ok(output)
}

fn view_uniform(
    camera: &Camera,
    rows: &ClipRows,
    (low, high): (f64, f64),
    request: &Request,
    background: &Background<f32>,
) -> View {
    let (near, far) = camera.depth_range();
    let perspective = camera.is_perspective();
    // Window z of a parallel view spans the scene, with room for rounding.
    let (low, high) = (low.max(near), high.min(far).max(low.max(near)));
    let room = 1e-5 * (high - low).max(low.abs()).max(high.abs()).max(f64::MIN_POSITIVE);
    let scale = 1.0 / (high - low + 2.0 * room);
    // The shader compares rounded depths: what lies exactly at near or far is kept.
    let slack = 2f64.powi(-21);
    let beside = |depth: f64, sign: f64| depth + sign * slack * depth.abs();
    let (near, far) = if perspective {
        (near, (1.0 - slack) / far) // the least 1/w; the hardware clips at near
    } else {
        (beside(near, -1.0), beside(far, 1.0))
    };
    View {
        rows: [rows.x, rows.y, rows.w, rows.depth].map(|r| r.as_vec4().to_array()),
        background: match background {
            Background::Constant(c) => *c,
            Background::Image(_) => [0.0; 4],
        },
        width: request.width,
        height: request.height,
        perspective: u32::from(perspective),
        list_opaque: u32::from(request.lists == Lists::All),
        near: near as f32,
        far: far.min(f64::from(f32::MAX)) as f32, // 0 or largest where there is none
        z_offset: ((high + room) * scale) as f32,
        z_scale: scale as f32,
    }
}
