//! How many fragments there are, by a pass that counts them.

use wgpu::BufferUsages;

use super::canvas::{ADD, CLEAR, Canvas, Target};
use super::image;
use crate::error::Result;
use crate::frame::Stats;
use crate::gpu::buffers::{bind, storage, with_contents};
use crate::gpu::readback::copied;
use crate::gpu::resolve::TILE;
use crate::gpu::timing::Timing;
use crate::methods::Method;

#[derive(Debug, Default)]
pub struct Totals {
    pub fragments: u64,
    /// Of the deepest pixel.
    pub deepest: u32,
    /// Of all pixels, those that a method which peels so many layers drops.
    pub beyond: u64,
}

/// Draws what is encoded so far, and waits. Also gives the count of each pixel, if it is wanted.
pub fn count(
    canvas: &mut Canvas,
    wants_counts: bool,
    stats: &mut Stats,
) -> Result<(Totals, Option<Vec<i32>>)> {
    let gpu = canvas.gpu;
    // A float adds up to 2^24 ones: scenes have fewer triangles than that in a pixel, or run out of time.
    let counts = canvas.texture("counts", wgpu::TextureFormat::R32Float, 1)?;
    canvas.draw("count", "fs_count", &[Target::new(&counts, ADD, CLEAR)], &[])?;
    let limit = match canvas.method {
        Method::DepthPeeling(own) => own.peeled(u32::MAX),
        _ => u32::MAX,
    };
    let pipeline = canvas.stages.totals(gpu)?;
    let (totals, group) = gpu.checked("counting", || {
        let totals = storage(gpu, "totals", 16);
        let limit = with_contents(gpu, "limit", BufferUsages::UNIFORM, &[[limit, 0, 0, 0]]);
        let slots = [(&counts).into(), (&totals).into(), (&limit).into()];
        let group = bind(gpu, "totals", &canvas.stages.totals_layout, &slots);
        Ok((totals, group))
    })?;
    let mut pass = canvas.encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
        label: Some("totals"),
        timestamp_writes: canvas.timing.compute("count"),
    });
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, &group, &[]);
    let (width, height) = canvas.size;
    pass.dispatch_workgroups(width.div_ceil(TILE), height.div_ceil(TILE), 1);
    drop(pass);
    let mut buffers = vec![copied(gpu, &mut canvas.encoder, &totals, 16)];
    let rows = if wants_counts { image::copy_rows(canvas, &counts, &mut buffers)? } else { vec![] };
    let words = submit(canvas, buffers, stats)?;
    let [fragments, deepest, beyond] = std::array::from_fn(|i| words[0][i]);
    let totals = Totals { fragments: u64::from(fragments), deepest, beyond: u64::from(beyond) };
    let counts = wants_counts.then(|| {
        let mut found = Vec::with_capacity(width as usize * height as usize);
        for (words, &rows) in words[1..].iter().zip(&rows) {
            image::each_row(words, (width as usize, rows as usize), |row| {
                found.extend(row.iter().map(|&word| f32::from_bits(word) as i32));
            });
        }
        found
    });
    Ok((totals, counts))
}

/// Submits what is encoded, waits, and notes the times of its passes; what follows is encoded anew.
pub fn submit(
    canvas: &mut Canvas,
    mut buffers: Vec<wgpu::Buffer>,
    stats: &mut Stats,
) -> Result<Vec<Vec<u32>>> {
    let gpu = canvas.gpu;
    let fresh = gpu.device.create_command_encoder(&Default::default());
    let mut encoder = std::mem::replace(&mut canvas.encoder, fresh);
    let timing = std::mem::replace(&mut canvas.timing, Timing::of(gpu, super::canvas::MOST_TIMED));
    let ticks = timing.finish(&mut encoder).cloned();
    let is_timed = ticks.is_some();
    buffers.extend(ticks);
    let mut words = gpu.submit(encoder, buffers)?.read(gpu)?;
    if is_timed && let Some(ticks) = words.pop() {
        timing.read(&ticks).into_iter().for_each(|(stage, ms)| stats.add(stage, ms));
    }
    Ok(words)
}
