//! Which tiles a snapped triangle touches: its edge functions, stepped from tile to tile.

use std::ops::RangeInclusive;

use super::coverage::edge;
use super::region::TILE;
use super::setup::Record;

/// A walk over whole tiles: for each edge the most that its function comes to in a tile.
pub struct TileWalk {
    first: [i64; 3],
    /// What a tile to the right adds, and one below.
    right: [i64; 3],
    below: [i64; 3],
}

impl TileWalk {
    /// From tile (tx, ty) on. With samples the most is over the whole of each pixel.
    #[inline(always)]
    pub fn new<T>(record: &Record<T>, (tx, ty): (i32, i32), multisampled: bool) -> Self {
        let tile = TILE as i32;
        let mut walk = Self { first: [0; 3], right: [0; 3], below: [0; 3] };
        for i in 0..3 {
            let (dx, dy, value) = edge(record, i, tx * tile, ty * tile);
            let within = if multisampled { (15 + 8 * dx.abs() + 8 * dy.abs()) >> 4 } else { 0 };
            let most = within + (-dy * (tile - 1)).max(0) + (dx * (tile - 1)).max(0);
            walk.first[i] = value + 256 * i64::from(most);
            walk.right[i] = -256 * i64::from(tile) * i64::from(dy);
            walk.below[i] = 256 * i64::from(tile) * i64::from(dx);
        }
        walk
    }

    /// Calls `visit(tx, ty)` for each tile of a rectangle, which begins where the walk does, in which each edge
    /// function is inside somewhere: all that may hold a covered pixel, and near a corner a few too many.
    #[inline]
    pub fn each(
        &self,
        columns: RangeInclusive<i32>,
        rows: RangeInclusive<i32>,
        mut visit: impl FnMut(i32, i32),
    ) {
        let mut row = self.first;
        for ty in rows {
            let mut most = row;
            for tx in columns.clone() {
                if most[0] | most[1] | most[2] >= 0 {
                    visit(tx, ty);
                }
                most = std::array::from_fn(|i| most[i] + self.right[i]);
            }
            row = std::array::from_fn(|i| row[i] + self.below[i]);
        }
    }
}
