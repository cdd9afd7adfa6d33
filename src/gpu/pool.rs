//! How much fits where: rectangles of the image, the pool of nodes that one is rendered with, and what
//! `memory=` and the device allow of both.

use super::buffers::storage;
use super::device::Gpu;
use crate::error::{Error, Result};

/// What heads, nodes and scratch may take together unless `memory=` says otherwise.
pub const DEFAULT_MEMORY: u64 = 2 << 30;
/// Bytes of a node: colour 16, key and order 8, next 4.
pub const NODE_BYTES: u64 = 28;
/// Bytes of scratch for a node of a long list: two entries, each padded to at most twice its number.
pub const SCRATCH_BYTES: u64 = 16;

/// A rectangle of pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rect {
    pub x0: u32,
    pub y0: u32,
    pub w: u32,
    pub h: u32,
}

impl Rect {
    pub fn pixels(&self) -> u64 {
        u64::from(self.w) * u64::from(self.h)
    }

    /// Two halves: bands of rows as long as there are some, then across. `None` for a pixel.
    pub fn halves(&self) -> Option<[Self; 2]> {
        if self.h > 1 {
            let h = self.h / 2;
            Some([Self { h, ..*self }, Self { y0: self.y0 + h, h: self.h - h, ..*self }])
        } else if self.w > 1 {
            let w = self.w / 2;
            Some([Self { w, ..*self }, Self { x0: self.x0 + w, w: self.w - w, ..*self }])
        } else {
            None
        }
    }
}

/// Buffers for the lists and results of one rectangle.
pub struct Pool {
    pub heads: wgpu::Buffer,
    pub counter: wgpu::Buffer,
    pub node_color: wgpu::Buffer,
    pub node_order: wgpu::Buffer,
    pub node_next: wgpu::Buffer,
    pub image: wgpu::Buffer,
    pub counts: wgpu::Buffer,
    /// A count, then pixels.
    pub long_pixels: wgpu::Buffer,
    pub pixels: u64,
    pub capacity: u64,
}

impl Pool {
    pub fn new(gpu: &Gpu, pixels: u64, capacity: u64) -> Result<Self> {
        gpu.checked("the node pool", || {
            Ok(Self {
                heads: storage(gpu, "heads", 4 * pixels),
                counter: storage(gpu, "counter", 8),
                node_color: storage(gpu, "node colours", 16 * capacity),
                node_order: storage(gpu, "node orders", 8 * capacity),
                node_next: storage(gpu, "node links", 4 * capacity),
                image: storage(gpu, "image", 16 * pixels),
                counts: storage(gpu, "counts", 4 * pixels),
                long_pixels: storage(gpu, "long pixels", 4 * (pixels + 1)),
                pixels,
                capacity,
            })
        })
    }

    /// Bytes of the lists.
    pub fn bytes(&self) -> u64 {
        4 * self.pixels + NODE_BYTES * self.capacity
    }
}

/// What `memory=` and the device allow.
pub struct Budget {
    /// Pixels of a rectangle: heads take at most a quarter of the memory.
    pub pixels: u64,
    /// Nodes of the pool.
    pub nodes: u64,
    /// Entries of scratch for long lists.
    pub scratch: u64,
    memory: u64,
    /// Nodes that the device can bind at once.
    bindable: u64,
}

impl Budget {
    pub fn of(gpu: &Gpu, memory: u64) -> Self {
        let binding = gpu.limits.max_storage_buffer_binding_size.min(gpu.limits.max_buffer_size);
        let affordable = (memory - memory / 4) / (NODE_BYTES + SCRATCH_BYTES);
        // Colours take 16 bytes a node, and links are 32 bits.
        let bindable = (binding / 16).min(u64::from(u32::MAX >> 1));
        Self {
            pixels: (memory / 16).min(binding / 16).max(1),
            nodes: affordable.min(bindable),
            scratch: (2 * affordable).max(1024).min(binding / 4),
            memory,
            bindable,
        }
    }

    /// Why a pixel with `demand` fragments cannot be rendered.
    pub fn exceeded(&self, rect: Rect, demand: u64) -> Error {
        let what = format!("the fragments of pixel [{}, {}]", rect.y0, rect.x0);
        if demand > self.bindable {
            let advice = "that is what this device binds at once; device=\"cpu\" has no such limit".into();
            return Error::Capacity { what, needed: 16 * demand, limit: 16 * self.bindable, advice };
        }
        // Three quarters of the memory are for nodes and their sorting.
        let needed = (demand * (NODE_BYTES + SCRATCH_BYTES)).div_ceil(3) * 4;
        Error::Capacity { what, needed, limit: self.memory, advice: "raise memory=".into() }
    }
}

/// Bands of whole rows with at most `pixels` pixels, the top one last.
pub fn first_rects(width: u32, height: u32, pixels: u64) -> Vec<Rect> {
    let w = u64::from(width).min(pixels.max(1)) as u32;
    let h = ((pixels / u64::from(w)).max(1)).min(u64::from(height)) as u32;
    let mut rects = Vec::new();
    for y0 in (0..height).step_by(h as usize) {
        for x0 in (0..width).step_by(w as usize) {
            rects.push(Rect { x0, y0, w: w.min(width - x0), h: h.min(height - y0) });
        }
    }
    rects.reverse();
    rects
}
