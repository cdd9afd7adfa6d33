//! Triangles set up and binned for one camera.

use super::classes::{CLASS_COUNT, CLASS_WORDS, most_parts};
use super::counted::Room;
use super::stages::MAX_BINS;
use crate::error::{Error, Result};
use crate::gpu::buffers::{indirect, storage};
use crate::gpu::device::{Gpu, SOFTWARE_TURNS};
use crate::gpu::kept::Kept;
use crate::gpu::readback::copied;
use crate::gpu::resolve::TILE;
use crate::gpu::uniforms::Grid;
use crate::gpu::variant::ColorsOf;

/// Invocations of a workgroup, and triangles of a block (BLOCK in shaders/tiles/bin.wgsl).
pub const BLOCK: u32 = 256;
/// Fewer triangles come in smaller blocks, of which several invocations share each.
const FEW: u32 = 1 << 14;
const FEW_BLOCK: u32 = 32;
/// Chunks that triangles are counted in, about: one workgroup each.
const CHUNKS: u32 = 1024;
/// Words of `Counters`, bytes of `Raster`, `KeyPlane`, a slope and a piece (shaders/tiles/triangle.wgsl).
const COUNTER_WORDS: u64 = 10;
const RASTER_BYTES: u64 = 32;
const BOX_BYTES: u64 = 8;
const PLANE_BYTES: u64 = 32;
const SLOPE_BYTES: u64 = 16;
const PIECE_BYTES: u64 = 24;

/// What bins are made for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BinsKey {
    pub triangles: u32,
    pub size: (u32, u32),
    pub colors: ColorsOf,
    /// Bytes that lists may take.
    pub memory: u64,
}

pub struct Bins {
    /// Of the band that comes next.
    pub grid: Grid,
    /// Rows of tiles of the image, and of a band: those that there are bins and memory for at once.
    all_rows: u32,
    most_rows: u32,
    rows: u32,
    pub rasters: wgpu::Buffer,
    pub boxes: wgpu::Buffer,
    pub color_starts: wgpu::Buffer,
    pub key_planes: wgpu::Buffer,
    pub slopes: wgpu::Buffer,
    pub pieces: wgpu::Buffer,
    pub tiles: wgpu::Buffer,
    pub tile_entries: wgpu::Buffer,
    /// Parts of tiles by class, how many there are, and what each class is dispatched with.
    pub parts: wgpu::Buffer,
    pub classes: wgpu::Buffer,
    pub groups: [wgpu::Buffer; CLASS_COUNT + 1],
    pub clip_list: wgpu::Buffer,
    pub counters: wgpu::Buffer,
    pub matrix: wgpu::Buffer,
    pub bins: wgpu::Buffer,
    pub bin_entries: wgpu::Buffer,
    pub piece_capacity: u32,
}

/// Of a band: three demands of room, one of classes, and as many halvings as a row has bits.
pub const MOST_TRIES: u32 = 20;

impl Bins {
    /// Those that an earlier frame left, or new ones; without the bands that it was cut into.
    pub fn taken(kept: &mut Kept, key: &BinsKey) -> Result<Self> {
        let gpu = kept.gpu.clone();
        let mut bins = kept.bins.take(key, || Self::new(&gpu, key))?;
        bins.rows = bins.most_rows;
        bins.turn_to(0);
        Ok(bins)
    }

