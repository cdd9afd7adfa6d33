//! One tile: rasterise its triangles into fragments, bring them into pixel order by a counting sort, and
//! sort each pixel's list. What becomes of the lists is the visitor's business.

use std::sync::{Mutex, PoisonError};

use super::entry::Listed;
use super::lanes::Instructions;
use super::layers::Layers;
use super::region::Region;
use super::setup::{FLAT, Record, Setup};
use super::sort::sort;
use crate::blend::OVER;
use crate::error::{Error, Result};
use crate::frame::Sort;
use crate::methods::Order;
use crate::real::Real;
use crate::samples::Offset;
use crate::scene::Mesh;

/// A rank orders fragments of equal keys, smaller in front: the complement of the record, so that later
/// triangles win ties; its top bit puts an opaque fragment behind translucent ones at its depth.
const OPAQUE_BIT: u32 = 1 << 31;

pub fn rank(record: u32, opaque: bool) -> u32 {
    (!record & !OPAQUE_BIT) | if opaque { OPAQUE_BIT } else { 0 }
}

/// The rank of a listed fragment without its opaque bit: smaller was submitted later.
pub fn rank_of<T: Real, L: Listed<T>>(listed: L) -> u32 {
    T::rank_of(listed.entry()) & !OPAQUE_BIT
}

/// The record that a rank was made from.
fn record_of(rank: u32) -> usize {
    (!rank & !OPAQUE_BIT) as usize
}

/// Fragments are held this many at a time; a region with more is halved, down to one pixel.
/// 65,536 keep a thread's buffers near the second-level cache.
const FRAGMENTS_AT_ONCE: usize = 1 << 16;

/// Consecutive pixels of a region's row that one record covers. Their keys lie one after the other.
#[derive(Debug, Clone, Copy)]
pub struct Run {
    pub pixel: u16,
    pub len: u16,
    pub rank: u32,
}

/// A thread's buffers, reused from tile to tile.
#[derive(Debug)]
pub struct Scratch<T: Real, L> {
    pub runs: Vec<Run>,
    pub keys: Vec<T::Key>,
    /// A word of coverage for each key; empty where a pixel has one sample.
    pub coverage: Vec<u32>,
    sorted: Vec<L>,
    /// First sorted entry of each pixel, and one past the last.
    starts: Vec<u32>,
    /// The nearest opaque fragment of each sample; empty where a region has none.
    pub opaque: Vec<L>,
    /// What the quick way keeps.
    pub layers: Layers,
}

impl<T: Real, L> Default for Scratch<T, L> {
    fn default() -> Self {
        Self {
            runs: vec![],
            keys: vec![],
            coverage: vec![],
            sorted: vec![],
            starts: vec![],
            opaque: vec![],
            layers: Layers::default(),
        }
    }
}

impl<T: Real, L> Scratch<T, L> {
    pub fn clear(&mut self) {
        self.runs.clear();
        self.keys.clear();
        self.coverage.clear();
        self.opaque.clear();
    }

    pub fn bytes(&self) -> u64 {
        (self.runs.capacity() * size_of::<Run>()
            + self.keys.capacity() * size_of::<T::Key>()
            + (self.sorted.capacity() + self.opaque.capacity()) * size_of::<L>()
            + (self.starts.capacity() + self.coverage.capacity()) * size_of::<u32>()) as u64
            + self.layers.bytes()
    }
}

/// What all tiles share.
pub struct Walk<'a, T> {
    pub setup: &'a Setup<T>,
    /// Of the image.
    pub width: u32,
    pub meshes: &'a [Mesh<'a>],
    /// Where the samples of a pixel lie.
    pub pattern: &'static [Offset],
    pub instructions: Instructions,
    pub sort: Sort,
    /// There are opaque surfaces, which hide what is behind them …
    pub hides: bool,
    /// … or are listed like any other and hide nothing.
    pub list_opaque: bool,
    /// Scratch bytes that one thread may hold.
    pub scratch_bytes: u64,
    /// What a single pixel may take where that is too little: whoever holds the lock uses it.
    pub deep_pixel: Mutex<DeepPixel>,
}

