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

/// Appends the fragments of `record` to the lists of the pixels that it covers.
///
/// A key is `real::sort_key`'s with its top bit flipped, since vector instructions compare signed integers.
///
/// # Safety
/// `next` must be places in `entries`, with one more layer after each.
#[inline(always)]
pub unsafe fn emit<V: Lanes, const PERSPECTIVE: bool>(
    v: V,
    record: &Record<f32>,
    rank: u32,
    region: Region,
    entries: &mut [i64],
    next: &mut [u32],
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
    let ranks = v.splat_int(rank as i32);
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
            let found = v.joined(if PERSPECTIVE { v.not(key) } else { key }, ranks);
            let pixel = (j * TILE as i32 + s * strip) as usize;
            let Some(next) = next.get_mut(pixel..).and_then(<[u32]>::first_chunk_mut::<STRIP>) else {
                return;
            };
            for i in 0..STRIP {
                debug_assert!((next[i] as usize) < entries.len());
                // SAFETY: a place in `entries`, as the caller promises; each is passed once, when it moves one layer on.
                unsafe { *entries.get_unchecked_mut(next[i] as usize) = found[i] };
            }
            // The sign is set where any edge has the pixel outside.
            let [e0, e1, e2] = edges;
            v.count(next, v.or(v.or(e0, e1), e2), PIXELS as i32);
            for e in 0..3 {
                edges[e] = v.add_ints(edges[e], steps[e]);
            }
        }
    }
}
