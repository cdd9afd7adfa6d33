//! Where tiles write fragment lists: parts of the arrays, as in `target.rs`.

use super::entry::Listed;
use super::region::TILE;
use super::tile::{Pixel, Walk};
use crate::fragments::Fragments;
use crate::real::{Real, depth_of_key};

/// What the listing walk writes for a tile: for each of its rows a contiguous part of the lists.
pub struct ListTarget<'a, T: Real> {
    rows: Vec<ListRow<'a, T>>,
}

struct ListRow<'a, T: Real> {
    /// The first pixel's offset.
    first: i64,
    depth: &'a mut [T],
    key: &'a mut [T::Key],
    color: &'a mut [[T; 4]],
    primitive: &'a mut [i32],
    /// Empty where lists have none.
    coverage: &'a mut [u32],
    blend: &'a mut [u8],
}

impl<'a, T: Real> ListTarget<'a, T> {
    /// Cuts lists whose offsets are set into tiles. Returns the offsets beside them.
    pub fn cut(lists: &'a mut Fragments<T>, width: u32) -> (Vec<Self>, &'a [i64]) {
        let Fragments { offsets, depth, key, color, primitive, coverage, blend } = lists;
        let (mut depth, mut key) = (depth.as_mut_slice(), key.as_mut_slice());
        let (mut color, mut primitive) = (color.as_mut_slice(), primitive.as_mut_slice());
        let (mut coverage, mut blend) = (coverage.as_deref_mut(), blend.as_deref_mut());
        let offsets: &[i64] = offsets;
        let tiles_x = width.div_ceil(TILE) as usize;
        let (width, tile) = (width as usize, TILE as usize);
        let height = (offsets.len() - 1) / width;
        let mut tiles: Vec<Self> =
            (0..tiles_x * height.div_ceil(tile)).map(|_| Self { rows: Vec::with_capacity(tile) }).collect();
        for y in 0..height {
            for tx in 0..tiles_x {
                let first = offsets[y * width + tx * tile];
                let n = (offsets[y * width + ((tx + 1) * tile).min(width)] - first) as usize;
                tiles[y / tile * tiles_x + tx].rows.push(ListRow {
                    first,
                    depth: take(&mut depth, n),
                    key: take(&mut key, n),
                    color: take(&mut color, n),
                    primitive: take(&mut primitive, n),
                    coverage: coverage.as_mut().map_or(&mut [], |rest| take(rest, n)),
                    blend: blend.as_mut().map_or(&mut [], |rest| take(rest, n)),
                });
            }
        }
        (tiles, offsets)
    }

    /// `start`: the pixel's offset.
    pub fn write<L: Listed<T>>(&mut self, walk: &Walk<T>, pixel: &Pixel<L>, start: i64) {
        let row = &mut self.rows[pixel.y as usize % TILE as usize];
        let start = (start - row.first) as usize;
        for (i, &listed) in (start..).zip(pixel.entries) {
            let key = T::key_of(listed.entry());
            row.depth[i] = depth_of_key(key, walk.setup.perspective);
            row.key[i] = key;
            row.color[i] = walk.color(listed, pixel.x, pixel.y);
            row.primitive[i] = walk.primitive(listed) as i32;
            if let Some(coverage) = row.coverage.get_mut(i) {
                *coverage = listed.coverage();
            }
            if let Some(blend) = row.blend.get_mut(i) {
                *blend = walk.mode(listed);
            }
        }
    }
}

fn take<'a, V>(rest: &mut &'a mut [V], n: usize) -> &'a mut [V] {
    let (part, tail) = std::mem::take(rest).split_at_mut(n);
    *rest = tail;
    part
}
