//! Lists longer than the resolve's temporary array: counted, copied to scratch, sorted and composited by
//! dispatches of bounded length (see linked_list_long.wgsl).

use wgpu::BufferUsages;

use super::buffers::{bind, readable, storage, with_contents};
use super::passes::Frame;
use super::pool::Pool;
use super::timing::Timing;
use super::uniforms::{LongPixel, Round};
use crate::error::{Error, Result};
use crate::frame::Stats;
use crate::shader::CHUNK;

/// Invocations of a workgroup in all of these stages.
const WORKGROUP: u32 = 64;

/// Resolves the pixels that the resolve put aside. `scratch`: entries that may be sorted at a time.
pub fn resolve(
    frame: &Frame,
    pool: &Pool,
    read_group: &wgpu::BindGroup,
    long_count: u32,
    scratch: u64,
    stats: &mut Stats,
) -> Result<()> {
    let counting =
        Sorter::new(frame, pool, read_group, &vec![bytemuck::Zeroable::zeroed(); long_count as usize], 0);
    counting.submit(&[(&frame.pipelines.begin, long_count, 0, 0)], stats)?;
    counting.until_finished(&frame.pipelines.count, 0, stats)?;
    let mut pixels = counting.read_pixels()?;
    // Longest first, so that a batch holds lists of like length and needs few rounds.
    pixels.sort_unstable_by_key(|p| std::cmp::Reverse((p.count, p.pixel)));
    let mut rest = pixels.as_mut_slice();
    while !rest.is_empty() {
        let mut entries = 0_u64;
        let mut fitting = 0;
        for pixel in rest.iter_mut() {
            let padded = u64::from(pixel.count.next_multiple_of(CHUNK));
            if entries + padded > scratch {
                break;
            }
            pixel.first = entries as u32;
            (pixel.link, pixel.written, pixel.composited) = (pixel.head, 0, 0);
            entries += padded;
            fitting += 1;
        }
        if fitting == 0 {
            return Err(Error::Capacity {
                what: format!("sorting a pixel's {} fragments", rest[0].count),
                needed: 8 * u64::from(rest[0].count.next_multiple_of(CHUNK)),
                limit: 8 * scratch,
                advice: "raise memory=".into(),
            });
        }
        let (batch, later) = std::mem::take(&mut rest).split_at_mut(fitting);
        rest = later;
        stats.raise("scratch", 8 * entries + size_of_val(batch) as u64);
        Sorter::new(frame, pool, read_group, batch, entries as u32).run(stats)?;
    }
    Ok(())
}

/// A pipeline, its invocations, the buffer of entries that they read, and the width of a merge's runs.
type Dispatch<'p> = (&'p wgpu::ComputePipeline, u32, usize, u32);

/// A batch of long lists and its buffers.
struct Sorter<'a> {
    frame: &'a Frame<'a>,
    pool: &'a Pool,
    read_group: &'a wgpu::BindGroup,
    long: wgpu::Buffer,
    unfinished: wgpu::Buffer,
    entries: [wgpu::Buffer; 2],
    chunk_owner: wgpu::Buffer,
    long_count: u32,
    chunk_count: u32,
    longest: u32,
}

impl<'a> Sorter<'a> {
    fn new(
        frame: &'a Frame<'a>,
        pool: &'a Pool,
        read_group: &'a wgpu::BindGroup,
        pixels: &[LongPixel],
        entries: u32,
    ) -> Self {
        let gpu = frame.gpu;
        let chunk_count = entries / CHUNK;
        let mut owner = Vec::with_capacity(chunk_count as usize);
        if entries > 0 {
            for (i, pixel) in (0_u32..).zip(pixels) {
                owner.extend(std::iter::repeat_n(i, pixel.count.div_ceil(CHUNK) as usize));
            }
        }
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        Self {
            frame,
            pool,
            read_group,
            long: with_contents(gpu, "long", usage, pixels),
            unfinished: storage(gpu, "unfinished", 4),
            entries: ["ping", "pong"].map(|label| storage(gpu, label, 4 * u64::from(entries))),
            chunk_owner: with_contents(gpu, "chunk owners", usage, &owner),
            long_count: pixels.len() as u32,
            chunk_count,
            longest: pixels.iter().map(|p| p.count).max().unwrap_or(0),
        }
    }

