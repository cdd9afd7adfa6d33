//! Rasterising with several samples a pixel (GPU Pro 2, section 2.7): one fragment a triangle and pixel, with a
//! mask of the samples that it covers.

use super::coverage::Edges;
use super::entry::{Listed, covered, location};
use super::region::{Region, TILE};
use super::setup::{Record, pixel_range};
use super::tile::{Run, Scratch, Walk, offset, rank};
use crate::real::{Real, sort_key};
use crate::samples::Offset;

/// In a pixel's mask while a triangle is rasterised: the centre is covered too.
const CENTER_BIT: u32 = 1 << 16;

/// The masks of one triangle in a region.
struct Masks {
    bits: [u32; (TILE * TILE) as usize],
    /// First and one past the last column and row that may be covered.
    columns: (i32, i32),
    rows: (i32, i32),
}

impl Masks {
    /// The union over the pieces of one triangle.
    fn of<'r, T: Real>(
        pieces: impl Iterator<Item = &'r Record<T>>,
        region: Region,
        pattern: &[Offset],
    ) -> Self {
        let none = (i32::MAX, i32::MIN);
        let mut masks = Self { bits: [0; (TILE * TILE) as usize], columns: none, rows: none };
        for record in pieces {
            let ((x0, x1), (y0, y1)) = (pixel_range(record.x, true), pixel_range(record.y, true));
            let (from, to) = ((x0 - region.x0).max(0), (x1 + 1 - region.x0).min(region.w));
            let (first, last) = ((y0 - region.y0).max(0), (y1 + 1 - region.y0).min(region.h));
            if from >= to || first >= last {
                continue;
            }
            let join = |a: (i32, i32), b: (i32, i32)| (a.0.min(b.0), a.1.max(b.1));
            masks.columns = join(masks.columns, (from, to));
            masks.rows = join(masks.rows, (first, last));
            let edges = Edges::new(record, region.x0, region.y0);
            let mut mark = |edges: Edges, bit: u32| {
                edges.spans(from..to, first..last, |j, columns| {
                    let row = (j * region.w) as usize;
                    let span = row + columns.start as usize..row + columns.end as usize;
                    masks.bits[span].iter_mut().for_each(|mask| *mask |= bit);
                });
            };
            for (s, &at) in pattern.iter().enumerate() {
                mark(edges.at(at), 1 << s);
            }
            mark(edges, CENTER_BIT);
        }
        masks
    }

    /// Calls `visit(x, y, pixel of the region, mask, word)` for each pixel with a covered sample.
    fn each(&self, region: Region, mut visit: impl FnMut(i32, i32, usize, u32, u32)) {
        for j in self.rows.0..self.rows.1 {
            for i in self.columns.0..self.columns.1 {
                let pixel = (j * region.w + i) as usize;
                let mask = self.bits[pixel] & !CENTER_BIT;
                if mask != 0 {
                    let word = covered(mask, self.bits[pixel] & CENTER_BIT != 0);
                    visit(region.x0 + i, region.y0 + j, pixel, mask, word);
                }
            }
        }
    }
}

/// The samples of a mask.
fn each_sample(mask: u32) -> impl Iterator<Item = usize> {
    (0..16).filter(move |s| mask >> s & 1 == 1)
}

impl<T: Real> Walk<'_, T> {
    /// Rasterises into runs of one pixel, keys and masks. `false` if there are more than `limit` fragments.
    pub fn emit_samples<L: Listed<T>>(
        &self,
        records: &[u32],
        region: Region,
        limit: usize,
        scratch: &mut Scratch<T, L>,
    ) -> bool {
        let Scratch { runs, keys, coverage, opaque, .. } = scratch;
        let samples = self.pattern.len();
        let record = |index: u32| &self.setup.records[index as usize];
        let mesh = |index: u32| &self.meshes[record(index).mesh as usize];
        let hides = |index: u32| self.hides && mesh(index).opaque;
        // Pieces of a triangle lie one after the other.
        let triangles = || records.chunk_by(|&a, &b| record(a).primitive == record(b).primitive);
        let masks = |pieces: &[u32]| Masks::of(pieces.iter().map(|&i| record(i)), region, self.pattern);
        if records.iter().any(|&index| hides(index)) {
            opaque.resize(region.pixels() * samples, L::MAX);
            for pieces in triangles().filter(|pieces| hides(pieces[0])) {
                let first = pieces[0];
                let cutoff = T::from_f64(mesh(first).alpha_cutoff);
                masks(pieces).each(region, |x, y, pixel, mask, word| {
                    if self.passes(record(first), cutoff, x, y, location(word, self.pattern)) {
                        for s in each_sample(mask) {
                            let key = self.key(record(first), x, y, self.pattern[s]);
                            let nearest = &mut opaque[pixel * samples + s];
                            *nearest = (*nearest).min(L::new(T::entry(key, rank(first, true)), word));
                        }
                    }
                });
            }
        }
        for pieces in triangles().filter(|pieces| !hides(pieces[0])) {
            let first = pieces[0];
            let listed_opaque = self.list_opaque && mesh(first).opaque;
            let cutoff = if listed_opaque { T::from_f64(mesh(first).alpha_cutoff) } else { T::ZERO };
            let rank = rank(first, listed_opaque);
            masks(pieces).each(region, |x, y, pixel, mask, word| {
                let at = location(word, self.pattern);
                if !self.passes(record(first), cutoff, x, y, at) {
                    return;
                }
                // Opaque surfaces hide samples, not pixels. What lies at their depth is kept.
                let hidden = |s: &usize| {
                    let nearest = opaque.get(pixel * samples + s);
                    nearest.is_some_and(|l| {
                        self.key(record(first), x, y, self.pattern[*s]) > T::key_of(l.entry())
                    })
                };
                let hidden = each_sample(mask).filter(hidden).fold(0, |bits, s| bits | 1 << s);
                if mask & !hidden != 0 {
                    runs.push(Run { pixel: pixel as u16, len: 1, rank });
                    keys.push(self.key(record(first), x, y, at));
                    coverage.push(word & !hidden);
                }
            });
            if keys.len() > limit {
                return false;
            }
        }
        true
    }

    fn key(&self, record: &Record<T>, x: i32, y: i32, at: Offset) -> T::Key {
        let (dx, dy) = offset(record, x, y, at);
        sort_key(record.key_plane.at(dx, dy), self.setup.perspective)
    }
}
