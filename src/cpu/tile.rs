//! One tile: rasterise its triangles into fragments, bring them into pixel order by a counting sort, and
//! sort each pixel's list. What becomes of the lists is the visitor's business.

use std::sync::{Mutex, PoisonError};

use super::coverage::Edges;
use super::setup::{FLAT, Record, Setup};
use crate::error::{Error, Result};
use crate::real::{Real, sort_key};
use crate::scene::Mesh;

/// A rectangle of pixels, at most one tile.
#[derive(Debug, Clone, Copy)]
pub struct Region {
    pub x0: i32,
    pub y0: i32,
    pub w: i32,
    pub h: i32,
}

impl Region {
    fn pixels(&self) -> usize {
        (self.w * self.h) as usize
    }

    /// Two halves, across the longer side.
    fn halves(&self) -> [Self; 2] {
        if self.w >= self.h {
            let w = self.w / 2;
            [Self { w, ..*self }, Self { x0: self.x0 + w, w: self.w - w, ..*self }]
        } else {
            let h = self.h / 2;
            [Self { h, ..*self }, Self { y0: self.y0 + h, h: self.h - h, ..*self }]
        }
    }
}

/// A fragment in a sorted list: its key, then its rank, smaller in front.
///
/// The rank is the complement of the record, so that later triangles win ties; its top bit puts an
/// opaque fragment behind translucent ones at the same depth.
pub type Entry<K> = (K, u32);

const OPAQUE_BIT: u32 = 1 << 31;

fn rank(record: u32, opaque: bool) -> u32 {
    (!record & !OPAQUE_BIT) | if opaque { OPAQUE_BIT } else { 0 }
}

/// The record that a rank was made from.
pub fn record_of(rank: u32) -> usize {
    (!rank & !OPAQUE_BIT) as usize
}

/// Fragments are held this many at a time; a region with more is halved, down to one pixel.
/// 65,536 keep a thread's buffers (20 bytes each in float32) near the second-level cache.
pub const FRAGMENTS_AT_ONCE: usize = 1 << 16;

/// A thread's buffers, reused from tile to tile.
#[derive(Debug, Default)]
pub struct Scratch<K> {
    emitted: Vec<(u32, K, u32)>,
    sorted: Vec<Entry<K>>,
    /// First sorted entry of each pixel, and one past the last.
    starts: Vec<u32>,
    opaque: Vec<Entry<K>>,
}

impl<K> Scratch<K> {
    pub fn bytes(&self) -> u64 {
        (self.emitted.capacity() * size_of::<(u32, K, u32)>()
            + (self.sorted.capacity() + self.opaque.capacity()) * size_of::<Entry<K>>()
            + self.starts.capacity() * size_of::<u32>()) as u64
    }
}

/// What all tiles share.
pub struct Walk<'a, T> {
    pub setup: &'a Setup<T>,
    pub meshes: &'a [Mesh<'a>],
    /// Opaque surfaces are listed like any other and hide nothing.
    pub list_opaque: bool,
    /// Scratch bytes that one thread may hold.
    pub scratch_bytes: u64,
    /// Bytes that a single pixel may take where that is too little: whoever holds the lock uses them.
    pub deep_pixel: Mutex<u64>,
}

/// One pixel's fragments, front to back.
pub struct Pixel<'a, K> {
    pub x: i32,
    pub y: i32,
    pub entries: &'a [Entry<K>],
    /// The nearest opaque surface.
    pub opaque: Option<Entry<K>>,
}

