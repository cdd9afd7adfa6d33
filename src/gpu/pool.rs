//! How much fits where: rectangles of the image, the pool of nodes that one is rendered with, and what
//! `memory=` and the device allow of both.

use super::buffers::{indirect, storage};
use super::device::Gpu;
use super::rect::Rect;
use super::resolve::TILE;
use super::variant::Variant;
use crate::error::{Error, Result};
use crate::frame::{MsaaResolve, Storage};

/// What heads, nodes and scratch may take together unless `memory=` says otherwise.
pub const DEFAULT_MEMORY: u64 = 2 << 30;
/// Bytes of scratch for a node of a long list: two entries of four bytes, with room for what pads them. Lists that need
/// more, short ones with many samples, are sorted in more batches.
pub const SCRATCH_BYTES: u64 = 16;

/// Bytes of a pixel beside its nodes: head, cursor, and its place in a class, twice.
const PIXEL_BYTES: u64 = 16;

/// Buffers for the lists and results of one rectangle.
pub struct Pool {
    /// Linked: each pixel's latest node. Contiguous: where its list starts, one more than pixels.
    pub heads: wgpu::Buffer,
    /// Contiguous: where its next node goes.
    pub cursors: wgpu::Buffer,
    /// Nodes that were asked for: low word, and how often it wrapped.
    pub counter: wgpu::Buffer,
    pub nodes: wgpu::Buffer,
    /// Nodes before they are brought into lists, where that is done.
    pub appended: Option<wgpu::Buffer>,
    pub image: wgpu::Buffer,
    pub counts: wgpu::Buffer,
    pub classes: wgpu::Buffer,
    /// Pixels, class after class.
    pub class_pixels: wgpu::Buffer,
    /// Each pixel's place in its class.
    pub class_places: wgpu::Buffer,
    pub arguments: wgpu::Buffer,
    pub sample_colors: wgpu::Buffer,
    pub pixels: u64,
    pub capacity: u64,
    node_bytes: u64,
    pixel_bytes: u64,
}

/// Words of `Classes` in resolve/classify.wgsl.
pub fn class_words(variant: &Variant) -> u64 {
    2 * (variant.classes.len() as u64 + 1) + 3
}

/// Colours a pixel that a band returns.
pub fn image_samples(variant: &Variant) -> u64 {
    if variant.msaa == MsaaResolve::None { u64::from(variant.layout.samples) } else { 1 }
}

impl Pool {
    pub fn new(gpu: &Gpu, variant: &Variant, pixels: u64, capacity: u64) -> Result<Self> {
        let node_bytes = variant.layout.bytes();
        let slots = variant.classes.len() as u64 + 1;
        let contiguous = variant.storage == Storage::Contiguous;
        let apart = if variant.per_sample() { 16 * u64::from(variant.layout.samples) } else { 0 };
        gpu.checked("the node pool", || {
            Ok(Self {
                heads: storage(gpu, "heads", 4 * (pixels + 1)),
                cursors: storage(gpu, "cursors", if contiguous { 4 * pixels } else { 0 }),
                counter: storage(gpu, "counter", 8),
                nodes: storage(gpu, "nodes", node_bytes * capacity),
                appended: None,
                image: storage(gpu, "image", 16 * image_samples(variant) * pixels),
                counts: storage(gpu, "counts", 4 * pixels),
                classes: storage(gpu, "classes", 4 * class_words(variant)),
                class_pixels: storage(gpu, "class pixels", 4 * pixels),
                class_places: storage(gpu, "class places", 4 * pixels),
                arguments: indirect(gpu, "arguments", (12 + 16) * slots),
                sample_colors: storage(gpu, "sample colours", apart * pixels),
                pixels,
                capacity,
                node_bytes,
                pixel_bytes: if contiguous { 8 } else { 4 },
            })
        })
    }

