//! The fragments of one triangle in a tile: coverage and keys of eight pixels at a time.

use super::PIXELS;
use crate::cpu::coverage::Edges;
use crate::cpu::lanes::Lanes;
use crate::cpu::region::{Region, TILE};
use crate::cpu::setup::{Record, pixel_range};

/// Pixels that are taken together: part of a tile's row.
const STRIP: usize = 8;
const FIRST_COLUMNS: [i32; STRIP] = [0, 1, 2, 3, 4, 5, 6, 7];

/// The value that a key under a perspective was made from: 1/w.
#[inline(always)]
pub fn inverse_w(entry: i64) -> f32 {
    let key = !((entry >> 32) as i32);
    f32::from_bits((key ^ ((key >> 31) & i32::MAX)) as u32)
}

/// What becomes of a triangle's fragments.
pub trait Sink<V: Lanes> {
    /// Eight pixels of a tile, from this one on. Negative lanes of `outside` are not covered.
    fn strip(&mut self, v: V, pixel: usize, keys: V::I32, outside: V::I32);
}

/// They are appended to the lists of their pixels.
pub struct Append<'a, V: Lanes> {
    entries: &'a mut [i64],
    next: &'a mut [u32; PIXELS],
    ranks: V::I32,
}

impl<'a, V: Lanes> Append<'a, V> {
    /// # Safety
    /// `next` must be places in `entries`, with one more layer after each.
    #[inline(always)]
    pub unsafe fn new(v: V, entries: &'a mut [i64], next: &'a mut [u32; PIXELS], rank: u32) -> Self {
        Self { entries, next, ranks: v.splat_int(rank as i32) }
    }
}

impl<V: Lanes> Sink<V> for Append<'_, V> {
    #[inline(always)]
    fn strip(&mut self, v: V, pixel: usize, keys: V::I32, outside: V::I32) {
        let Some(next) = self.next[pixel..].first_chunk_mut::<STRIP>() else { return };
        debug_assert!(next.iter().all(|&place| (place as usize) < self.entries.len()));
        // SAFETY: places in `entries`, as `new` was promised; each is passed once, when it moves one layer on.
        unsafe { v.scatter(self.entries, next, keys, self.ranks) };
        v.count(next, outside, PIXELS as i32);
    }
}

/// They go on if they are not behind these keys.
pub struct InFront<'a, S>(pub &'a [i32; PIXELS], pub S);

impl<V: Lanes, S: Sink<V>> Sink<V> for InFront<'_, S> {
    #[inline(always)]
    fn strip(&mut self, v: V, pixel: usize, keys: V::I32, outside: V::I32) {
        if let Some(&hidden) = self.0[pixel..].first_chunk() {
            // What is at their depth is kept.
            self.1.strip(v, pixel, keys, v.or(outside, v.greater_ints(keys, v.ints(hidden))));
        }
    }
}

/// They hide what is behind them: the nearest opaque fragment of each pixel.
#[derive(Debug)]
pub struct Opaque {
    pub keys: [i32; PIXELS],
    pub ranks: [i32; PIXELS],
}

impl Opaque {
    pub fn none() -> Self {
        // No key is so large: it would be a NaN's.
        Self { keys: [i32::MAX; PIXELS], ranks: [0; PIXELS] }
    }

    /// Of a pixel that has one.
    pub fn entry(&self, pixel: usize) -> Option<i64> {
        let key = self.keys[pixel];
        (key < i32::MAX).then_some(i64::from(key) << 32 | i64::from(self.ranks[pixel]))
    }
}

/// The triangle of this rank, behind none of equal depth that came before it.
pub struct Hide<'a>(pub &'a mut Opaque, pub u32);

impl<V: Lanes> Sink<V> for Hide<'_> {
    #[inline(always)]
    fn strip(&mut self, v: V, pixel: usize, keys: V::I32, outside: V::I32) {
        let (nearest, ranks) = (&mut self.0.keys[pixel..], &mut self.0.ranks[pixel..]);
        if let (Some(nearest), Some(ranks)) =
            (nearest.first_chunk_mut::<STRIP>(), ranks.first_chunk_mut::<STRIP>())
        {
            let outside = v.greater_ints(v.splat_int(0), outside);
            let keep = v.or(outside, v.greater_ints(keys, v.ints(*nearest)));
            *nearest = v.int_array(v.choose_ints(keep, v.ints(*nearest), keys));
            *ranks = v.int_array(v.choose_ints(keep, v.ints(*ranks), v.splat_int(self.1 as i32)));
        }
    }
}

/// Finds the fragments of `record`.
///
/// A key is `real::sort_key`'s with its top bit flipped, since vector instructions compare signed integers.
#[inline(always)]
pub fn emit<V: Lanes, const PERSPECTIVE: bool>(
    v: V,
    record: &Record<f32>,
    region: Region,
    mut sink: impl Sink<V>,
) {
    let ((x0, x1), (y0, y1)) = (pixel_range(record.x, false), pixel_range(record.y, false));
    let (from, to) = ((x0 - region.x0).max(0), (x1 + 1 - region.x0).min(region.w));
    let (first, last) = ((y0 - region.y0).max(0), (y1 + 1 - region.y0).min(region.h));
    if from >= to || first >= last {
        return;
    }
    let Edges { a, b, q, .. } = Edges::new(record, region.x0, region.y0);
    let plane = record.key_plane;
    let (low, high) = (v.splat(plane.low), v.splat(plane.high));
    let steps = [v.splat_int(b[0]), v.splat_int(b[1]), v.splat_int(b[2])];
    let strip = STRIP as i32;
    for s in from / strip..=(to - 1) / strip {
        // Loops, not closures: those would be compiled apart, without the caller's instructions.
        let mut columns = FIRST_COLUMNS;
        let mut dx = [0.0; STRIP];
        for i in 0..STRIP {
            columns[i] += s * strip;
            dx[i] = (region.x0 + columns[i]) as f32 + 0.5 - record.anchor[0];
        }
        let along_row = v.add(v.splat(plane.value), v.mul(v.splat(plane.gx), v.floats(dx)));
        // Of the first row; a row adds b.
        let mut edges = steps;
        for e in 0..3 {
            let along_row = v.mul_ints(v.splat_int(a[e]), v.ints(columns));
            edges[e] = v.add_ints(v.splat_int(q[e] + b[e] * first), along_row);
        }
        for j in first..last {
            let dy = (region.y0 + j) as f32 + 0.5 - record.anchor[1];
            let value = v.clamped(v.add(along_row, v.splat(plane.gy * dy)), low, high);
            let key = v.orderable(value);
            let pixel = (j * TILE as i32 + s * strip) as usize;
            // The sign is set where any edge has the pixel outside.
            let outside = v.or(v.or(edges[0], edges[1]), edges[2]);
            sink.strip(v, pixel, if PERSPECTIVE { v.not(key) } else { key }, outside);
            for e in 0..3 {
                edges[e] = v.add_ints(edges[e], steps[e]);
            }
        }
    }
}
