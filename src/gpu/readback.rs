//! Submissions, and what comes back from them: the host may prepare the next while a device works on one.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use super::buffers::readable;
use super::device::Gpu;
use crate::error::{Error, Result};
use crate::memory::recycled::{self, Waiting};
use crate::threads::threads;

/// Bytes that one thread copies at a time.
const PART: usize = 1 << 20;

/// A buffer's bytes, as words, in pages that the process has, or that several threads touch first: half of the time goes
/// there.
fn copy_of(bytes: &[u8]) -> Result<Vec<u32>> {
    if bytes.len() <= PART {
        return Ok(bytemuck::pod_collect_to_vec(bytes));
    }
    let n = bytes.len() / 4;
    let mut words = recycled::room::<u32>("what a device returns", n)?;
    let unwritten = &mut words.spare_capacity_mut()[..n];
    threads()?.install(|| {
        unwritten.par_chunks_mut(PART / 4).zip(bytes.par_chunks(PART)).for_each(|(to, from)| {
            for (word, bytes) in to.iter_mut().zip(from.chunks_exact(4)) {
                word.write(u32::from_ne_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]));
            }
        });
    });
    // SAFETY: there is room for as many, and each has been written.
    unsafe { words.set_len(n) };
    Ok(words)
}

/// Buffers that the host has read, for the next copies: making one takes the system as long as filling it.
pub type Staging = Waiting<wgpu::Buffer>;

/// Of all that wait.
const MOST_STAGED: u64 = 512 << 20;
const MOST_BUFFERS: usize = 16;

pub fn staging() -> Staging {
    Waiting::new(wgpu::Buffer::size, MOST_STAGED, MOST_BUFFERS)
}

/// A copy of a buffer's beginning that the host can read, which may be a little longer.
pub fn copied(
    gpu: &Gpu,
    encoder: &mut wgpu::CommandEncoder,
    buffer: &wgpu::Buffer,
    bytes: u64,
) -> wgpu::Buffer {
    let copy = gpu.staging.take(bytes).unwrap_or_else(|| readable(gpu, "copy", bytes));
    if bytes > 0 {
        encoder.copy_buffer_to_buffer(buffer, 0, &copy, 0, bytes);
    }
    copy
}

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
            let words = |buffer: wgpu::Buffer| {
                let view = buffer
                    .get_mapped_range(..)
                    .map_err(|e| Error::Device(format!("reading results back failed: {e}")))?;
                let words = copy_of(&view)?;
                drop(view);
                buffer.unmap();
                gpu.staging.put(buffer);
                Ok(words)
            };
            self.buffers.into_iter().map(words).collect()
        })
    }
}