    /// Makes room for `nodes` nodes.
    pub fn grow(&mut self, gpu: &Gpu, nodes: u64) -> Result<()> {
        if nodes > self.capacity {
            // The old ones go first: the two need not fit together.
            self.appended = None;
            self.nodes = gpu.checked("the node pool", || Ok(storage(gpu, "nodes", 0)))?;
            self.nodes =
                gpu.checked("the node pool", || Ok(storage(gpu, "nodes", self.node_bytes * nodes)))?;
            self.capacity = nodes;
        }
        Ok(())
    }

    /// A second buffer of nodes, as large as the first.
    pub fn appended(&mut self, gpu: &Gpu) -> Result<&wgpu::Buffer> {
        let made = match self.appended.take() {
            Some(buffer) => buffer,
            None => gpu.checked("the node pool", || {
                Ok(storage(gpu, "appended nodes", self.node_bytes * self.capacity))
            })?,
        };
        Ok(self.appended.insert(made))
    }

    /// Bytes of nodes, and of what each pixel has beside them.
    pub fn bytes(&self) -> [(&'static str, u64); 4] {
        [
            ("nodes", self.node_bytes * self.capacity * (1 + u64::from(self.appended.is_some()))),
            ("heads", self.pixel_bytes * self.pixels),
            ("image band", self.image.size() + self.counts.size() + self.sample_colors.size()),
            ("classes", 8 * self.pixels + self.classes.size() + self.arguments.size()),
        ]
    }
}

/// What `memory=` and the device allow.
pub struct Budget {
    /// Pixels of a rectangle: what each has beside its nodes takes at most a quarter of the memory.
    pub pixels: u64,
    /// Nodes of the pool.
    pub nodes: u64,
    /// Entries of scratch for long lists.
    pub scratch: u64,
    pub memory: u64,
    node_bytes: u64,
    /// Nodes that the device can bind at once, and links tell apart.
    bindable: u64,
}

impl Budget {
    /// Whether nodes may be held twice, appended and in lists.
    pub fn appends(&self, nodes: u64) -> bool {
        2 * nodes <= self.nodes
    }

    pub fn of(gpu: &Gpu, variant: &Variant, memory: u64) -> Self {
        let binding = gpu.limits.max_storage_buffer_binding_size.min(gpu.limits.max_buffer_size);
        let node_bytes = variant.layout.bytes();
        let affordable = (memory - memory / 4) / (node_bytes + SCRATCH_BYTES);
        let bindable = (binding / node_bytes).min(variant.layout.format.most_nodes());
        let colors =
            if variant.per_sample() { u64::from(variant.layout.samples) } else { image_samples(variant) };
        Self {
            pixels: (memory / 4 / PIXEL_BYTES)
                .min(binding / (16 * colors))
                .min(variant.layout.format.most_nodes())
                .max(1),
            nodes: affordable.min(bindable),
            scratch: (2 * affordable).max(1024).min(binding / 4),
            memory,
            node_bytes,
            bindable,
        }
    }

    /// Whether the pixels of one tile fit, of this rectangle.
    pub fn check(&self, rect: Rect) -> Result<()> {
        let tile = u64::from(rect.w.min(TILE)) * u64::from(rect.h.min(TILE));
        if self.memory / 4 / PIXEL_BYTES >= tile {
            return Ok(());
        }
        Err(Error::Capacity {
            what: format!("the list heads of {TILE}×{TILE} pixels"),
            needed: 4 * PIXEL_BYTES * tile,
            limit: self.memory,
            advice: "raise memory=".into(),
        })
    }

    /// Cuts a rectangle into bands whose fragments fit, by their exact number in each pixel: as few as whole rows
    /// allow, parts of rows where a row does not fit. Also gives each band's nodes. The top one is last.
    pub fn bands(&self, rect: Rect, counts: &[u32]) -> Result<Vec<(Rect, u64)>> {
        let mut bands: Vec<(Rect, u64)> = Vec::new();
        for (row, y0) in counts.chunks_exact(rect.w as usize).zip(rect.y0..) {
            let sum: u64 = row.iter().copied().map(u64::from).sum();
            let above = bands.last_mut().filter(|(band, _)| band.w == rect.w);
            if let Some((band, nodes)) = above
                && *nodes + sum <= self.nodes
            {
                band.h += 1;
                *nodes += sum;
            } else if sum <= self.nodes {
                bands.push((Rect { y0, h: 1, ..rect }, sum));
            } else {
                self.cut_row(rect.x0, y0, row, &mut bands)?;
            }
        }
        bands.reverse();
        Ok(bands)
    }

