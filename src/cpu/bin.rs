//! Binning: for each tile, the records that may cover it, in submission order.
//!
//! Count, scan, scatter over chunks of records, so that the order is stable whatever the threads do.
//! Tiles are taken in runs whose lists fit the memory budget together; a run is scattered, rendered and
//! forgotten before the next.

use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};

use rayon::prelude::*;

use super::region::{Region, TILE};
use super::setup::{Record, Setup, pixel_box};
use super::tile_walk::TileWalk;
use crate::error::{Error, Result};

/// Bytes of one entry of a tile's list.
const ENTRY: u64 = size_of::<u32>() as u64;

/// The tiles that a record may cover: those of a rectangle of `COVER_COLUMNS` × `COVER_ROWS` tiles from the first
/// on whose bit is set, row by row. Without any bit, what lies in a larger one is found out again.
#[derive(Debug, Clone, Copy)]
struct Cover {
    first: u32,
    tiles: u32,
}
const COVER_COLUMNS: i32 = 8;
const COVER_ROWS: i32 = 4;

const NO_PIXELS: [i32; 4] = [i32::MAX, i32::MAX, i32::MIN, i32::MIN];

fn joined(a: [i32; 4], b: [i32; 4]) -> [i32; 4] {
    [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])]
}

/// How many records each tile has, and the runs of tiles that are scattered together.
#[derive(Debug)]
pub struct Binning<'a, T> {
    setup: &'a Setup<T>,
    width: u32,
    height: u32,
    tiles_x: u32,
    tiles_y: u32,
    /// Records a chunk; `counts` has one row of tiles for each chunk.
    chunk: usize,
    counts: Vec<Vec<u32>>,
    /// Of each chunk's records, in their order.
    covers: Vec<Vec<Cover>>,
    /// The pixels that records may cover: x0, y0, x1, y1, all inclusive.
    bounds: [i32; 4],
    pub runs: Vec<Range<usize>>,
    /// The lists of the only run, so that a second walk does not scatter again.
    kept: Option<Bins>,
}

/// The lists of one run of tiles.
#[derive(Debug)]
pub struct Bins {
    pub run: Range<usize>,
    /// Where each tile's list starts, one more than tiles.
    offsets: Vec<usize>,
    records: Vec<u32>,
}

impl Bins {
    pub fn tile(&self, tile: usize) -> &[u32] {
        let i = tile - self.run.start;
        &self.records[self.offsets[i]..self.offsets[i + 1]]
    }
}

impl<'a, T: Sync + Send> Binning<'a, T> {
    /// Counts, and plans runs of at most `budget` bytes of lists.
    pub fn new(setup: &'a Setup<T>, width: u32, height: u32, budget: u64) -> Result<Self> {
        let (tiles_x, tiles_y) = (width.div_ceil(TILE), height.div_ceil(TILE));
        let tiles = (tiles_x * tiles_y) as usize;
        // Two chunks a thread balance the load; chunks of fewer records than tiles would cost more in
        // counters than they save.
        let wanted = 2 * rayon::current_num_threads();
        let chunk = setup.records.len().div_ceil(wanted).max(tiles).max(1024);
        let mut binning = Self {
            setup,
            width,
            height,
            tiles_x,
            tiles_y,
            chunk,
            counts: vec![],
            covers: vec![],
            bounds: NO_PIXELS,
            runs: vec![],
            kept: None,
        };
        let chunks: Vec<_> = setup
            .records
            .par_chunks(chunk)
            .map(|records| {
                let (mut counts, mut bounds) = (vec![0; tiles], NO_PIXELS);
                let cover = |record| {
                    let pixels = binning.pixels(record);
                    bounds = joined(bounds, pixels);
                    binning.cover(record, pixels, |tile| counts[tile] += 1)
                };
                let covers: Vec<_> = records.iter().map(cover).collect();
                (counts, covers, bounds)
            })
            .collect();
        for (counts, covers, bounds) in chunks {
            binning.counts.push(counts);
            binning.covers.push(covers);
            binning.bounds = joined(binning.bounds, bounds);
        }
        binning.runs = binning.plan_runs(budget)?;
        if let [run] = binning.runs.as_slice() {
            binning.kept = Some(binning.scatter(run.clone()));
        }
        Ok(binning)
    }

    /// Calls `walk` with the lists of each run of tiles.
    pub fn each_run(&self, mut walk: impl FnMut(&Bins) -> Result<()>) -> Result<()> {
        match &self.kept {
            Some(bins) => walk(bins),
            None => self.runs.iter().try_for_each(|run| walk(&self.scatter(run.clone()))),
        }
    }

    /// Bytes of the counts and of the largest run's lists.
    pub fn bytes(&self) -> u64 {
        let lists = |run: &Range<usize>| run.clone().map(|tile| self.pairs(tile)).sum::<u64>() * ENTRY;
        let counts = (self.counts.len() * self.tile_count() * size_of::<u32>()) as u64;
        let covers = (self.setup.records.len() * size_of::<Cover>()) as u64;
        counts + covers + self.runs.iter().map(lists).max().unwrap_or(0)
    }

