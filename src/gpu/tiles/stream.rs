//! Methods other than exact: every tile's triangles are walked in the order of submission, once or several times, by an
//! invocation a pixel that holds the method's state.

use std::time::Instant;

use wgpu::BufferUsages;

use super::ready::Ready;
use super::walk::{Walker, walk_trips};
use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::fragments::Background;
use crate::frame::{Lists, Output, Request, Stats};
use crate::gpu::buffers::{bind, storage, with_contents};
use crate::gpu::device::SOFTWARE_TURNS;
use crate::gpu::kept::Kept;
use crate::gpu::plan;
use crate::gpu::pool::DEFAULT_MEMORY;
use crate::gpu::readback::copied;
use crate::gpu::resolve::TILE;
use crate::gpu::timing::Timing;
use crate::gpu::uniforms::MethodUniform;
use crate::memory::allocate;
use crate::methods::Method;
use crate::resolve::Resolve;
use crate::scene::Scene;

/// Words of `Totals` in shaders/tiles/stream.wgsl.
const TOTAL_WORDS: usize = 4;

/// The image and counts of a method that is not exact; no lists.
pub fn render(
    kept: &mut Kept,
    scene: &Scene,
    camera: &Camera,
    request: &Request,
    background: &Background<f32>,
) -> Result<Output<f32>> {
    let gpu = kept.gpu.clone();
    let mut stats = Stats { device: gpu.adapter.name.clone(), ..Stats::default() };
    let clock = Instant::now();
    let samples = u64::from(request.samples);
    let variant = plan::variant(&gpu, scene, request)?.without_lists();
    let ready = Ready::new(kept, &variant, (scene, camera), request, background)?;
    let of = ready.context();
    let memory = request.memory.unwrap_or(DEFAULT_MEMORY);
    let mut walker =
        Walker::new(of, (kept, ready.scene.clone()), ready.eye, ready.size, memory, |stage, ms| {
            stats.add(stage, ms)
        })?;
    stats.stage("upload", clock);
    check_trips(&gpu, request, walker.counted.longest)?;
    let (passes, _) = request.method.work(walker.counted.longest);

    let each = request.image_samples() as u64;
    let (width, height) = ready.size;
    // Rows of whole tiles that one binding has.
    let row_bytes = 16 * each * u64::from(width) * u64::from(TILE);
    let rows = ((gpu.adapter.max_binding / row_bytes) as u32).max(1) * TILE;
    let mut image = allocate("the image", request.pixels() * each as usize, [f32::NAN; 4])?;
    let mut counts = allocate("counts", request.pixels(), -1)?;
    let mut totals = [0_u64; TOTAL_WORDS];
    let clock = Instant::now();
    for band in parts(&walker.bands(), rows, height) {
        walker.turn_to(of, band.start)?;
        let pixels = u64::from(width) * u64::from(band.end - band.start);
        let timing = Timing::new(&gpu);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        if variant.hides {
            walker.encode_opaque(of, &mut encoder, &timing)?;
        }
        let (part, part_counts, part_totals) = gpu.checked("the image of a method", || {
            let part = storage(&gpu, "image", 16 * each * pixels);
            let part_counts = storage(&gpu, "counts", 4 * pixels);
            let part_totals = storage(&gpu, "totals", 4 * TOTAL_WORDS as u64);
            Ok((part, part_counts, part_totals))
        })?;
        let uniform = MethodUniform::new(&request.method, band.start, passes);
        let uniform = with_contents(&gpu, "method", BufferUsages::UNIFORM, &[uniform]);
        let slots = [
            (&part).into(),
            (&part_counts).into(),
            (&part_totals).into(),
            (&uniform).into(),
            (&ready.background).into(),
        ];
        let group = bind(&gpu, "stream", &of.stages().stream_layout, &slots);
        let tiles = (band.end - band.start).div_ceil(TILE);
        walker.encode_stream(of, &request.method, &group, tiles, &mut encoder, &timing)?;
        let mut buffers = vec![
            copied(&gpu, &mut encoder, &part, 16 * each * pixels),
            copied(&gpu, &mut encoder, &part_counts, 4 * pixels),
            copied(&gpu, &mut encoder, &part_totals, 4 * TOTAL_WORDS as u64),
        ];
        buffers.extend(timing.finish(&mut encoder).cloned());
        let words = gpu.submit(encoder, buffers)?.read(&gpu)?;
        if let Some(ticks) = words.get(3) {
            timing.read(ticks).into_iter().for_each(|(stage, ms)| stats.add(stage, ms));
        }
        let first = band.start as usize * width as usize;
        let colors: &[[f32; 4]] = bytemuck::cast_slice(&words[0]);
        let n = pixels as usize;
        image[first * each as usize..][..n * each as usize].copy_from_slice(&colors[..n * each as usize]);
        counts[first..][..n].copy_from_slice(&bytemuck::cast_slice(&words[1])[..n]);
        let [fragments, deepest, left_out, filled] = std::array::from_fn(|i| u64::from(words[2][i]));
        totals = [totals[0] + fragments, totals[1].max(deepest), totals[2] + left_out, totals[3] + filled];
        stats.bands += 1;
    }
    stats.gpu_ms = gpu
        .features
        .contains(wgpu::Features::TIMESTAMP_QUERY)
        .then(|| stats.ms.iter().filter(|(stage, _)| stage != "upload").map(|(_, ms)| ms).sum());
    stats.stage("wait and readback", clock);
    stats.rejected_triangles = walker.counted.rejected;
    let [fragments, deepest, left_out, filled] = totals;
    stats.fragments = fragments;
    stats.max_depth_complexity = Some(deepest as u32);
    stats.leave_out(&request.method, left_out);
    plan::describe_upload(kept.is_kept, &mut stats);
    let samples_why = if samples > 1 { "one after the other" } else { "no masks" };
    stats.choose("samples", samples.to_string(), samples_why);
    Resolve::of(request, scene).describe(scene, "known from the triangle", &mut stats);
    stats.choose("lists", "none", "the method's state is all that a pixel has");
    plan::describe_rect(walker.counted.rect, request, &mut stats);
    let all = width.div_ceil(TILE) * height.div_ceil(TILE);
    stats.choose(
        "tiles",
        format!("{filled} of {all} hold translucent geometry"),
        format!("{TILE}×{TILE} pixels each"),
    );
    stats.bytes = walker.bytes();
    stats.bytes.push(("image band", (16 * each + 4) * u64::from(width) * u64::from(rows.min(height))));
    walker.leave(kept, &variant);
    let counts = (request.lists != Lists::None).then_some(counts);
    Ok(Output { image, counts, background: None, fragments: None, stats })
}