    /// Three quarters of the memory are for nodes and their sorting.
    fn memory_for(&self, nodes: u64) -> u64 {
        (nodes * (self.node_bytes + SCRATCH_BYTES)).div_ceil(3) * 4
    }

    fn cut_row(&self, x0: u32, y0: u32, row: &[u32], bands: &mut Vec<(Rect, u64)>) -> Result<()> {
        let mut part = Rect { x0, y0, w: 0, h: 1 };
        let mut nodes = 0;
        for (&count, x) in row.iter().zip(x0..) {
            let count = u64::from(count);
            if count > self.nodes {
                return Err(self.exceeded(x, y0, count));
            }
            if nodes + count > self.nodes {
                bands.push((part, nodes));
                (part, nodes) = (Rect { x0: x, w: 0, ..part }, 0);
            }
            part.w += 1;
            nodes += count;
        }
        bands.push((part, nodes));
        Ok(())
    }

    /// Why a pixel with so many fragments cannot be rendered.
    fn exceeded(&self, x: u32, y: u32, fragments: u64) -> Error {
        let what = format!("the fragments of pixel [{y}, {x}]");
        if fragments > self.bindable {
            return Error::Capacity {
                what,
                needed: self.node_bytes * fragments,
                limit: self.node_bytes * self.bindable,
                advice: "that is what this device binds at once, or the format's links tell apart; \
                         device=\"cpu\" has no such limit"
                    .into(),
            };
        }
        let needed = self.memory_for(fragments);
        Error::Capacity { what, needed, limit: self.memory, advice: "raise memory=".into() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn budget(nodes: u64) -> Budget {
        Budget { pixels: 100, nodes, scratch: 0, memory: 1 << 20, node_bytes: 28, bindable: 1000 }
    }

    const RECT: Rect = Rect { x0: 5, y0: 7, w: 3, h: 4 };

    #[test]
    fn bands_are_as_few_as_whole_rows_allow() {
        let counts = [1, 1, 1, 2, 2, 2, 0, 0, 0, 4, 0, 0];
        let bands = budget(9).bands(RECT, &counts).unwrap();
        assert_eq!(bands, [(Rect { y0: 10, h: 1, ..RECT }, 4), (Rect { h: 3, ..RECT }, 9)]);
    }

    #[test]
    fn a_row_that_does_not_fit_is_cut_and_bands_cover_everything_once() {
        let counts = [1, 0, 0, 5, 4, 6, 0, 0, 1, 0, 2, 0];
        let bands = budget(9).bands(RECT, &counts).unwrap();
        assert_eq!(bands.iter().map(|(rect, _)| rect.pixels()).sum::<u64>(), 12);
        assert_eq!(bands.iter().map(|(_, nodes)| nodes).sum::<u64>(), 19);
        assert!(bands.iter().all(|(_, nodes)| *nodes <= 9));
        assert!(bands.contains(&(Rect { x0: 5, y0: 8, w: 2, h: 1 }, 9)));
    }

    #[test]
    fn a_pixel_that_does_not_fit_is_an_error_that_names_it() {
        let mut counts = [0; 12];
        counts[4] = 10;
        let error = budget(9).bands(RECT, &counts).unwrap_err().to_string();
        assert!(error.contains("pixel [8, 6]"), "{error}");
    }

    #[test]
    fn parts_cover_a_rectangle_once_and_start_at_the_top() {
        for pixels in [1, 2, 3, 5, 7, 100] {
            let parts = RECT.parts(pixels);
            assert_eq!(parts.iter().map(Rect::pixels).sum::<u64>(), 12);
            assert!(parts.iter().all(|p| p.pixels() <= pixels));
            assert_eq!((parts[parts.len() - 1].x0, parts[parts.len() - 1].y0), (5, 7));
        }
    }
}