    /// Gathers, sorts and composites the batch.
    fn run(&self, stats: &mut Stats) -> Result<()> {
        let pipelines = self.frame.pipelines;
        self.until_finished(&pipelines.gather, 0, stats)?;
        let mut rounds: Vec<Dispatch> = vec![(&pipelines.sort_chunks, self.chunk_count, 0, 0)];
        let mut width = CHUNK;
        let mut source = 0;
        while width < self.longest {
            rounds.push((&pipelines.merge, self.chunk_count, source, width));
            source = 1 - source;
            width = width.saturating_mul(2);
        }
        self.submit(&rounds, stats)?;
        self.until_finished(&pipelines.composite, source, stats)
    }

    /// Dispatches one invocation a pixel until none has stored its state for another turn.
    fn until_finished(
        &self,
        pipeline: &wgpu::ComputePipeline,
        source: usize,
        stats: &mut Stats,
    ) -> Result<()> {
        while self.submit(&[(pipeline, self.long_count, source, 0)], stats)? {}
        Ok(())
    }

    /// Runs dispatches one after the other. Returns whether any invocation is unfinished.
    fn submit(&self, dispatches: &[Dispatch], stats: &mut Stats) -> Result<bool> {
        let gpu = self.frame.gpu;
        let timing = Timing::new(gpu);
        let unfinished = readable(gpu, "unfinished", 4);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        gpu.checked("sorting long lists", || {
            encoder.clear_buffer(&self.unfinished, 0, None);
            dispatches.iter().for_each(|dispatch| self.encode(&mut encoder, *dispatch, &timing));
            encoder.copy_buffer_to_buffer(&self.unfinished, 0, &unfinished, 0, 4);
            Ok(())
        })?;
        let results = self.frame.submit(encoder, &timing, &[&unfinished], stats)?;
        Ok(results[0].iter().any(|&word| word != 0))
    }

    fn encode(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        (pipeline, n, source, width): Dispatch,
        timing: &Timing,
    ) {
        let gpu = self.frame.gpu;
        let round = Round { width, long_count: self.long_count, chunk_count: self.chunk_count, pad: 0 };
        let group = bind(
            gpu,
            "long",
            &self.frame.pipelines.long,
            &[
                (&self.long).into(),
                (&self.unfinished).into(),
                (&self.entries[source]).into(),
                (&self.entries[1 - source]).into(),
                (&self.chunk_owner).into(),
                (&with_contents(gpu, "round", BufferUsages::UNIFORM, &[round])).into(),
                (&self.pool.long_pixels).into(),
            ],
        );
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("long lists"),
            timestamp_writes: timing.compute("long lists"),
        });
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, self.read_group, &[]);
        pass.set_bind_group(1, &group, &[]);
        let groups = n.div_ceil(WORKGROUP);
        let x = groups.clamp(1, gpu.limits.max_compute_workgroups_per_dimension);
        pass.dispatch_workgroups(x, groups.div_ceil(x), 1);
    }

    fn read_pixels(&self) -> Result<Vec<LongPixel>> {
        let gpu = self.frame.gpu;
        let bytes = u64::from(self.long_count) * size_of::<LongPixel>() as u64;
        let buffer = readable(gpu, "long", bytes);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(&self.long, 0, &buffer, 0, bytes);
        let words = gpu.submit_and_read(encoder, &[&buffer])?.remove(0);
        Ok(words[..bytes as usize / 4]
            .chunks_exact(size_of::<LongPixel>() / 4)
            .map(|w| *bytemuck::from_bytes(bytemuck::cast_slice(w)))
            .collect())
    }
}
