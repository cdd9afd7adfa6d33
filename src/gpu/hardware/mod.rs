//! Methods that have a form of their own on the hardware's rasteriser, as they were published: blended into targets, or
//! peeled by depth tests. Their images are those of `tiles` but for what the hardware rounds; their times are theirs.

mod blended;
mod canvas;
mod image;
mod peeling;
mod stages;
mod stochastic;
mod totals;

use std::time::Instant;

pub use stages::Stages;
#[cfg(test)]
pub use stages::modules;

use super::device::Gpu;
use super::kept::Kept;
use super::plan;
use super::tiles::Ready;
use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::fragments::Background;
use crate::frame::{Lists, Output, Request, Stats};
use crate::methods::Method;
use crate::scene::Scene;
use canvas::Canvas;

/// The image and counts of a method's native form; no lists.
pub fn render(
    kept: &mut Kept,
    scene: &Scene,
    camera: &Camera,
    request: &Request,
    background: &Background<f32>,
) -> Result<Output<f32>> {
    let gpu = kept.gpu.clone();
    check(&gpu, request)?;
    let mut stats = Stats { device: gpu.adapter.name.clone(), bands: 1, ..Stats::default() };
    let clock = Instant::now();
    // The scene lies on the device as tiles have it.
    let variant = plan::variant(&gpu, scene, &request.in_tiles())?.without_lists();
    let ready = Ready::new(kept, &variant, (scene, camera), request, background)?;
    let mut canvas = Canvas::new(&ready, scene, request)?;
    canvas.draw_opaque()?;
    stats.stage("upload", clock);

    let clock = Instant::now();
    let method = canvas.method;
    let peels = matches!(method, Method::DepthPeeling(_) | Method::DualDepthPeeling(_));
    let (totals, counts) = totals::count(&mut canvas, request.lists == Lists::Count, &mut stats)?;
    let shown = match method {
        Method::DepthPeeling(peeling) => peeling::depth_peeling(&mut canvas, peeling.peeled(totals.deepest))?,
        Method::DualDepthPeeling(_) => peeling::dual_depth_peeling(&mut canvas, totals.deepest)?,
        Method::Stochastic(own) => stochastic::stochastic(&mut canvas, own)?,
        _ => blended::blended(&mut canvas)?,
    };
    let image = image::read(&mut canvas, &shown, &mut stats)?;
    // Counting is for `stats` alone, where nothing else needs it.
    let is_own = |stage: &str| stage != "upload" && (peels || stage != "count");
    stats.gpu_ms = gpu
        .has(wgpu::Features::TIMESTAMP_QUERY)
        .then(|| stats.ms.iter().filter(|(stage, _)| is_own(stage)).map(|(_, ms)| ms).sum());
    stats.stage("wait and readback", clock);
    stats.fragments = totals.fragments;
    stats.max_depth_complexity = Some(totals.deepest);
    if let Method::DepthPeeling(_) = method {
        stats.dropped_fragments = totals.beyond;
    }
    plan::describe_upload(kept.is_kept, &mut stats);
    let counted = if peels { "for the number of layers" } else { "for stats: gpu_ms leaves it out" };
    stats.choose("fragments counted", "in a pass of their own", counted);
    stats.choose("passes over geometry", canvas.drawn.to_string(), "beside counting, and opaque surfaces");
    stats.bytes = vec![("scene", ready.scene.bytes), ("targets", canvas.bytes)];
    Ok(Output { image, counts, background: None, fragments: None, stats })
}

fn check(gpu: &Gpu, request: &Request) -> Result<()> {
    let name = &gpu.adapter.name;
    if stages::files(&request.method).is_empty() {
        return Err(Error::Unsupported(format!("method {:?} has no native form", request.method.id())));
    }
    if !gpu.has(wgpu::Features::FLOAT32_BLENDABLE) {
        return Err(Error::Unsupported(format!(
            "{name} does not blend into 32-bit floats, which pipeline \"hardware\" needs: give pipeline=\"tiles\""
        )));
    }
    let limit = gpu.limits.max_texture_dimension_2d;
    if request.width.max(request.height) > limit {
        return Err(Error::Unsupported(format!(
            "{name} draws up to {limit} pixels a side, got {}×{}: pipeline=\"tiles\" has no such limit",
            request.width, request.height
        )));
    }
    Ok(())
}
