//! Filling the lists of one rectangle, linked or contiguous, and resolving them.

use super::buffers::{bind, storage};
use super::long;
use super::passes::Frame;
use super::pool::{Budget, Pool, image_samples};
use super::readback::copied;
use super::rect::Rect;
use super::resolve::{Found, Outcome, encode_classes, encode_classify};
use super::scan;
use super::targets::place;
use super::timing::Timing;
use super::variant::BuildStage;
use crate::error::{Error, Result};
use crate::frame::Output;

/// What became of a rectangle.
pub enum Filled {
    /// Its part of the image is written.
    Done { nodes: u64, outcome: Outcome },
    /// It needs more nodes than the pool has, or may have.
    Overflow { nodes: u64 },
}

/// How fragments come into lists.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// Linked as they come.
    Link,
    /// Appended as they come, then gathered into contiguous lists: one pass over the geometry, nodes held twice.
    Append,
    /// Counted, then scattered to their lists: two passes over the geometry, nodes held once.
    Scatter,
}

impl Frame<'_> {
    /// Fills and resolves the lists of a rectangle.
    pub fn fill_and_resolve(
        &self,
        way: Way,
        pool: &mut Pool,
        budget: &Budget,
        rect: Rect,
        output: &mut Output<f32>,
    ) -> Result<Filled> {
        match way {
            Way::Link => self.link(pool, rect, output),
            Way::Append => self.append(pool, rect, output),
            Way::Scatter => self.scatter(pool, budget, rect, output),
        }
    }

    /// One pass: nodes are handed out by a counter and linked.
    fn link(&self, pool: &Pool, rect: Rect, output: &mut Output<f32>) -> Result<Filled> {
        let timing = Timing::new(self.gpu);
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let band = self.band(pool, rect);
        self.gpu.checked("building the lists", || {
            encoder.clear_buffer(&pool.heads, 0, Some(4 * rect.pixels()));
            let group = self.taking_group(&mut encoder, pool, &pool.nodes, &band, rect);
            self.encode_build(&mut encoder, BuildStage::Link, &group, rect, &timing)
        })?;
        self.resolve(encoder, &timing, pool, &band, rect, output)
    }

    /// Clears what nodes are handed out by: at the start, never in the resolve, since a frame must not depend on the
    /// one before it.
    fn taking_group(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        pool: &Pool,
        nodes: &wgpu::Buffer,
        band: &wgpu::Buffer,
        rect: Rect,
    ) -> wgpu::BindGroup {
        encoder.clear_buffer(&pool.counts, 0, Some(4 * rect.pixels()));
        encoder.clear_buffer(&pool.counter, 0, None);
        let slots =
            [band.into(), (&pool.heads).into(), nodes.into(), (&pool.counter).into(), (&pool.counts).into()];
        bind(self.gpu, "link", &self.pipelines.layouts.link, &slots)
    }

    /// One pass over the geometry: appended and counted, then scanned, then gathered into lists.
    fn append(&self, pool: &mut Pool, rect: Rect, output: &mut Output<f32>) -> Result<Filled> {
        let gpu = self.gpu;
        let timing = Timing::new(gpu);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let band = self.band(pool, rect);
        let appended = pool.appended(gpu)?.clone();
        let pipeline = self.pipelines.gather(gpu)?;
        gpu.checked("gathering fragments", || {
            let group = self.taking_group(&mut encoder, pool, &appended, &band, rect);
            self.encode_build(&mut encoder, BuildStage::Append, &group, rect, &timing)?;
            // One more than pixels: where the last list ends.
            encoder.clear_buffer(&pool.heads, 4 * rect.pixels(), Some(4));
            encoder.copy_buffer_to_buffer(&pool.counts, 0, &pool.heads, 0, 4 * rect.pixels());
            let total = storage(gpu, "total", 8); // which the counter knows
            scan::encode(self, &mut encoder, &pool.heads, rect.pixels() as u32 + 1, &total, &timing)?;
            encoder.copy_buffer_to_buffer(&pool.heads, 0, &pool.cursors, 0, 4 * rect.pixels());
            let slots = [
                (&self.view).into(),
                (&band).into(),
                (&pool.counter).into(),
                (&appended).into(),
                (&pool.cursors).into(),
                (&pool.nodes).into(),
            ];
            let group = bind(gpu, "gather", &self.pipelines.layouts.gather, &slots);
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("gather"),
                timestamp_writes: timing.compute("gather"),
            });
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &group, &[]);
            let groups = pool.capacity.div_ceil(256).max(1) as u32;
            let x = groups.min(gpu.limits.max_compute_workgroups_per_dimension);
            pass.dispatch_workgroups(x, groups.div_ceil(x), 1);
            Ok(())
        })?;
        self.resolve(encoder, &timing, pool, &band, rect, output)
    }

    /// Two passes: counted, then scanned, then scattered to where each list has exactly its room.
    fn scatter(
        &self,
        pool: &mut Pool,
        budget: &Budget,
        rect: Rect,
        output: &mut Output<f32>,
    ) -> Result<Filled> {
        let timing = Timing::new(self.gpu);
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let band = self.band(pool, rect);
        let total = self.gpu.checked("counting fragments", || {
            encoder.clear_buffer(&pool.counter, 0, None);
            self.encode_count(&mut encoder, &pool.heads, &band, rect, &timing)?;
            // One more than pixels: where the last list ends.
            scan::encode(self, &mut encoder, &pool.heads, rect.pixels() as u32 + 1, &pool.counter, &timing)?;
            encoder.copy_buffer_to_buffer(&pool.heads, 0, &pool.cursors, 0, 4 * rect.pixels());
            Ok(copied(self.gpu, &mut encoder, &pool.counter, 8))
        })?;
        let words = self.submit(encoder, &timing, &[&total], &mut output.stats)?.remove(0);
        let nodes = u64::from(words[1]) << 32 | u64::from(words[0]);
        if nodes > budget.nodes {
            return Ok(Filled::Overflow { nodes });
        }
        pool.grow(self.gpu, nodes)?;
        let timing = Timing::new(self.gpu);
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let band = self.band(pool, rect);
        self.gpu.checked("scattering fragments", || {
            let group = bind(
                self.gpu,
                "scatter",
                &self.pipelines.layouts.scatter,
                &[(&band).into(), (&pool.cursors).into(), (&pool.nodes).into()],
            );
            self.encode_build(&mut encoder, BuildStage::Scatter, &group, rect, &timing)
        })?;
        self.resolve(encoder, &timing, pool, &band, rect, output)
    }

    /// Classifies what `encoder` fills, resolves the classes that there are, and places the results in the image.
    /// Between the two the host waits: what is not whole is not resolved, and a class that no list falls into is
    /// neither dispatched nor compiled, which for the longest takes seconds.
    fn resolve(
        &self,
        mut encoder: wgpu::CommandEncoder,
        timing: &Timing,
        pool: &Pool,
        band: &wgpu::Buffer,
        rect: Rect,
        output: &mut Output<f32>,
    ) -> Result<Filled> {
        let (gpu, variant) = (self.gpu, &self.pipelines.variant);
        let each = image_samples(variant);
        let read_group = self.read_group(pool, band);
        let [counter, classes] = gpu.checked("classifying pixels", || {
            encode_classify(self, &mut encoder, pool, &read_group, rect, timing)?;
            let counter = copied(gpu, &mut encoder, &pool.counter, 8);
            Ok([counter, copied(gpu, &mut encoder, &pool.classes, pool.classes.size())])
        })?;
        let words = self.submit(encoder, timing, &[&counter, &classes], &mut output.stats)?;
        let [low, high, ..] = *words[0].as_slice() else {
            return Err(Error::Device("the counter was not read back".into()));
        };
        let nodes = u64::from(high) << 32 | u64::from(low);
        if nodes > pool.capacity {
            return Ok(Filled::Overflow { nodes });
        }

        let found = Found::of(variant, &words[1])?;
        let mut timing = Timing::new(gpu);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        gpu.checked("resolving the lists", || {
            encode_classes(self, &mut encoder, pool, &read_group, rect, &found, &timing)
        })?;
        let mut dropped = 0;
        if let Some(long_lists) = found.long_lists() {
            self.submit(encoder, &timing, &[], &mut output.stats)?;
            dropped = long::resolve(self, pool, &read_group, long_lists, &mut output.stats)?;
            timing = Timing::new(gpu);
            encoder = gpu.device.create_command_encoder(&Default::default());
        }

        let mut copied = |buffer, bytes| copied(gpu, &mut encoder, buffer, bytes);
        let classes = copied(&pool.classes, pool.classes.size());
        let image = copied(&pool.image, 16 * each * rect.pixels());
        let counts = output.counts.is_some().then(|| copied(&pool.counts, 4 * rect.pixels()));
        let results: Vec<&wgpu::Buffer> = [&classes, &image].into_iter().chain(&counts).collect();
        let words = self.submit(encoder, &timing, &results, &mut output.stats)?;
        let outcome = Found::of(variant, &words[0])?.outcome(dropped);
        place(&words[1], &mut output.image, self.width, rect, each as usize);
        if let (Some(all), Some(counted)) = (&mut output.counts, words.get(2)) {
            place(counted, all, self.width, rect, 1);
        }
        Ok(Filled::Done { nodes, outcome })
    }
}
