//! Sorted lists of fragments, as the resolve leaves them (shaders/tiles/listed.wgsl), brought back into rows of pixels.

use rayon::prelude::*;

use super::image::values;
use crate::error::Result;
use crate::fragments::{Extras, Fragments};
use crate::gpu::buffers::storage;
use crate::gpu::device::Gpu;
use crate::gpu::readback::copied;
use crate::gpu::resolve::TILE;
use crate::memory::out_of_memory;
use crate::real::depth_of_key;
use crate::threads::threads;

/// A key, a primitive and a colour; and the colour alone, the larger buffer.
const FRAGMENT_BYTES: u64 = 24;
const COLOR_BYTES: u64 = 16;

pub struct Listed {
    /// Where each pixel's list begins.
    pub starts: wgpu::Buffer,
    /// Keys and primitives, and colours.
    pub fragments: wgpu::Buffer,
    pub colors: wgpu::Buffer,
    /// Fragments that there is room for.
    pub capacity: u32,
}

impl Listed {
    /// Room for a fragment a pixel, or what `memory` allows: the first frame shows how many there are.
    pub fn new(gpu: &Gpu, pixels: u64, memory: u64) -> Result<Self> {
        let starts = gpu.checked("the lists", || Ok(storage(gpu, "list starts", 4 * pixels)))?;
        let capacity = pixels.min(most(gpu, memory)).max(1) as u32;
        let (fragments, colors) = room(gpu, capacity)?;
        Ok(Self { starts, fragments, colors, capacity })
    }

    pub fn bytes(&self) -> [(&'static str, u64); 2] {
        [("nodes", self.fragments.size() + self.colors.size()), ("heads", self.starts.size())]
    }

    /// Makes room for so many fragments, no more; `false` if `memory` does not allow it.
    pub fn grow(&mut self, gpu: &Gpu, fragments: u32, memory: u64) -> Result<bool> {
        if u64::from(fragments) > most(gpu, memory) {
            return Ok(false);
        }
        self.hold(gpu, fragments)?;
        Ok(true)
    }

    fn hold(&mut self, gpu: &Gpu, fragments: u32) -> Result<()> {
        // The old ones go first: the two need not fit together.
        (self.fragments, self.colors) = room(gpu, 1)?;
        (self.fragments, self.colors) = room(gpu, fragments)?;
        self.capacity = fragments;
        Ok(())
    }

    /// Takes no more than `memory`.
    pub fn shrink(&mut self, gpu: &Gpu, memory: u64) -> Result<()> {
        let most = most(gpu, memory).max(1);
        if u64::from(self.capacity) <= most { Ok(()) } else { self.hold(gpu, most as u32) }
    }

    /// What a band left, of so many fragments with the empty places among them.
    pub fn read(&self, gpu: &Gpu, fragments: u32, end_row: u32) -> Result<ListedBand> {
        let n = u64::from(fragments);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let copies = gpu.checked("reading the lists", || {
            Ok([(&self.fragments, 8), (&self.colors, 16)]
                .map(|(of, each)| copied(gpu, &mut encoder, of, each * n)))
        })?;
        let mut words = gpu.submit_and_read(encoder, &copies.each_ref())?.into_iter();
        let n = fragments as usize;
        Ok(ListedBand {
            end_row: end_row * TILE,
            fragments: values(words.next(), n)?,
            colors: values(words.next(), n)?,
        })
    }
}

fn most(gpu: &Gpu, memory: u64) -> u64 {
    (memory / FRAGMENT_BYTES).min(gpu.adapter.max_binding / COLOR_BYTES)
}

fn room(gpu: &Gpu, fragments: u32) -> Result<(wgpu::Buffer, wgpu::Buffer)> {
    let n = u64::from(fragments);
    gpu.checked("the lists", || {
        let keys = storage(gpu, "listed fragments", (FRAGMENT_BYTES - COLOR_BYTES) * n);
        Ok((keys, storage(gpu, "listed colours", COLOR_BYTES * n)))
    })
}

/// The lists of the rows of pixels down to `end_row`, pixel by pixel in any order.
#[derive(Debug)]
pub struct ListedBand {
    end_row: u32,
    /// Keys and primitives.
    fragments: Vec<[u32; 2]>,
    colors: Vec<[f32; 4]>,
}

/// Puts the lists in the order of their pixels.
pub fn assemble(
    bands: &[ListedBand],
    starts: &[u32],
    counts: &[i32],
    width: u32,
    perspective: bool,
) -> Result<Fragments<f32>> {
    let extras = Extras { coverage: false, blend: false };
    let mut all = Fragments::<f32>::with_counts(counts, extras)
        .ok_or_else(|| out_of_memory("fragment lists", counts.iter().map(|&n| n as u64).sum::<u64>() * 28))?;
    let width = width as usize;
    let Fragments { offsets, depth, key, color, primitive, .. } = &mut all;
    let mut rest = (&mut depth[..], &mut key[..], &mut color[..], &mut primitive[..]);
    let mut rows = Vec::new();
    for first in (0..counts.len()).step_by(width) {
        let n = (offsets[first + width] - offsets[first]) as usize;
        let (depth, depths) = rest.0.split_at_mut(n);
        let (key, keys) = rest.1.split_at_mut(n);
        let (color, colors) = rest.2.split_at_mut(n);
        let (primitive, primitives) = rest.3.split_at_mut(n);
        rest = (depths, keys, colors, primitives);
        rows.push((first, depth, key, color, primitive));
    }
    threads()?.install(|| {
        rows.into_par_iter().for_each(|(first, depth, key, color, primitive)| {
            let row = (first / width) as u32;
            let Some(band) = bands.iter().find(|band| row < band.end_row) else {
                return; // of no band: there is none
            };
            let mut to = 0;
            for pixel in first..first + width {
                let n = counts[pixel] as usize;
                let (from, own) = (starts[pixel] as usize, to..to + n);
                color[own.clone()].copy_from_slice(&band.colors[from..from + n]);
                for (to, [k, id]) in own.zip(&band.fragments[from..from + n]) {
                    (key[to], primitive[to]) = (*k, *id as i32);
                }
                to += n;
            }
            depth.iter_mut().zip(&*key).for_each(|(depth, &key)| *depth = depth_of_key(key, perspective));
        });
    });
    Ok(all)
}