/// Memory for the one pixel at a time that exceeds a thread's share.
#[derive(Debug)]
pub struct DeepPixel {
    pub limit: u64,
    /// The most that was in use.
    pub held: u64,
}

/// One pixel's fragments, in the order that was asked for.
pub struct Pixel<'a, L> {
    pub x: i32,
    pub y: i32,
    pub entries: &'a [L],
    /// The nearest opaque surface of each sample; empty where there is none.
    opaque: &'a [L],
}

impl<L> Pixel<'_, L> {
    /// The nearest opaque surface of a sample.
    #[inline]
    pub fn opaque<T: Real>(&self, sample: usize) -> Option<L>
    where
        L: Listed<T>,
    {
        self.opaque.get(sample).copied().filter(|&l| l != L::MAX)
    }
}

impl<T: Real> Walk<'_, T> {
    /// Straight RGBA of a fragment. An opaque surface has alpha 1.
    #[inline]
    pub fn color<L: Listed<T>>(&self, listed: L, x: i32, y: i32) -> [T; 4] {
        let rank = T::rank_of(listed.entry());
        let at = listed.location(self.pattern);
        let mut color = self.raw_color(&self.setup.records[record_of(rank)], x, y, at);
        if rank & OPAQUE_BIT != 0 {
            color[3] = T::ONE;
        }
        color
    }

    /// An id of `blend::MODES`.
    #[inline]
    pub fn mode<L: Listed<T>>(&self, listed: L) -> u8 {
        let rank = T::rank_of(listed.entry());
        if rank & OPAQUE_BIT != 0 {
            return OVER;
        }
        self.meshes[self.setup.records[record_of(rank)].mesh as usize].blend
    }

    #[inline]
    fn raw_color(&self, record: &Record<T>, x: i32, y: i32, at: Offset) -> [T; 4] {
        if record.gradient == FLAT {
            return record.color;
        }
        let planes = &self.setup.gradients[record.gradient as usize];
        let (dx, dy) = offset(record, x, y, at);
        if !self.setup.perspective {
            return planes.map(|p| p.color(dx, dy).clamped(p.low, p.high));
        }
        let w = T::ONE / record.key_plane.at(dx, dy);
        planes.map(|p| (p.color(dx, dy) * w).clamped(p.low, p.high))
    }

    pub fn primitive<L: Listed<T>>(&self, listed: L) -> u32 {
        self.setup.records[record_of(T::rank_of(listed.entry()))].primitive
    }

    /// Visits every pixel of the region once, in no promised order, with its fragments in `order`.
    pub fn visit<L: Listed<T>>(
        &self,
        order: Order,
        records: &[u32],
        region: Region,
        scratch: &mut Scratch<T, L>,
        visitor: &mut impl FnMut(Pixel<L>),
    ) -> Result<()> {
        // Of a fragment: at worst a run each, a key, its coverage, and a sorted entry.
        let words = if self.setup.multisampled { size_of::<u32>() } else { 0 };
        let each = (size_of::<Run>() + size_of::<T::Key>() + words + size_of::<L>()) as u64;
        let limit = ((self.scratch_bytes / each) as usize).min(FRAGMENTS_AT_ONCE);
        if self.emit(records, region, limit, scratch) {
            self.hand_out(order, region, scratch, visitor);
        } else if region.pixels() > 1 {
            for half in region.halves() {
                self.visit(order, records, half, scratch, visitor)?;
            }
        } else {
            let mut deep = self.deep_pixel.lock().unwrap_or_else(PoisonError::into_inner);
            if !self.emit(records, region, (deep.limit / each) as usize, scratch) {
                return Err(Error::Capacity {
                    what: format!("the fragment list of pixel [{}, {}]", region.y0, region.x0),
                    // At most one fragment for each triangle of the tile.
                    needed: each * records.len() as u64,
                    limit: deep.limit,
                    advice: "raise memory=, a quarter of which is for this".into(),
                });
            }
            self.hand_out(order, region, scratch, visitor);
            deep.held = deep.held.max(scratch.bytes());
            *scratch = Scratch::default(); // as large as this pixel: not for keeps
        }
        Ok(())
    }

    /// Brings what was emitted into order, and calls the visitor for each pixel.
    fn hand_out<L: Listed<T>>(
        &self,
        order: Order,
        region: Region,
        scratch: &mut Scratch<T, L>,
        visitor: &mut impl FnMut(Pixel<L>),
    ) {
        bring_into_pixel_order(region, scratch);
        let Scratch { sorted, starts, opaque, .. } = scratch;
        let samples = self.pattern.len();
        let mut p = 0;
        for y in region.y0..region.y0 + region.h {
            for x in region.x0..region.x0 + region.w {
                let list = &mut sorted[starts[p] as usize..starts[p + 1] as usize];
                let kept = self.ordered(order, list);
                let opaque = opaque.get(p * samples..(p + 1) * samples).unwrap_or_default();
                visitor(Pixel { x, y, entries: &list[..kept], opaque });
                p += 1;
            }
        }
    }

    /// Rasterises into runs and keys. `false` if there are more than `limit` fragments.
    fn emit<L: Listed<T>>(
        &self,
        records: &[u32],
        region: Region,
        limit: usize,
        scratch: &mut Scratch<T, L>,
    ) -> bool {
        scratch.clear();
        if self.setup.multisampled {
            self.emit_samples(records, region, limit, scratch)
        } else {
            self.emit_centers(records, region, limit, scratch)
        }
    }

    pub fn passes(&self, record: &Record<T>, cutoff: T, x: i32, y: i32, at: Offset) -> bool {
        cutoff == T::ZERO || self.raw_color(record, x, y, at)[3] >= cutoff
    }

    /// Brings a list, which is in the order of submission, into `order`, and merges the pieces of a clipped triangle,
    /// which share key and primitive. Returns how many entries remain.
    fn ordered<L: Listed<T>>(&self, order: Order, list: &mut [L]) -> usize {
        if order == Order::FrontToBack {
            sort(self.sort, list);
        }
        if !self.setup.has_pieces || self.setup.multisampled {
            return list.len(); // with samples they were merged before
        }
        let mut kept = list.len().min(1);
        for i in 1..list.len() {
            let (last, own) = (list[kept - 1], list[i]);
            let tie = T::key_of(last.entry()) == T::key_of(own.entry());
            if !tie || self.primitive(last) != self.primitive(own) {
                list[kept] = own;
                kept += 1;
            }
        }
        kept
    }
}

