//! Lists longer than the resolve's temporary array: copied to scratch, sorted and composited by
//! dispatches of bounded length (see resolve/long.wgsl).

use wgpu::BufferUsages;

use super::buffers::{bind, storage, with_contents};
use super::passes::Frame;
use super::pipelines::Long;
use super::pool::Pool;
use super::readback::copied;
use super::timing::Timing;
use super::uniforms::{LongPixel, LongSample, Round};
use crate::error::{Error, Result};
use crate::frame::{LimitPolicy, Stats};
use crate::shader::{CHUNK, LONG_BLOCK};

/// Invocations of a workgroup in all of these stages but the sort of blocks.
const WORKGROUP: u32 = 64;

/// Resolves the pixels that the classes left over: so many of `class_pixels`, from the first on. Returns how many
/// fragments are beyond the limit.
pub fn resolve(
    frame: &Frame,
    pool: &Pool,
    read_group: &wgpu::BindGroup,
    (first_pixel, long_count): (u32, u32),
    stats: &mut Stats,
) -> Result<u64> {
    let mut pixels: Vec<LongPixel> = Vec::new();
    let at_once = (frame.gpu.adapter.max_binding / size_of::<LongPixel>() as u64) as usize;
    for first in (0..long_count).step_by(at_once) {
        let blank = vec![bytemuck::Zeroable::zeroed(); at_once.min((long_count - first) as usize)];
        let finding = Sorter::new(frame, pool, read_group, &blank, first_pixel + first, 0)?;
        finding.submit(&[Dispatch::new(&finding.stages.begin, finding.long_count)], stats)?;
        pixels.extend(finding.read_pixels()?);
    }
    pixels.iter_mut().for_each(|pixel| pixel.kept = pixel.count); // a limit finds less
    let mut dropped = 0;
    // Longest first, so that a batch holds lists of like length and needs few rounds.
    pixels.sort_unstable_by_key(|p| std::cmp::Reverse((p.count, p.pixel)));
    let scratch = frame.scratch;
    // An entry is four bytes in each of two buffers; what a pixel's samples keep counts as entries too.
    let samples = frame.pipelines.variant.layout.samples;
    let kept = (size_of::<LongSample>() * samples as usize).div_ceil(8) as u64;
    let most_pixels = frame.gpu.adapter.max_binding / (size_of::<LongSample>() as u64 * u64::from(samples));
    let mut rest = pixels.as_mut_slice();
    while !rest.is_empty() {
        let (mut entries, mut held) = (0_u64, 0_u64);
        let mut fitting = 0;
        for pixel in rest.iter_mut() {
            let padded = u64::from(pixel.count.next_multiple_of(CHUNK));
            let is_full = held + padded + kept > scratch || fitting as u64 >= most_pixels;
            if padded > scratch || (fitting > 0 && is_full) {
                break;
            }
            pixel.first = entries as u32;
            pixel.written = 0;
            entries += padded;
            held += padded + kept;
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
        stats.raise("scratch", 8 * held + size_of_val(batch) as u64);
        Sorter::new(frame, pool, read_group, batch, first_pixel, entries as u32)?.run(&mut dropped, stats)?;
    }
    Ok(dropped)
}

/// One dispatch of a stage.
#[derive(Clone, Copy)]
struct Dispatch<'p> {
    pipeline: &'p wgpu::ComputePipeline,
    invocations: u32,
    /// The buffer of entries that it reads.
    source: usize,
    /// Of a merge's runs.
    width: u32,
    /// Sort by primitive, to find the last submitted.
    by_order: bool,
}

impl<'p> Dispatch<'p> {
    fn new(pipeline: &'p wgpu::ComputePipeline, invocations: u32) -> Self {
        Self { pipeline, invocations, source: 0, width: 0, by_order: false }
    }
}

