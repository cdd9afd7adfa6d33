//! Binning: for each tile, the records that may cover it, in submission order.
//!
//! Count, scan, scatter over chunks of records, so that the order is stable whatever the threads do.
//! Tiles are taken in runs whose lists fit the memory budget together; a run is scattered, rendered and
//! forgotten before the next.

use std::ops::Range;

use rayon::prelude::*;

use super::coverage::Edges;
use super::region::{Region, TILE};
use super::setup::{Record, Setup, pixel_box};
use crate::error::{Error, Result};

/// Bytes of one entry of a tile's list.
const ENTRY: u64 = size_of::<u32>() as u64;

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
        let mut binning =
            Self { setup, width, height, tiles_x, tiles_y, chunk, counts: vec![], runs: vec![], kept: None };
        binning.counts = setup
            .records
            .par_chunks(chunk)
            .map(|records| {
                let mut counts = vec![0; tiles];
                for record in records {
                    binning.for_each_tile(record, &(0..tiles), |tile| counts[tile] += 1);
                }
                counts
            })
            .collect();
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
        counts + self.runs.iter().map(lists).max().unwrap_or(0)
    }

    fn tile_count(&self) -> usize {
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
        let mut records = vec![0_u32; total];
        // Each chunk owns one piece of each tile's list: hand the pieces out before the threads start.
        let mut pieces: Vec<Vec<&mut [u32]>> = self.counts.iter().map(|_| Vec::with_capacity(n)).collect();
        let mut rest = records.as_mut_slice();
        for tile in run.clone() {
            for (chunk, counts) in pieces.iter_mut().zip(&self.counts) {
                let (piece, tail) = rest.split_at_mut(counts[tile] as usize);
                chunk.push(piece);
                rest = tail;
            }
        }
        pieces.par_iter_mut().enumerate().for_each(|(c, pieces)| {
            let first = c * self.chunk;
            let end = (first + self.chunk).min(self.setup.records.len());
            let mut filled = vec![0_u32; n];
            for (i, record) in self.setup.records[first..end].iter().enumerate() {
                self.for_each_tile(record, &run, |tile| {
                    let t = tile - run.start;
                    pieces[t][filled[t] as usize] = (first + i) as u32;
                    filled[t] += 1;
                });
            }
        });
        Bins { run, offsets, records }
    }

    /// Calls `visit` for each tile of `run` that the record may cover: all where each edge function is
    /// inside at some pixel, which near a corner are a few too many.
    fn for_each_tile(&self, record: &Record<T>, run: &Range<usize>, mut visit: impl FnMut(usize)) {
        let tile = TILE as i32;
        let multisampled = self.setup.multisampled;
        let [x0, y0, x1, y1] = pixel_box(record.x, record.y, (self.width, self.height), multisampled);
        let misses = |tx: i32, ty: i32| {
            let edges = Edges::new(record, tx * tile, ty * tile);
            if multisampled { edges.misses_samples(tile, tile) } else { edges.misses(tile, tile) }
        };
        let (tx0, tx1) = (x0 / tile, x1 / tile);
        for ty in y0 / tile..=y1 / tile {
            let row = ty as usize * self.tiles_x as usize;
            for tx in tx0..=tx1 {
                let index = row + tx as usize;
                let alone = tx0 == tx1 && y0 / tile == y1 / tile;
                if run.contains(&index) && (alone || !misses(tx, ty)) {
                    visit(index);
                }
            }
        }
    }
}
