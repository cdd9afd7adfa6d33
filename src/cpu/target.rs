//! Where tiles write: parts of whole-image arrays, handed out before the threads start, so that no two
//! threads share a pixel and none of it needs `unsafe`.

use super::region::TILE;
use super::tile::{Pixel, Walk};
use crate::fragments::{Background, Fragments};
use crate::methods::exact;
use crate::real::{Real, depth_of_key};

/// A tile's part of a row-major array: at most `TILE` rows.
pub struct TileRows<'a, V> {
    rows: Vec<&'a mut [V]>,
}

impl<'a, V> TileRows<'a, V> {
    /// Cuts an array into tiles, in tile order.
    pub fn cut(array: &'a mut [V], width: u32) -> Vec<Self> {
        let tile = TILE as usize;
        let mut tiles = Vec::new();
        for band in array.chunks_mut(width as usize * tile) {
            let first = tiles.len();
            tiles.extend((0..width.div_ceil(TILE)).map(|_| Self { rows: Vec::with_capacity(tile) }));
            for row in band.chunks_mut(width as usize) {
                for (slot, part) in tiles[first..].iter_mut().zip(row.chunks_mut(tile)) {
                    slot.rows.push(part);
                }
            }
        }
        tiles
    }

    fn set(&mut self, x: i32, y: i32, value: V) {
        self.rows[y as usize % TILE as usize][x as usize % TILE as usize] = value;
    }
}

/// What the resolving walk writes for a tile.
pub struct ImageTarget<'a, T> {
    image: TileRows<'a, [T; 4]>,
    counts: Option<TileRows<'a, i32>>,
    behind: Option<TileRows<'a, [T; 4]>>,
    pub fragments: u64,
    pub deepest: u32,
}

impl<'a, T: Real> ImageTarget<'a, T> {
    pub fn cut(
        image: &'a mut [[T; 4]],
        counts: Option<&'a mut [i32]>,
        behind: Option<&'a mut [[T; 4]]>,
        width: u32,
    ) -> Vec<Self> {
        let mut counts = counts.map(|c| TileRows::cut(c, width).into_iter());
        let mut behind = behind.map(|b| TileRows::cut(b, width).into_iter());
        TileRows::cut(image, width)
            .into_iter()
            .map(|image| Self {
                image,
                counts: counts.as_mut().and_then(Iterator::next),
                behind: behind.as_mut().and_then(Iterator::next),
                fragments: 0,
                deepest: 0,
            })
            .collect()
    }

    pub fn resolve(&mut self, walk: &Walk<T>, pixel: &Pixel<T>, background: [T; 4]) {
        let Pixel { x, y, entries, opaque } = *pixel;
        let behind = opaque.map_or(background, |entry| walk.color(entry, x, y));
        let mut state = exact::State::begin();
        for &entry in entries {
            state.insert(walk.color(entry, x, y));
            if state.is_saturated() {
                break;
            }
        }
        self.image.set(x, y, state.end(behind));
        self.fragments += entries.len() as u64;
        self.deepest = self.deepest.max(entries.len() as u32);
        if let Some(counts) = &mut self.counts {
            counts.set(x, y, entries.len() as i32);
        }
        if let Some(target) = &mut self.behind {
            target.set(x, y, behind);
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
}

impl<'a, T: Real> ListTarget<'a, T> {
    /// Cuts lists whose offsets are set into tiles. Returns the offsets beside them.
    pub fn cut(lists: &'a mut Fragments<T>, width: u32) -> (Vec<Self>, &'a [i64]) {
        let Fragments { offsets, depth, key, color, primitive, .. } = lists;
        let (mut depth, mut key) = (depth.as_mut_slice(), key.as_mut_slice());
        let (mut color, mut primitive) = (color.as_mut_slice(), primitive.as_mut_slice());
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
                });
            }
        }
        (tiles, offsets)
    }

    /// `start`: the pixel's offset.
    pub fn write(&mut self, walk: &Walk<T>, pixel: &Pixel<T>, start: i64) {
        let row = &mut self.rows[pixel.y as usize % TILE as usize];
        let start = (start - row.first) as usize;
        for (i, &entry) in pixel.entries.iter().enumerate() {
            let key = T::key_of(entry);
            row.depth[start + i] = depth_of_key(key, walk.setup.perspective);
            row.key[start + i] = key;
            row.color[start + i] = walk.color(entry, pixel.x, pixel.y);
            row.primitive[start + i] = walk.primitive(entry) as i32;
        }
    }
}

fn take<'a, V>(rest: &mut &'a mut [V], n: usize) -> &'a mut [V] {
    let (part, tail) = std::mem::take(rest).split_at_mut(n);
    *rest = tail;
    part
}

/// The straight colour behind everything at a pixel.
pub fn background_at<T: Real>(background: &Background<T>, x: i32, y: i32, width: u32) -> [T; 4] {
    background.at(y as usize * width as usize + x as usize)
}