/// A batch of long lists and its buffers.
struct Sorter<'a> {
    frame: &'a Frame<'a>,
    stages: &'a Long,
    read_group: &'a wgpu::BindGroup,
    class_pixels: &'a wgpu::Buffer,
    first_pixel: u32,
    long: wgpu::Buffer,
    samples: wgpu::Buffer,
    unfinished: wgpu::Buffer,
    entries: [wgpu::Buffer; 2],
    chunk_owner: wgpu::Buffer,
    block_starts: wgpu::Buffer,
    long_count: u32,
    chunk_count: u32,
    block_count: u32,
    longest: u32,
}

impl<'a> Sorter<'a> {
    fn new(
        frame: &'a Frame<'a>,
        pool: &'a Pool,
        read_group: &'a wgpu::BindGroup,
        pixels: &[LongPixel],
        first_pixel: u32,
        entries: u32,
    ) -> Result<Self> {
        let gpu = frame.gpu;
        let chunk_count = entries / CHUNK;
        let mut owner = Vec::with_capacity(chunk_count as usize);
        let mut block_starts = Vec::new();
        if entries > 0 {
            for (i, pixel) in (0_u32..).zip(pixels) {
                let first = owner.len() as u32;
                owner.extend(std::iter::repeat_n(i, pixel.count.div_ceil(CHUNK) as usize));
                block_starts.extend((first..owner.len() as u32).step_by((LONG_BLOCK / CHUNK) as usize));
            }
        }
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let all_samples = u64::from(frame.pipelines.variant.layout.samples) * pixels.len() as u64;
        let samples = if entries > 0 { all_samples } else { 0 }; // none while pixels are only found
        Ok(Self {
            frame,
            stages: frame.pipelines.long(gpu)?,
            read_group,
            class_pixels: &pool.class_pixels,
            first_pixel,
            long: with_contents(gpu, "long", usage, pixels),
            // New buffers are zero: nothing is composited yet.
            samples: storage(gpu, "long samples", size_of::<LongSample>() as u64 * samples),
            unfinished: storage(gpu, "unfinished", 4),
            entries: ["ping", "pong"].map(|label| storage(gpu, label, 4 * u64::from(entries))),
            chunk_owner: with_contents(gpu, "chunk owners", usage, &owner),
            block_starts: with_contents(gpu, "block starts", usage, &block_starts),
            long_count: pixels.len() as u32,
            chunk_count,
            block_count: block_starts.len() as u32,
            longest: pixels.iter().map(|p| p.count).max().unwrap_or(0),
        })
    }

    /// Gathers, sorts and composites the batch. `dropped` rises by the fragments beyond the limit.
    fn run(&self, dropped: &mut u64, stats: &mut Stats) -> Result<()> {
        let (stages, variant) = (self.stages, &self.frame.pipelines.variant);
        let each_pixel = |pipeline, source| Dispatch { source, ..Dispatch::new(pipeline, self.long_count) };
        self.until_finished(each_pixel(&stages.gather, 0), stats)?;
        let by_order = matches!(variant.limit, Some((_, LimitPolicy::LastSubmitted)));
        let mut rounds = Vec::new();
        let mut source = self.sort(&mut rounds, 0, by_order);
        self.submit(&rounds, stats)?;
        if let Some((limit, _)) = variant.limit {
            self.until_finished(each_pixel(&stages.limit, source), stats)?;
            let beyond = |pixel: &LongPixel| u64::from(pixel.fragments.saturating_sub(limit));
            *dropped += self.read_pixels()?.iter().map(beyond).sum::<u64>();
        }
        if by_order {
            let mut rounds = vec![Dispatch { source, ..Dispatch::new(&stages.truncate, self.chunk_count) }];
            source = self.sort(&mut rounds, source, false);
            self.submit(&rounds, stats)?;
        }
        let composite = Dispatch::new(&stages.composite, self.long_count * variant.layout.samples);
        self.until_finished(Dispatch { source, ..composite }, stats)?;
        self.submit(&[each_pixel(&stages.finish, 0)], stats).map(|_| ())
    }

