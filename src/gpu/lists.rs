//! The device's lists, brought back and into the same order and arrays as the CPU's.

use rayon::prelude::*;

use super::device::Gpu;
use super::pool::Pool;
use super::readback::copied;
use super::rect::Rect;
use crate::error::{Error, Result};
use crate::fragments::{Extras, Fragments};
use crate::frame::Storage;
use crate::memory::out_of_memory;
use crate::node_format::{Decoded, DepthCodes, NodeLayout};
use crate::real::depth_of_key;
use crate::threads::threads;

/// How nodes are read back.
pub struct Reader<'a> {
    pub gpu: &'a Gpu,
    pub layout: NodeLayout,
    pub storage: Storage,
    pub codes: DepthCodes,
}

/// The sorted lists of one rectangle, pixel by pixel in its rows.
pub struct BandLists {
    rect: Rect,
    rows: Vec<RowLists>,
}

/// The lists of one row of a rectangle.
#[derive(Default)]
struct RowLists {
    counts: Vec<i32>,
    fragments: Vec<Decoded>,
}

impl Reader<'_> {
    /// Reads `nodes` nodes and the heads of a rectangle, and walks the lists.
    pub fn read(&self, pool: &Pool, rect: Rect, nodes: u64) -> Result<BandLists> {
        let gpu = self.gpu;
        let parts = [(&pool.heads, 4 * (rect.pixels() + 1)), (&pool.nodes, self.layout.bytes() * nodes)];
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let copies = gpu.checked("reading the lists", || {
            Ok(parts.map(|(source, bytes)| copied(gpu, &mut encoder, source, bytes)))
        })?;
        let words = gpu.submit_and_read(encoder, &copies.each_ref())?;
        let [heads, nodes] = words.as_slice() else {
            return Err(Error::Device("the lists did not come back whole".into()));
        };
        let width = rect.w as usize;
        let rows = threads()?.install(|| {
            (0..rect.h as usize)
                .into_par_iter()
                .map(|row| self.row(&heads[row * width..=(row + 1) * width], nodes))
                .collect()
        });
        Ok(BandLists { rect, rows })
    }

    /// The lists of a row, whose heads come with one more.
    fn row(&self, heads: &[u32], nodes: &[u32]) -> RowLists {
        let words = self.layout.words() as usize;
        let node = |i: u32| &nodes[i as usize * words..(i as usize + 1) * words];
        let mut row = RowLists::default();
        for head in heads.windows(2) {
            let first = row.fragments.len();
            let mut keep = |i: u32| row.fragments.push(self.layout.decode(node(i), &self.codes));
            match self.storage {
                Storage::Contiguous => (head[0]..head[1]).for_each(keep),
                Storage::Linked => {
                    // Links hold an index plus one, and 0 at the end.
                    let mut link = head[0];
                    while let Some(i) = link.checked_sub(1) {
                        keep(i);
                        link = self.layout.next(node(i));
                    }
                }
            }
            row.fragments[first..].sort_unstable_by_key(|f| (f.code, f.order));
            if self.layout.samples > 1 {
                merge_pieces(&mut row.fragments, first);
            }
            row.counts.push((row.fragments.len() - first) as i32);
        }
        row
    }

    /// Puts the lists of all rectangles together, in the pixel order of the image.
    pub fn assemble(&self, bands: Vec<BandLists>, width: u32, height: u32) -> Result<Fragments<f32>> {
        let mut counts = vec![0; width as usize * height as usize];
        let start = |rect: &Rect, row: usize| (rect.y0 as usize + row) * width as usize + rect.x0 as usize;
        let mut rows: Vec<(usize, &RowLists)> = Vec::new();
        for band in &bands {
            for (i, row) in band.rows.iter().enumerate() {
                let at = start(&band.rect, i);
                counts[at..at + row.counts.len()].copy_from_slice(&row.counts);
                rows.push((at, row));
            }
        }
        let extras = Extras { coverage: self.layout.samples > 1, blend: self.layout.mixed };
        let mut all = Fragments::<f32>::with_counts(&counts, extras).ok_or_else(|| {
            out_of_memory("fragment lists", counts.iter().map(|&n| n as u64).sum::<u64>() * 28)
        })?;
        // In the order of their pixels each row's fragments are the next part of every array.
        rows.sort_unstable_by_key(|(at, _)| *at);
        let rows: Vec<&[Decoded]> = rows.iter().map(|(_, row)| row.fragments.as_slice()).collect();
        let perspective = self.codes.perspective;
        threads()?.install(|| {
            fill(&mut all.key, &rows, |f| f.key);
            fill(&mut all.depth, &rows, |f| depth_of_key(f.key, perspective));
            fill(&mut all.color, &rows, |f| f.color);
            fill(&mut all.primitive, &rows, |f| f.primitive);
            if let Some(coverage) = &mut all.coverage {
                fill(coverage, &rows, |f| f.coverage);
            }
            if let Some(blend) = &mut all.blend {
                fill(blend, &rows, |f| f.mode);
            }
        });
        Ok(all)
    }
}

/// Writes one value of every fragment, row after row.
fn fill<V: Send>(array: &mut [V], rows: &[&[Decoded]], value: impl Fn(&Decoded) -> V + Sync) {
    let mut rest = array;
    let mut parts = Vec::with_capacity(rows.len());
    for row in rows {
        let (part, tail) = std::mem::take(&mut rest).split_at_mut(row.len());
        parts.push(part);
        rest = tail;
    }
    parts.into_par_iter().zip(rows).for_each(|(part, row)| {
        part.iter_mut().zip(*row).for_each(|(slot, fragment)| *slot = value(fragment));
    });
}

/// Hardware may cut a triangle into pieces that meet inside a pixel: they share key and order, and each has some of
/// the samples. One fragment has them all.
fn merge_pieces(fragments: &mut Vec<Decoded>, first: usize) {
    let mut kept = first;
    for i in first..fragments.len() {
        let own = fragments[i];
        match fragments[first..kept].last_mut() {
            Some(last) if (last.code, last.order) == (own.code, own.order) => last.coverage |= own.coverage,
            _ => {
                fragments[kept] = own;
                kept += 1;
            }
        }
    }
    fragments.truncate(kept);
}