    /// Room for a scene's triangles, and as many entries as one triangle mostly has.
    fn new(gpu: &Gpu, key: &BinsKey) -> Result<Self> {
        let BinsKey { triangles, size: (width, height), colors, memory } = *key;
        let (has_gradients, by_triangle) = (colors == ColorsOf::Corners, colors == ColorsOf::Triangle);
        let (tiles_x, tiles_y) = (width.div_ceil(TILE), height.div_ceil(TILE));
        // The least bins of at least 4×4 tiles of which there is room for all; or as many rows of the largest.
        let rows_of = |shift: u32| (MAX_BINS / tiles_x.div_ceil(1 << shift)) << shift;
        let bin_shift = (2..4).find(|&shift| rows_of(shift) >= tiles_y).unwrap_or(4);
        let rows = rows_of(bin_shift).min(tiles_y);
        let (bins_x, bins_y) = (tiles_x.div_ceil(1 << bin_shift), rows.div_ceil(1 << bin_shift));
        let most = (memory.min(gpu.adapter.max_binding) / 4).min(u32::MAX.into()) as u32;
        // Of few triangles a block has few, so that many workgroups share them out.
        let block = if triangles < FEW { FEW_BLOCK } else { BLOCK };
        let blocks = triangles.div_ceil(block * CHUNKS).max(1);
        let chunks = triangles.div_ceil(block * blocks).max(1);
        let grid = Grid {
            tiles_x,
            tiles_y: rows,
            bins_x,
            bins_y,
            bin_shift,
            triangles,
            chunks,
            blocks,
            // Of little memory half is left to lists of fragments.
            bin_capacity: (2 * triangles + 256).min(most / 6),
            tile_capacity: (4 * triangles + 256).min(most / 3),
            trips: if gpu.adapter.is_software() { SOFTWARE_TURNS } else { u32::MAX },
            parts: most_parts(tiles_x * rows),
            block,
            first_row: 0,
            pad0: 0,
            pad1: 0,
        };
        let n = u64::from(triangles);
        let piece_capacity = 256;
        gpu.checked("the bins", || {
            Ok(Self {
                rasters: storage(gpu, "rasters", RASTER_BYTES * n),
                boxes: storage(gpu, "boxes", BOX_BYTES * n),
                color_starts: storage(gpu, "colour starts", if by_triangle { 0 } else { 4 * n }),
                key_planes: storage(gpu, "key planes", PLANE_BYTES * n),
                slopes: storage(gpu, "slopes", if has_gradients { SLOPE_BYTES * n } else { 0 }),
                pieces: storage(gpu, "pieces", PIECE_BYTES * u64::from(piece_capacity)),
                parts: storage(gpu, "parts", 4 * u64::from(grid.parts) * (CLASS_COUNT as u64 + 1)),
                classes: storage(gpu, "classes", 4 * CLASS_WORDS as u64),
                groups: std::array::from_fn(|_| indirect(gpu, "groups", 12)),
                clip_list: storage(gpu, "clip list", 4 * n),
                counters: storage(gpu, "counters", 4 * COUNTER_WORDS),
                matrix: storage(gpu, "bin matrix", 4 * u64::from(bins_x * bins_y * chunks)),
                bins: storage(gpu, "bins", 8 * u64::from(bins_x * bins_y)),
                tiles: storage(gpu, "tiles", 8 * u64::from(tiles_x * rows)),
                bin_entries: storage(gpu, "bin entries", 4 * u64::from(grid.bin_capacity)),
                tile_entries: storage(gpu, "tile entries", 4 * u64::from(grid.tile_capacity)),
                piece_capacity,
                all_rows: tiles_y,
                most_rows: rows,
                rows,
                grid,
            })
        })
    }

    /// Turns to the band that begins at a row of tiles; `false` past the last.
    pub fn turn_to(&mut self, first_row: u32) -> bool {
        let rest = self.all_rows.saturating_sub(first_row);
        if rest == 0 {
            return false;
        }
        self.grid.first_row = first_row;
        self.grid.tiles_y = self.rows.min(rest);
        self.grid.bins_y = self.grid.tiles_y.div_ceil(1 << self.grid.bin_shift);
        true
    }

    /// The row after the band's last.
    pub fn end_row(&self) -> u32 {
        self.grid.first_row + self.grid.tiles_y
    }

    /// Rows of tiles of a band, but for the last.
    pub fn rows(&self) -> u32 {
        self.rows
    }

