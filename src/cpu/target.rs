//! Where tiles write: parts of whole-image arrays, handed out before the threads start, so that no two
//! threads share a pixel and none of it needs `unsafe`.

use super::entry::Listed;
use super::region::TILE;
use super::tile::{Pixel, Walk, rank_of};
use crate::fragments::Fragments;
use crate::frame::LimitPolicy;
use crate::real::{Real, depth_of_key};
use crate::resolve::{Fragment, Resolve};

/// A tile's part of a row-major array: at most `TILE` rows.
pub struct TileRows<'a, V> {
    rows: Vec<&'a mut [V]>,
    /// Values a pixel.
    each: usize,
}

impl<'a, V> TileRows<'a, V> {
    /// Cuts an array with `each` values a pixel into tiles, in tile order.
    pub fn cut(array: &'a mut [V], width: u32, each: usize) -> Vec<Self> {
        let tile = TILE as usize;
        let row_values = width as usize * each;
        let mut tiles = Vec::new();
        for band in array.chunks_mut(row_values * tile) {
            let first = tiles.len();
            let empty = || Self { rows: Vec::with_capacity(tile), each };
            tiles.extend((0..width.div_ceil(TILE)).map(|_| empty()));
            for row in band.chunks_mut(row_values) {
                for (slot, part) in tiles[first..].iter_mut().zip(row.chunks_mut(tile * each)) {
                    slot.rows.push(part);
                }
            }
        }
        tiles
    }

    fn set(&mut self, x: i32, y: i32, sample: usize, value: V) {
        let column = x as usize % TILE as usize * self.each + sample;
        self.rows[y as usize % TILE as usize][column] = value;
    }
}

/// How a pixel's list becomes its part of the image.
#[derive(Clone, Copy)]
pub struct Rules {
    pub resolve: Resolve,
    pub limit: Option<(u32, LimitPolicy)>,
}

impl Rules {
    /// The fragments that are composited, in `kept` where they are not simply the first.
    fn limited<'l, T: Real, L: Listed<T>>(&self, entries: &'l [L], kept: &'l mut Vec<L>) -> &'l [L] {
        match self.limit {
            Some((n, policy)) if entries.len() > n as usize => match policy {
                LimitPolicy::Nearest => &entries[..n as usize],
                LimitPolicy::LastSubmitted => {
                    kept.clear();
                    kept.extend_from_slice(entries);
                    kept.sort_unstable_by_key(|l| rank_of::<T, L>(*l));
                    kept.truncate(n as usize);
                    kept.sort_unstable();
                    kept
                }
            },
            _ => entries,
        }
    }
}

/// What the resolving walk writes for a tile.
pub struct ImageTarget<'a, T, L> {
    image: TileRows<'a, [T; 4]>,
    counts: Option<TileRows<'a, i32>>,
    behind: Option<TileRows<'a, [T; 4]>>,
    kept: Vec<L>,
    pub fragments: u64,
    pub dropped: u64,
    pub deepest: u32,
}

impl<'a, T: Real, L: Listed<T>> ImageTarget<'a, T, L> {
    /// `each`: colours a pixel of the image. `behind` has one a sample.
    pub fn cut(
        (image, each): (&'a mut [[T; 4]], usize),
        counts: Option<&'a mut [i32]>,
        behind: Option<&'a mut [[T; 4]]>,
        width: u32,
        samples: usize,
    ) -> Vec<Self> {
        let mut counts = counts.map(|c| TileRows::cut(c, width, 1).into_iter());
        let mut behind = behind.map(|b| TileRows::cut(b, width, samples).into_iter());
        TileRows::cut(image, width, each)
            .into_iter()
            .map(|image| Self {
                image,
                counts: counts.as_mut().and_then(Iterator::next),
                behind: behind.as_mut().and_then(Iterator::next),
                kept: Vec::new(),
                fragments: 0,
                dropped: 0,
                deepest: 0,
            })
            .collect()
    }

    pub fn resolve(&mut self, walk: &Walk<T>, rules: &Rules, pixel: &Pixel<L>, background: [T; 4]) {
        let Pixel { x, y, entries, .. } = *pixel;
        let Rules { resolve, .. } = rules;
        let behind = |s: usize| pixel.opaque(s).map_or(background, |listed| walk.color(listed, x, y));
        let listed = rules.limited(entries, &mut self.kept);
        let fragment = |i: usize| Fragment {
            color: walk.color(listed[i], x, y),
            mode: if resolve.mixes { walk.mode(listed[i]) } else { 0 },
            coverage: listed[i].coverage(),
        };
        let image = &mut self.image;
        resolve.pixel(listed.len(), fragment, behind, |s, rgba| image.set(x, y, s, rgba));
        self.fragments += entries.len() as u64;
        self.dropped += (entries.len() - listed.len()) as u64;
        self.deepest = self.deepest.max(entries.len() as u32);
        if let Some(counts) = &mut self.counts {
            counts.set(x, y, 0, entries.len() as i32);
        }
        if let Some(target) = &mut self.behind {
            (0..resolve.samples as usize).for_each(|s| target.set(x, y, s, behind(s)));
        }
    }
}

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
