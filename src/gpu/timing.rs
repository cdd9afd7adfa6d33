//! GPU time of passes, by timestamp queries where the device has them.

use std::borrow::Cow;
use std::cell::Cell;

use super::buffers::readable;
use super::device::Gpu;

/// Passes of one submission that can be timed.
const MAX_PASSES: u32 = 64;

/// Hands out timestamps for the passes of one command encoder.
pub struct Timing {
    queries: Option<(wgpu::QuerySet, wgpu::Buffer, wgpu::Buffer)>,
    stages: std::cell::RefCell<Vec<Cow<'static, str>>>,
    used: Cell<u32>,
    most: u32,
    period_ns: f32,
}

impl Timing {
    pub fn new(gpu: &Gpu) -> Self {
        Self::of(gpu, MAX_PASSES)
    }

    /// Of more passes than most frames have.
    pub fn of(gpu: &Gpu, most: u32) -> Self {
        let bytes = u64::from(2 * most) * 8;
        let queries = gpu.features.contains(wgpu::Features::TIMESTAMP_QUERY).then(|| {
            let set = gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("timestamps"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * most,
            });
            let resolved = gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("timestamps"),
                size: bytes,
                usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            });
            (set, resolved, readable(gpu, "timestamps", bytes))
        });
        let period_ns = gpu.queue.get_timestamp_period();
        Self { queries, stages: Default::default(), used: Cell::new(0), most, period_ns }
    }

    fn next(&self, stage: impl Into<Cow<'static, str>>) -> Option<(&wgpu::QuerySet, u32)> {
        let (set, ..) = self.queries.as_ref()?;
        let pass = self.used.get();
        (pass < self.most).then(|| {
            self.used.set(pass + 1);
            self.stages.borrow_mut().push(stage.into());
            (set, 2 * pass)
        })
    }

    pub fn render(&self, stage: impl Into<Cow<'static, str>>) -> Option<wgpu::RenderPassTimestampWrites<'_>> {
        self.next(stage).map(|(query_set, first)| wgpu::RenderPassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + 1),
        })
    }

    pub fn compute(
        &self,
        stage: impl Into<Cow<'static, str>>,
    ) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        self.next(stage).map(|(query_set, first)| wgpu::ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + 1),
        })
    }

    /// Copies what was recorded to where it can be read; the buffer to read, if any.
    pub fn finish(&self, encoder: &mut wgpu::CommandEncoder) -> Option<&wgpu::Buffer> {
        let (set, resolved, readable) = self.queries.as_ref()?;
        let used = 2 * self.used.get();
        (used > 0).then(|| {
            encoder.resolve_query_set(set, 0..used, resolved, 0);
            encoder.copy_buffer_to_buffer(resolved, 0, readable, 0, u64::from(used) * 8);
            readable
        })
    }

    /// What `finish` copied to.
    pub fn buffer(&self) -> Option<&wgpu::Buffer> {
        self.queries.as_ref().map(|(_, _, readable)| readable)
    }

    /// Milliseconds from the first begin to the last end.
    pub fn span(&self, words: &[u32]) -> Option<f64> {
        let used = 4 * self.used.get() as usize;
        let tick = |w: &[u32]| u64::from(w[1]) << 32 | u64::from(w[0]);
        let ticks: Vec<u64> = words[..used.min(words.len())].chunks_exact(2).map(tick).collect();
        let (first, last) = (ticks.iter().min()?, ticks.iter().max()?);
        Some((last - first) as f64 * f64::from(self.period_ns) * 1e-6)
    }

    /// Milliseconds of each timed pass.
    pub fn read(&self, words: &[u32]) -> Vec<(Cow<'static, str>, f64)> {
        let tick = |w: &[u32]| u64::from(w[1]) << 32 | u64::from(w[0]);
        let ms = |t: &[u32]| tick(&t[2..]).saturating_sub(tick(t)) as f64 * f64::from(self.period_ns) * 1e-6;
        self.stages.borrow().iter().cloned().zip(words.chunks_exact(4).map(ms)).collect()
    }
}
