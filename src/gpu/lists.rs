//! The device's lists, brought back and into the same order and arrays as the CPU's.

use rayon::prelude::*;

use super::buffers::readable;
use super::device::Gpu;
use super::pool::{Pool, Rect};
use crate::error::{Error, Result};
use crate::fragments::{Extras, Fragments};
use crate::frame::out_of_memory;
use crate::real::depth_of_key;
use crate::threads::threads;

/// The sorted lists of one rectangle, pixel by pixel in its rows.
pub struct BandLists {
    rect: Rect,
    rows: Vec<RowLists>,
}

/// The lists of one row of a rectangle.
#[derive(Default)]
struct RowLists {
    counts: Vec<i32>,
    key: Vec<u32>,
    depth: Vec<f32>,
    color: Vec<[f32; 4]>,
    primitive: Vec<i32>,
}

impl BandLists {
    /// Reads `nodes` nodes and the heads of a rectangle, and walks the lists.
    pub fn read(gpu: &Gpu, pool: &Pool, rect: Rect, nodes: u64, perspective: bool) -> Result<Self> {
        let parts = [
            (&pool.heads, 4 * rect.pixels()),
            (&pool.node_color, 16 * nodes),
            (&pool.node_order, 8 * nodes),
            (&pool.node_next, 4 * nodes),
        ];
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let copies = gpu.checked("reading the lists", || {
            Ok(parts.map(|(source, bytes)| {
                let copy = readable(gpu, "lists", bytes);
                if bytes > 0 {
                    encoder.copy_buffer_to_buffer(source, 0, &copy, 0, bytes);
                }
                copy
            }))
        })?;
        let words = gpu.submit_and_read(encoder, &copies.each_ref())?;
        let [heads, color, order, next] = words.as_slice() else {
            return Err(Error::Device("the lists did not come back whole".into()));
        };
        // Buffers are never empty: what is beyond the nodes belongs to no list.
        let nodes = nodes as usize;
        let color: &[[f32; 4]] = bytemuck::cast_slice(&color[..4 * nodes]);
        let order: &[[u32; 2]] = bytemuck::cast_slice(&order[..2 * nodes]);
        let rows = threads()?.install(|| {
            heads[..rect.pixels() as usize]
                .par_chunks(rect.w as usize)
                .map(|heads| RowLists::walk(heads, color, order, next, perspective))
                .collect()
        });
        Ok(Self { rect, rows })
    }
}

impl RowLists {
    fn walk(heads: &[u32], color: &[[f32; 4]], order: &[[u32; 2]], next: &[u32], perspective: bool) -> Self {
        let mut row = Self::default();
        let mut list = Vec::new();
        for &head in heads {
            list.clear();
            let mut link = head;
            // Links hold an index plus one, and 0 at the end.
            while let Some(node) = link.checked_sub(1) {
                list.push((order[node as usize], node));
                link = next[node as usize];
            }
            list.sort_unstable();
            row.counts.push(list.len() as i32);
            for &([key, order], node) in &list {
                row.key.push(key);
                row.depth.push(depth_of_key(key, perspective));
                row.color.push(color[node as usize]);
                row.primitive.push((!order & 0x7fff_ffff) as i32);
            }
        }
        row
    }
}

/// Puts the lists of all rectangles together, in the pixel order of the image.
pub fn assemble(bands: Vec<BandLists>, width: u32, height: u32) -> Result<Fragments<f32>> {
    let mut counts = vec![0; width as usize * height as usize];
    let start = |rect: &Rect, row: usize| (rect.y0 as usize + row) * width as usize + rect.x0 as usize;
    for band in &bands {
        for (i, row) in band.rows.iter().enumerate() {
            let at = start(&band.rect, i);
            counts[at..at + row.counts.len()].copy_from_slice(&row.counts);
        }
    }
    let mut all = Fragments::<f32>::with_counts(&counts, Extras { coverage: false, blend: false })
        .ok_or_else(|| out_of_memory("fragment lists", counts.iter().map(|&n| n as u64).sum::<u64>() * 28))?;
    for band in bands {
        for (i, row) in band.rows.into_iter().enumerate() {
            let first = all.offsets[start(&band.rect, i)] as usize;
            let part = first..first + row.key.len();
            all.key[part.clone()].copy_from_slice(&row.key);
            all.depth[part.clone()].copy_from_slice(&row.depth);
            all.color[part.clone()].copy_from_slice(&row.color);
            all.primitive[part].copy_from_slice(&row.primitive);
        }
    }
    Ok(all)
}
