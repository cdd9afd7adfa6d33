//! Submissions, and what comes back from them: the host may prepare the next while a device works on one.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::device::Gpu;
use crate::error::{Error, Result};

/// Work that a device has been given, and the buffers that are read when it is done.
pub struct Submitted {
    index: wgpu::SubmissionIndex,
    buffers: Vec<wgpu::Buffer>,
    failed: Arc<AtomicBool>,
}

impl Gpu {
    /// Submits, and asks for the contents of mappable buffers.
    pub fn submit(&self, encoder: wgpu::CommandEncoder, buffers: Vec<wgpu::Buffer>) -> Result<Submitted> {
        self.checked("a submission", || {
            let index = self.queue.submit([encoder.finish()]);
            let failed = Arc::new(AtomicBool::new(false));
            for buffer in &buffers {
                let failed = failed.clone();
                buffer.map_async(wgpu::MapMode::Read, .., move |result| {
                    failed.fetch_or(result.is_err(), Ordering::Relaxed);
                });
            }
            Ok(Submitted { index, buffers, failed })
        })
    }

    /// Submits, waits, and returns the contents of mappable buffers.
    pub fn submit_and_read(
        &self,
        encoder: wgpu::CommandEncoder,
        buffers: &[&wgpu::Buffer],
    ) -> Result<Vec<Vec<u32>>> {
        self.submit(encoder, buffers.iter().map(|&b| b.clone()).collect())?.read(self)
    }
}

impl Submitted {
    /// Waits for this work, not for what was submitted since. Contents are words: bytes may lie at any address.
    pub fn read(self, gpu: &Gpu) -> Result<Vec<Vec<u32>>> {
        let name = &gpu.adapter.name;
        gpu.checked("reading results back", || {
            let poll = wgpu::PollType::Wait { submission_index: Some(self.index), timeout: None };
            gpu.device.poll(poll).map_err(|e| Error::Device(format!("waiting for {name} failed: {e}")))?;
            if self.failed.load(Ordering::Relaxed) {
                gpu.alive()?;
                return Err(Error::Device(format!("reading results back from {name} failed")));
            }
            let words = |buffer: &wgpu::Buffer| {
                let view = buffer
                    .get_mapped_range(..)
                    .map_err(|e| Error::Device(format!("reading results back failed: {e}")))?;
                let words = bytemuck::pod_collect_to_vec(&view);
                drop(view);
                buffer.unmap();
                Ok(words)
            };
            self.buffers.iter().map(words).collect()
        })
    }
}