/// From the record's anchor to a pixel's centre, or to what lies (kx, ky)/16 pixel from it.
#[inline]
pub fn offset<T: Real>(record: &Record<T>, x: i32, y: i32, (kx, ky): Offset) -> (T, T) {
    // Exact: a multiple of 1/16 below 2^15.
    let at = |i: i32, k: i32| T::from_i32(16 * i + 8 + k) * T::from_f64(1.0 / 16.0);
    (at(x, kx) - record.anchor[0], at(y, ky) - record.anchor[1])
}

/// A counting sort of the emitted fragments by pixel.
fn bring_into_pixel_order<T: Real, L: Listed<T>>(region: Region, scratch: &mut Scratch<T, L>) {
    let Scratch { runs, keys, coverage, sorted, starts, .. } = scratch;
    starts.clear();
    starts.resize(region.pixels() + 2, 0);
    // Shifted by two, so that after the scatter below `starts[p]` is where pixel p begins.
    for run in runs.iter() {
        let first = run.pixel as usize + 2;
        starts[first..first + run.len as usize].iter_mut().for_each(|count| *count += 1);
    }
    for p in 2..starts.len() {
        starts[p] += starts[p - 1];
    }
    sorted.resize(keys.len(), L::default());
    let mut done = 0;
    for run in runs.iter() {
        let first = run.pixel as usize + 1;
        let own = done..done + run.len as usize;
        done = own.end;
        for ((&key, i), cursor) in keys[own.clone()].iter().zip(own).zip(&mut starts[first..]) {
            let word = coverage.get(i).copied().unwrap_or_default();
            sorted[*cursor as usize] = L::new(T::entry(key, run.rank), word);
            *cursor += 1;
        }
    }
}