    /// The rounds that sort what is in one of the buffers of entries. Returns in which it ends up.
    fn sort(&self, rounds: &mut Vec<Dispatch<'a>>, mut source: usize, by_order: bool) -> usize {
        let of = |pipeline: &'a wgpu::ComputePipeline, source, width| Dispatch {
            source,
            width,
            by_order,
            ..Dispatch::new(pipeline, self.chunk_count)
        };
        let (invocations, mut width) = if self.stages.in_blocks {
            (self.block_count * WORKGROUP, LONG_BLOCK)
        } else {
            (self.chunk_count, CHUNK)
        };
        rounds.push(Dispatch { invocations, ..of(&self.stages.sort_runs, source, 0) });
        while width < self.longest {
            rounds.push(of(&self.stages.merge, source, width));
            source = 1 - source;
            width = width.saturating_mul(2);
        }
        source
    }

    /// Dispatches until no invocation has stored its state for another turn.
    fn until_finished(&self, dispatch: Dispatch, stats: &mut Stats) -> Result<()> {
        while self.submit(&[dispatch], stats)? {}
        Ok(())
    }

    /// Runs dispatches one after the other. Returns whether any invocation is unfinished.
    fn submit(&self, dispatches: &[Dispatch], stats: &mut Stats) -> Result<bool> {
        let gpu = self.frame.gpu;
        let timing = Timing::new(gpu);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let unfinished = gpu.checked("sorting long lists", || {
            encoder.clear_buffer(&self.unfinished, 0, None);
            dispatches.iter().for_each(|dispatch| self.encode(&mut encoder, *dispatch, &timing));
            Ok(copied(gpu, &mut encoder, &self.unfinished, 4))
        })?;
        let results = self.frame.submit(encoder, &timing, &[&unfinished], stats)?;
        Ok(results[0].first().is_some_and(|&word| word != 0))
    }

    fn encode(&self, encoder: &mut wgpu::CommandEncoder, dispatch: Dispatch, timing: &Timing) {
        let gpu = self.frame.gpu;
        let round = Round {
            width: dispatch.width,
            long_count: self.long_count,
            chunk_count: self.chunk_count,
            first_pixel: self.first_pixel,
            by_order: u32::from(dispatch.by_order),
            block_count: self.block_count,
            pad0: 0,
            pad1: 0,
        };
        let group = bind(
            gpu,
            "long",
            &self.frame.pipelines.layouts.long,
            &[
                (&self.long).into(),
                (&self.unfinished).into(),
                (&self.entries[dispatch.source]).into(),
                (&self.entries[1 - dispatch.source]).into(),
                (&self.chunk_owner).into(),
                (&with_contents(gpu, "round", BufferUsages::UNIFORM, &[round])).into(),
                self.class_pixels.into(),
                (&self.samples).into(),
                (&self.block_starts).into(),
            ],
        );
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("long lists"),
            timestamp_writes: timing.compute("long lists"),
        });
        pass.set_pipeline(dispatch.pipeline);
        pass.set_bind_group(0, self.read_group, &[]);
        pass.set_bind_group(1, &group, &[]);
        let groups = dispatch.invocations.div_ceil(WORKGROUP);
        let x = groups.clamp(1, gpu.limits.max_compute_workgroups_per_dimension);
        pass.dispatch_workgroups(x, groups.div_ceil(x), 1);
    }

    fn read_pixels(&self) -> Result<Vec<LongPixel>> {
        let gpu = self.frame.gpu;
        let bytes = u64::from(self.long_count) * size_of::<LongPixel>() as u64;
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let buffer = copied(gpu, &mut encoder, &self.long, bytes);
        let words = gpu.submit_and_read(encoder, &[&buffer])?.remove(0);
        Ok(words[..bytes as usize / 4]
            .chunks_exact(size_of::<LongPixel>() / 4)
            .map(|w| *bytemuck::from_bytes(bytemuck::cast_slice(w)))
            .collect())
    }
}