impl<T: Real> Walk<'_, T> {
    /// Straight RGBA of a record at a pixel's centre. An opaque surface has alpha 1.
    pub fn color(&self, rank: u32, x: i32, y: i32) -> [T; 4] {
        let record = &self.setup.records[record_of(rank)];
        let mut color = self.raw_color(record, x, y);
        if self.meshes[record.mesh as usize].opaque {
            color[3] = T::ONE;
        }
        color
    }

    fn raw_color(&self, record: &Record<T>, x: i32, y: i32) -> [T; 4] {
        if record.gradient == FLAT {
            return record.color;
        }
        let planes = &self.setup.gradients[record.gradient as usize];
        let (dx, dy) = offset(record, x, y);
        if !self.setup.perspective {
            return planes.map(|p| p.at(dx, dy));
        }
        let w = T::ONE / record.key_plane.at(dx, dy);
        planes.map(|p| (p.unclamped(dx, dy) * w).clamped(p.low, p.high))
    }

    /// Visits every pixel of the region once, in no promised order, with its sorted fragments.
    pub fn visit(
        &self,
        records: &[u32],
        region: Region,
        scratch: &mut Scratch<T::Key>,
        visitor: &mut impl FnMut(Pixel<T::Key>),
    ) -> Result<()> {
        let entry_bytes = (size_of::<(u32, T::Key, u32)>() + size_of::<Entry<T::Key>>()) as u64;
        let limit = ((self.scratch_bytes / entry_bytes) as usize).min(FRAGMENTS_AT_ONCE);
        if self.emit(records, region, limit, scratch) {
            self.hand_out(region, scratch, visitor);
        } else if region.pixels() > 1 {
            for half in region.halves() {
                self.visit(records, half, scratch, visitor)?;
            }
        } else {
            let bytes = self.deep_pixel.lock().unwrap_or_else(PoisonError::into_inner);
            if !self.emit(records, region, (*bytes / entry_bytes) as usize, scratch) {
                return Err(Error::Capacity {
                    what: format!("the fragment list of pixel [{}, {}]", region.y0, region.x0),
                    needed: entry_bytes * scratch.emitted.len() as u64,
                    limit: *bytes,
                    advice: "raise memory=".into(),
                });
            }
            self.hand_out(region, scratch, visitor);
            *scratch = Scratch::default(); // as large as this pixel: not for keeps
        }
        Ok(())
    }

    /// Sorts what was emitted, and calls the visitor for each pixel.
    fn hand_out(
        &self,
        region: Region,
        scratch: &mut Scratch<T::Key>,
        visitor: &mut impl FnMut(Pixel<T::Key>),
    ) {
        self.bring_into_pixel_order(region, scratch);
        for p in 0..region.pixels() {
            let list = &mut scratch.sorted[scratch.starts[p] as usize..scratch.starts[p + 1] as usize];
            let kept = self.sort(list);
            let opaque = scratch.opaque.get(p).copied().filter(|&(_, rank)| rank != NO_OPAQUE);
            let (x, y) = (region.x0 + p as i32 % region.w, region.y0 + p as i32 / region.w);
            visitor(Pixel { x, y, entries: &list[..kept], opaque });
        }
    }

    /// Rasterises into `scratch.emitted`. `false` if there are more than `limit` fragments.
    fn emit(&self, records: &[u32], region: Region, limit: usize, scratch: &mut Scratch<T::Key>) -> bool {
        scratch.emitted.clear();
        scratch.opaque.clear();
        let hides = |r: &Record<T>| !self.list_opaque && self.meshes[r.mesh as usize].opaque;
        if !self.list_opaque && records.iter().any(|&i| hides(&self.setup.records[i as usize])) {
            scratch.opaque.resize(region.pixels(), (T::MAX_KEY, NO_OPAQUE));
            for &index in records {
                let record = &self.setup.records[index as usize];
                if hides(record) {
                    self.rasterise(record, region, |pixel, key| {
                        let nearest = &mut scratch.opaque[pixel as usize];
                        *nearest = (*nearest).min((key, rank(index, false)));
                    });
                }
            }
        }
        for &index in records {
            let record = &self.setup.records[index as usize];
            if hides(record) {
                continue;
            }
            let rank = rank(index, self.meshes[record.mesh as usize].opaque);
            let emitted = &mut scratch.emitted;
            if scratch.opaque.is_empty() {
                self.rasterise(record, region, |pixel, key| emitted.push((pixel, key, rank)));
            } else {
                let opaque = &scratch.opaque;
                self.rasterise(record, region, |pixel, key| {
                    // A fragment at the opaque depth is kept.
                    if key <= opaque[pixel as usize].0 {
                        emitted.push((pixel, key, rank));
                    }
                });
            }
            if emitted.len() > limit {
                return false;
            }
        }
        true
    }

    /// Calls `covered(pixel of the region, key)` for each pixel centre inside the record.
    #[inline]
    fn rasterise(&self, record: &Record<T>, region: Region, mut covered: impl FnMut(u32, T::Key)) {
        let x = record.x.map(|v| (v >> 8) - region.x0);
        let y = record.y.map(|v| (v >> 8) - region.y0);
        // A vertex in pixel i can cover no centre left of i, nor right of it.
        let from = x[0].min(x[1]).min(x[2]).max(0);
        let to = (x[0].max(x[1]).max(x[2]) + 1).min(region.w);
        let first = y[0].min(y[1]).min(y[2]).max(0);
        let last = (y[0].max(y[1]).max(y[2]) + 1).min(region.h);
        if from >= to || first >= last {
            return;
        }
        let edges = Edges::new(record, region.x0, region.y0);
        let all = edges.contains(region.w, region.h);
        let cutoff = T::from_f64(self.meshes[record.mesh as usize].alpha_cutoff);
        for j in first..last {
            let span = if all { 0..region.w } else { edges.span(j, from, to) };
            let row = j * region.w;
            for i in span {
                let (dx, dy) = offset(record, region.x0 + i, region.y0 + j);
                if cutoff > T::ZERO && self.raw_color(record, region.x0 + i, region.y0 + j)[3] < cutoff {
                    continue;
                }
                covered((row + i) as u32, sort_key(record.key_plane.at(dx, dy), self.setup.perspective));
            }
        }
    }

    /// A counting sort of the emitted fragments by pixel.
    fn bring_into_pixel_order(&self, region: Region, scratch: &mut Scratch<T::Key>) {
        let starts = &mut scratch.starts;
        starts.clear();
        starts.resize(region.pixels() + 2, 0);
        // Shifted by two, so that after the scatter below `starts[p]` is where pixel p begins.
        for &(pixel, ..) in &scratch.emitted {
            starts[pixel as usize + 2] += 1;
        }
        for p in 2..starts.len() {
            starts[p] += starts[p - 1];
        }
        scratch.sorted.clear();
        scratch.sorted.resize(scratch.emitted.len(), (T::Key::default(), 0));
        for &(pixel, key, rank) in &scratch.emitted {
            let cursor = &mut starts[pixel as usize + 1];
            scratch.sorted[*cursor as usize] = (key, rank);
            *cursor += 1;
        }
    }

    /// Sorts front to back and merges the pieces of a clipped triangle, which share key and primitive.
    /// Returns how many entries remain.
    fn sort(&self, list: &mut [Entry<T::Key>]) -> usize {
        if list.len() <= 24 {
            // Insertion: short lists are most lists.
            for i in 1..list.len() {
                let entry = list[i];
                let mut j = i;
                while j > 0 && list[j - 1] > entry {
                    list[j] = list[j - 1];
                    j -= 1;
                }
                list[j] = entry;
            }
        } else {
            list.sort_unstable();
        }
        let mut kept = 0;
        for i in 0..list.len() {
            let same = kept > 0
                && list[kept - 1].0 == list[i].0
                && self.primitive(list[kept - 1].1) == self.primitive(list[i].1);
            if !same {
                list[kept] = list[i];
                kept += 1;
            }
        }
        kept
    }

    pub fn primitive(&self, rank: u32) -> u32 {
        self.setup.records[record_of(rank)].primitive
    }
}

/// No rank made from a record has all bits set: a scene ends below 2^31 triangles.
const NO_OPAQUE: u32 = u32::MAX;

/// From the record's anchor to a pixel's centre.
#[inline]
fn offset<T: Real>(record: &Record<T>, x: i32, y: i32) -> (T, T) {
    let half = T::from_f64(0.5);
    (T::from_i32(x) + half - record.anchor[0], T::from_i32(y) + half - record.anchor[1])
}