    /// The tiles of a row of tiles that are in a run, and where in the row they are.
    pub fn of_row(&self, ty: usize, run: &Range<usize>) -> (Range<usize>, Range<usize>) {
        let n = self.tiles_x as usize;
        let (first, end) = ((ty * n).max(run.start), ((ty + 1) * n).min(run.end));
        let end = end.max(first);
        let at = |tile: usize| tile.clamp(ty * n, (ty + 1) * n) - ty * n;
        (first..end, at(first)..at(end))
    }

    pub fn tile_count(&self) -> usize {
        (self.tiles_x * self.tiles_y) as usize
    }

    pub fn region(&self, tile: usize) -> Region {
        let (x0, y0) = (tile as u32 % self.tiles_x * TILE, tile as u32 / self.tiles_x * TILE);
        Region {
            x0: x0 as i32,
            y0: y0 as i32,
            w: TILE.min(self.width - x0) as i32,
            h: TILE.min(self.height - y0) as i32,
        }
    }

    fn pairs(&self, tile: usize) -> u64 {
        self.counts.iter().map(|c| u64::from(c[tile])).sum()
    }

    fn plan_runs(&self, budget: u64) -> Result<Vec<Range<usize>>> {
        let mut runs = Vec::new();
        let (mut start, mut bytes) = (0, 0);
        for tile in 0..self.tile_count() {
            let own = self.pairs(tile) * ENTRY;
            if own > budget {
                return Err(Error::Capacity {
                    what: format!("the triangle list of one {TILE}×{TILE} tile"),
                    needed: own,
                    limit: budget,
                    advice: "raise memory=, half of which is for this".into(),
                });
            }
            if bytes + own > budget {
                runs.push(start..tile);
                (start, bytes) = (tile, 0);
            }
            bytes += own;
        }
        runs.push(start..self.tile_count());
        Ok(runs)
    }

    /// Writes the lists of a run of tiles.
    fn scatter(&self, run: Range<usize>) -> Bins {
        let n = run.len();
        let mut offsets = Vec::with_capacity(n + 1);
        offsets.push(0);
        let mut total = 0;
        for tile in run.clone() {
            total += self.pairs(tile) as usize;
            offsets.push(total);
        }
        // Each chunk owns one piece of each tile's list, so that no two threads write to one place. That they are
        // atomics is for the compiler: a relaxed store is a plain one.
        let records: Vec<AtomicU32> = std::iter::repeat_with(AtomicU32::default).take(total).collect();
        let mut next = offsets.clone();
        let mut pieces = Vec::with_capacity(self.counts.len());
        for counts in &self.counts {
            pieces.push(next[..n].to_vec());
            for (next, &count) in next.iter_mut().zip(&counts[run.clone()]) {
                *next += count as usize;
            }
        }
        pieces.par_iter_mut().enumerate().for_each(|(c, next)| {
            let mut visit = |tile: usize, record: usize| {
                if run.contains(&tile) {
                    let place = &mut next[tile - run.start];
                    records[*place].store(record as u32, Ordering::Relaxed);
                    *place += 1;
                }
            };
            for (record, cover) in (c * self.chunk..).zip(&self.covers[c]) {
                if cover.tiles == 0 {
                    let of = &self.setup.records[record];
                    self.cover(of, self.pixels(of), |tile| visit(tile, record));
                }
                let mut rest = cover.tiles;
                while rest != 0 {
                    let bit = rest.trailing_zeros();
                    let (tx, ty) = (bit % COVER_COLUMNS as u32, bit / COVER_COLUMNS as u32);
                    visit((cover.first + ty * self.tiles_x + tx) as usize, record);
                    rest &= rest - 1;
                }
            }
        });
        let records = records.into_iter().map(AtomicU32::into_inner).collect(); // in place
        Bins { run, offsets, records }
    }

    /// The pixels that records may cover, for people.
    pub fn describe_box(&self) -> String {
        let [x0, y0, x1, y1] = self.bounds;
        if x0 > x1 { "none".into() } else { format!("{x0}..{} × {y0}..{}", x1 + 1, y1 + 1) }
    }

    fn pixels(&self, record: &Record<T>) -> [i32; 4] {
        pixel_box(record.x, record.y, (self.width, self.height), self.setup.multisampled)
    }

    /// Calls `visit` for each tile that the record may cover, and returns which they are.
    #[inline]
    fn cover(&self, record: &Record<T>, [x0, y0, x1, y1]: [i32; 4], mut visit: impl FnMut(usize)) -> Cover {
        let tile = TILE as i32;
        let [tx0, ty0, tx1, ty1] = [x0 / tile, y0 / tile, x1 / tile, y1 / tile];
        let index = |tx: i32, ty: i32| ty as usize * self.tiles_x as usize + tx as usize;
        let first = index(tx0, ty0) as u32;
        if (tx0, ty0) == (tx1, ty1) {
            visit(first as usize);
            return Cover { first, tiles: 1 };
        }
        let small = tx1 - tx0 < COVER_COLUMNS && ty1 - ty0 < COVER_ROWS;
        let mut tiles = 0;
        TileWalk::new(record, (tx0, ty0), self.setup.multisampled).each(tx0..=tx1, ty0..=ty1, |tx, ty| {
            if small {
                tiles |= 1 << ((ty - ty0) * COVER_COLUMNS + tx - tx0);
            }
            visit(index(tx, ty));
        });
        Cover { first, tiles }
    }
}