/// Rows of pixels of each dispatch: those of a band of bins, cut where an image has no room.
fn parts(bands: &[u32], rows: u32, height: u32) -> Vec<std::ops::Range<u32>> {
    let ends = bands.iter().skip(1).copied().chain([height]);
    let cut = |start: u32, end: u32| {
        (start..end).step_by(rows as usize).map(move |first| first..(first + rows).min(end))
    };
    bands.iter().zip(ends).flat_map(|(&start, end)| cut(start, end)).collect()
}

/// Whether a software driver's loops reach the end of the longest list, as often as the method walks it.
fn check_trips(gpu: &crate::gpu::device::Gpu, request: &Request, longest: u32) -> Result<()> {
    if !gpu.adapter.is_software() {
        return Ok(());
    }
    if let Method::Own(own) = &request.method {
        own.check_loops(&gpu.adapter.name)?;
    }
    let samples = u64::from(request.samples);
    let (passes, inner) = request.method.work(longest);
    let most = u64::from(SOFTWARE_TURNS);
    let of_a_pass =
        u64::from(longest) * (u64::from(walk_trips(request.samples)) + u64::from(inner)) * samples;
    let trips = of_a_pass * u64::from(passes);
    if trips <= most {
        return Ok(());
    }
    let peels = matches!(request.method, Method::DepthPeeling(_) | Method::DualDepthPeeling(_));
    let fewer = if peels && of_a_pass <= most {
        format!("; method=\"depth_peeling\", layers={} takes no more", most / of_a_pass)
    } else {
        String::new()
    };
    Err(Error::Unsupported(format!(
        "{} ends loops after {most} turns, silently, and this method takes up to {trips} in a tile of {longest} \
         triangles; device=\"cpu\" has no such limit{fewer}",
        gpu.adapter.name
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_cover_every_row_once_and_begin_where_bands_do() {
        assert_eq!(parts(&[0], 64, 100), [0..64, 64..100]);
        assert_eq!(parts(&[0, 48], 32, 70), [0..32, 32..48, 48..70]);
        assert_eq!(parts(&[0], 1 << 20, 16), vec![0..16]);
    }
}
