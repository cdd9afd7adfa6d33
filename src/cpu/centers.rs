//! Rasterising with one sample a pixel, its centre, in either precision.

use std::ops::Range;

use super::coverage::Edges;
use super::entry::Listed;
use super::region::{Region, TILE};
use super::setup::{Record, pixel_range};
use super::tile::{Run, Scratch, Walk, offset, rank};
use crate::real::{Real, sort_key};

/// Pixels of a region's row, at most.
const SPAN: usize = TILE as usize;

impl<T: Real> Walk<'_, T> {
    /// Rasterises into runs and keys. `false` if there are more than `limit` fragments.
    pub fn emit_centers<L: Listed<T>>(
        &self,
        records: &[u32],
        region: Region,
        limit: usize,
        scratch: &mut Scratch<T, L>,
    ) -> bool {
        let Scratch { runs, keys, opaque, .. } = scratch;
        let record = |index: u32| &self.setup.records[index as usize];
        let mesh = |index: u32| &self.meshes[record(index).mesh as usize];
        let hides = |index: u32| self.hides && mesh(index).opaque;
        if self.hides && records.iter().any(|&index| hides(index)) {
            opaque.resize(region.pixels(), L::MAX);
            for &index in records.iter().filter(|&&index| hides(index)) {
                let cutoff = T::from_f64(mesh(index).alpha_cutoff);
                for_each_span(record(index), region, |x, y, pixel, len| {
                    let found = self.keys(record(index), x, y);
                    for i in (0..len).filter(|&i| self.passes(record(index), cutoff, x + i as i32, y, (0, 0)))
                    {
                        let nearest = &mut opaque[pixel + i];
                        *nearest = (*nearest).min(L::new(T::entry(found[i], rank(index, true)), 1));
                    }
                });
            }
        }
        for &index in records.iter().filter(|&&index| !hides(index)) {
            let rank = rank(index, self.list_opaque && mesh(index).opaque);
            let cutoff = if self.list_opaque { T::from_f64(mesh(index).alpha_cutoff) } else { T::ZERO };
            let whole = opaque.is_empty() && cutoff == T::ZERO;
            for_each_span(record(index), region, |x, y, pixel, len| {
                let found = self.keys(record(index), x, y);
                if whole {
                    runs.push(Run { pixel: pixel as u16, len: len as u16, rank });
                    // All, then cut: a copy of fixed length is a few instructions, any other a call.
                    let end = keys.len() + len;
                    keys.extend_from_slice(&found);
                    keys.truncate(end);
                    return;
                }
                for i in (0..len).filter(|&i| self.passes(record(index), cutoff, x + i as i32, y, (0, 0))) {
                    // A fragment at the opaque depth is kept.
                    if opaque.is_empty() || found[i] <= T::key_of(opaque[pixel + i].entry()) {
                        runs.push(Run { pixel: (pixel + i) as u16, len: 1, rank });
                        keys.push(found[i]);
                    }
                }
            });
            if keys.len() > limit {
                return false;
            }
        }
        true
    }

    /// Keys of `SPAN` pixels from (x, y) to the right, whatever the span's length: a fixed number becomes a
    /// few vector instructions. The projection is decided outside the loops for the same reason.
    #[inline]
    fn keys(&self, record: &Record<T>, x: i32, y: i32) -> [T::Key; SPAN] {
        let mut keys = [T::Key::default(); SPAN];
        // From the pixel itself, not by steps: a key must not depend on where its span begins.
        let value = |i: usize| {
            let (dx, dy) = offset(record, x + i as i32, y, (0, 0));
            record.key_plane.at(dx, dy)
        };
        if self.setup.perspective {
            for (i, key) in keys.iter_mut().enumerate() {
                *key = sort_key(value(i), true);
            }
        } else {
            for (i, key) in keys.iter_mut().enumerate() {
                *key = sort_key(value(i), false);
            }
        }
        keys
    }
}

/// Calls `span(x, y, pixel of the region, length)` for each row of pixel centres inside the record.
#[inline]
fn for_each_span<T>(record: &Record<T>, region: Region, mut span: impl FnMut(i32, i32, usize, usize)) {
    let ((x0, x1), (y0, y1)) = (pixel_range(record.x, false), pixel_range(record.y, false));
    let (from, to) = ((x0 - region.x0).max(0), (x1 + 1 - region.x0).min(region.w));
    let (first, last) = ((y0 - region.y0).max(0), (y1 + 1 - region.y0).min(region.h));
    if from >= to || first >= last {
        return;
    }
    let edges = Edges::new(record, region.x0, region.y0);
    let mut row = |j: i32, columns: Range<i32>| {
        let pixel = (j * region.w + columns.start) as usize;
        span(region.x0 + columns.start, region.y0 + j, pixel, columns.len());
    };
    if edges.contains(region.w, region.h) {
        (0..region.h).for_each(|j| row(j, 0..region.w));
    } else {
        edges.spans(from..to, first..last, row);
    }
}