    /// First rows of all bands.
    pub fn bands(&self) -> Vec<u32> {
        (0..self.all_rows).step_by(self.rows as usize).collect()
    }

    /// The first row of the band that a row of tiles is in.
    pub fn band_of(&self, row: u32) -> u32 {
        row / self.rows * self.rows
    }

    pub fn is_whole(&self) -> bool {
        self.grid.tiles_y == self.all_rows
    }

    pub fn is_last(&self) -> bool {
        self.end_row() >= self.all_rows
    }

    pub fn bytes(&self) -> [(&'static str, u64); 2] {
        let size = |buffers: &[&wgpu::Buffer]| buffers.iter().map(|b| b.size()).sum();
        let setup = [
            &self.rasters,
            &self.key_planes,
            &self.slopes,
            &self.pieces,
            &self.clip_list,
            &self.boxes,
            &self.color_starts,
        ];
        let bins = [&self.matrix, &self.bins, &self.bin_entries, &self.tiles, &self.tile_entries];
        [("setup", size(&setup)), ("bins", size(&bins))]
    }

    /// Copies what was counted to where the host can read it.
    pub fn read(&self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder) -> wgpu::Buffer {
        copied(gpu, encoder, &self.counters, 4 * COUNTER_WORDS)
    }

    pub fn room(&self) -> Room {
        let Grid { bin_capacity, tile_capacity, .. } = self.grid;
        Room { pieces: self.piece_capacity, bin_entries: bin_capacity, tile_entries: tile_capacity }
    }

    /// Bytes of what grows with the number of triangles in tiles.
    pub fn entry_bytes(&self) -> u64 {
        self.bin_entries.size() + self.tile_entries.size()
    }

    /// Makes the band smaller, if it can be, and takes less for it.
    pub fn halve(&mut self, gpu: &Gpu) -> Result<bool> {
        let Grid { tiles_y, first_row, bin_capacity, tile_capacity, .. } = self.grid;
        if tiles_y == 1 {
            return Ok(false);
        }
        self.rows = tiles_y / 2;
        self.turn_to(first_row);
        gpu.checked("the bins", || {
            self.hold(gpu, (bin_capacity / 2).max(1), (tile_capacity / 2).max(1));
            Ok(true)
        })
    }

    /// Has room for so many entries.
    fn hold(&mut self, gpu: &Gpu, bin_entries: u32, tile_entries: u32) {
        let entries = |label: &str, capacity: u32| storage(gpu, label, 4 * u64::from(capacity));
        if bin_entries != self.grid.bin_capacity {
            self.grid.bin_capacity = bin_entries;
            self.bin_entries = entries("bin entries", bin_entries);
        }
        if tile_entries != self.grid.tile_capacity {
            self.grid.tile_capacity = tile_entries;
            self.tile_entries = entries("tile entries", tile_entries);
        }
    }

    /// Makes room, or the band smaller. `memory`: bytes that lists may take.
    pub fn grow(&mut self, gpu: &Gpu, to: Room, memory: u64) -> Result<()> {
        let needed = 4 * (u64::from(to.bin_entries) + u64::from(to.tile_entries));
        let limit = memory.min(gpu.adapter.max_binding);
        if needed > limit && self.halve(gpu)? {
            return Ok(());
        }
        if needed > limit {
            return Err(Error::Capacity {
                what: "the triangle lists of one row of tiles".into(),
                needed,
                limit,
                advice: "raise memory=, or render with device=\"cpu\", or method \"exact\" with pipeline=\"linked_list\"".into(),
            });
        }
        gpu.checked("the bins", || {
            if to.pieces > self.piece_capacity {
                self.piece_capacity = to.pieces;
                self.pieces = storage(gpu, "pieces", PIECE_BYTES * u64::from(to.pieces));
            }
            let Grid { bin_capacity, tile_capacity, .. } = self.grid;
            self.hold(gpu, to.bin_entries.max(bin_capacity), to.tile_entries.max(tile_capacity));
            Ok(())
        })
    }
}
