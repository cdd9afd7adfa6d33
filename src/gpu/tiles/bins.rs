//! Triangles set up and binned for one camera.

use wgpu::BufferUsages;

use super::Context;
use super::stages::MAX_BINS;
use crate::error::{Error, Result};
use crate::gpu::buffers::{bind, readable, storage, with_contents};
use crate::gpu::device::Gpu;
use crate::gpu::pool::Rect;
use crate::gpu::resolve::TILE;
use crate::gpu::timing::Timing;
use crate::gpu::uniforms::{Eye, Grid};
use crate::gpu::upload::Uploaded;

/// Invocations of a workgroup, and triangles of a block (BLOCK in shaders/tiles/bin.wgsl).
const BLOCK: u32 = 256;
/// Chunks that triangles are counted in, about: one workgroup each.
const CHUNKS: u32 = 1024;
/// Workgroups that clip, of 64 invocations.
const CLIP_GROUPS: u32 = 16;
/// Words of `Counters`, bytes of `Raster`, `KeyPlane`, a slope and a piece (shaders/tiles/triangle.wgsl).
const COUNTER_WORDS: u64 = 10;
const RASTER_BYTES: u64 = 32;
const PLANE_BYTES: u64 = 32;
const SLOPE_BYTES: u64 = 16;
const PIECE_BYTES: u64 = 24;

pub struct Bins {
    pub grid: Grid,
    pub rasters: wgpu::Buffer,
    pub key_planes: wgpu::Buffer,
    pub slopes: wgpu::Buffer,
    pub pieces: wgpu::Buffer,
    pub tiles: wgpu::Buffer,
    pub tile_entries: wgpu::Buffer,
    clip_list: wgpu::Buffer,
    counters: wgpu::Buffer,
    matrix: wgpu::Buffer,
    bins: wgpu::Buffer,
    bin_entries: wgpu::Buffer,
    piece_capacity: u32,
}

/// What setup and binning counted.
#[derive(Debug, Clone, Copy)]
pub struct Counted {
    pub rejected: u64,
    /// The longest list of a tile.
    pub longest: u32,
    /// The pixels where translucent triangles may land.
    pub rect: Option<Rect>,
}

impl Bins {
    /// Room for a scene's triangles, and as many entries as one triangle mostly has.
    pub fn new(gpu: &Gpu, triangles: u32, has_gradients: bool, (width, height): (u32, u32)) -> Result<Self> {
        let (tiles_x, tiles_y) = (width.div_ceil(TILE), height.div_ceil(TILE));
        // The least bins of at least 4×4 tiles of which there is room for all.
        let bins_of = |shift: u32| (tiles_x.div_ceil(1 << shift), tiles_y.div_ceil(1 << shift));
        let fits = |shift: &u32| bins_of(*shift).0 * bins_of(*shift).1 <= MAX_BINS;
        let bin_shift = (2..=4).find(fits).ok_or_else(|| {
            Error::Unsupported(format!(
                "tiles on a GPU render up to {MAX_BINS} bins of 256×256 pixels, got {width}×{height}; \
             device=\"cpu\" and pipeline=\"linked_list\" render more"
            ))
        })?;
        let (bins_x, bins_y) = bins_of(bin_shift);
        let blocks = triangles.div_ceil(BLOCK * CHUNKS).max(1);
        let chunks = triangles.div_ceil(BLOCK * blocks).max(1);
        let grid = Grid {
            tiles_x,
            tiles_y,
            bins_x,
            bins_y,
            bin_shift,
            triangles,
            chunks,
            blocks,
            bin_capacity: 2 * triangles + 256,
            tile_capacity: 4 * triangles + 256,
            trips: if gpu.adapter.is_software() { 60_000 } else { u32::MAX },
            pad0: 0,
        };
        let n = u64::from(triangles);
        let piece_capacity = 256;
        gpu.checked("the bins", || {
            Ok(Self {
                rasters: storage(gpu, "rasters", RASTER_BYTES * n),
                key_planes: storage(gpu, "key planes", PLANE_BYTES * n),
                slopes: storage(gpu, "slopes", if has_gradients { SLOPE_BYTES * n } else { 0 }),
                pieces: storage(gpu, "pieces", PIECE_BYTES * u64::from(piece_capacity)),
                clip_list: storage(gpu, "clip list", 4 * n),
                counters: storage(gpu, "counters", 4 * COUNTER_WORDS),
                matrix: storage(gpu, "bin matrix", 4 * u64::from(bins_x * bins_y * chunks)),
                bins: storage(gpu, "bins", 8 * u64::from(bins_x * bins_y)),
                tiles: storage(gpu, "tiles", 8 * u64::from(tiles_x * tiles_y)),
                bin_entries: storage(gpu, "bin entries", 4 * u64::from(grid.bin_capacity)),
                tile_entries: storage(gpu, "tile entries", 4 * u64::from(grid.tile_capacity)),
                piece_capacity,
                grid,
            })
        })
    }

    pub fn bytes(&self) -> [(&'static str, u64); 2] {
        let size = |buffers: &[&wgpu::Buffer]| buffers.iter().map(|b| b.size()).sum();
        let setup = [&self.rasters, &self.key_planes, &self.slopes, &self.pieces, &self.clip_list];
        let bins = [&self.matrix, &self.bins, &self.bin_entries, &self.tiles, &self.tile_entries];
        [("setup", size(&setup)), ("bins", size(&bins))]
    }

    /// Sets up and bins all triangles. `eye` gets what only this knows.
    pub fn encode(
        &self,
        of: Context,
        scene: &Uploaded,
        eye: Eye,
        encoder: &mut wgpu::CommandEncoder,
        timing: &Timing,
    ) -> Result<()> {
        let (gpu, view, stages) = (of.gpu, of.view, of.stages());
        let eye = Eye { triangles: self.grid.triangles, piece_capacity: self.piece_capacity, ..eye };
        let eye = with_contents(gpu, "eye", BufferUsages::UNIFORM, &[eye]);
        let grid = with_contents(gpu, "grid", BufferUsages::UNIFORM, &[self.grid]);
        let (setup, bin) = (stages.setup(gpu, of.variant())?, stages.bin(gpu, of.variant())?);
        let setup_group = bind(
            gpu,
            "tile setup",
            &stages.setup_layout,
            &[
                view.into(),
                (&eye).into(),
                (&scene.positions).into(),
                (&scene.position_rests).into(),
                (&scene.faces).into(),
                (&scene.mesh_ids).into(),
                (&scene.meshes).into(),
                (&self.rasters).into(),
                (&self.key_planes).into(),
                (&self.slopes).into(),
                (&self.pieces).into(),
                (&self.clip_list).into(),
                (&self.counters).into(),
            ],
        );
        let bin_group = bind(
            gpu,
            "tile binning",
            &stages.bin_layout,
            &[
                view.into(),
                (&grid).into(),
                (&self.rasters).into(),
                (&self.pieces).into(),
                (&self.counters).into(),
                (&self.matrix).into(),
                (&self.bins).into(),
                (&self.bin_entries).into(),
                (&self.tiles).into(),
                (&self.tile_entries).into(),
            ],
        );
        encoder.clear_buffer(&self.counters, 0, None);
        let Grid { triangles, bins_x, bins_y, chunks, .. } = self.grid;
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("set up"),
            timestamp_writes: timing.compute("set up"),
        });
        pass.set_bind_group(0, &setup_group, &[]);
        pass.set_pipeline(&setup.setup);
        let groups = triangles.div_ceil(BLOCK);
        let x = groups.clamp(1, gpu.limits.max_compute_workgroups_per_dimension);
        pass.dispatch_workgroups(x, groups.div_ceil(x), 1);
        pass.set_pipeline(&setup.clip);
        pass.dispatch_workgroups(CLIP_GROUPS, 1, 1);
        drop(pass);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("bin"),
            timestamp_writes: timing.compute("bin"),
        });
        pass.set_bind_group(0, &bin_group, &[]);
        for (pipeline, groups) in [
            (&bin.count_bins, chunks),
            (&bin.offsets, bins_x * bins_y),
            (&bin.scatter_bins, chunks),
            (&bin.bin_tiles, bins_x * bins_y),
        ] {
            pass.set_pipeline(pipeline);
            pass.dispatch_workgroups(groups, 1, 1);
        }
        Ok(())
    }

    /// Copies what was counted to where the host can read it.
    pub fn read(&self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder) -> wgpu::Buffer {
        let copy = readable(gpu, "counters", 4 * COUNTER_WORDS);
        encoder.copy_buffer_to_buffer(&self.counters, 0, &copy, 0, 4 * COUNTER_WORDS);
        copy
    }

    /// What was counted, or `None` where there was no room: now there is. `memory`: bytes that lists may take.
    pub fn counted(&mut self, gpu: &Gpu, words: &[u32], memory: u64) -> Result<Option<Counted>> {
        let [rejected, _, pieces, bin_entries, tile_entries, longest, left, top, x1, y1, ..] = *words else {
            return Err(Error::Device("the counters were not read back".into()));
        };
        if longest == u32::MAX {
            return Err(Error::Unsupported(format!(
                "{} ends loops too early to bin so many triangles in one place; pipeline=\"linked_list\" and \
                 device=\"cpu\" do not mind",
                gpu.adapter.name
            )));
        }
        let grid = &mut self.grid;
        let (bin_fits, tile_fits) = (bin_entries <= grid.bin_capacity, tile_entries <= grid.tile_capacity);
        if pieces <= self.piece_capacity && bin_fits && tile_fits {
            let (x0, y0) = (65536 - left, 65536 - top);
            let rect = (left > 0).then(|| Rect { x0, y0, w: x1 - x0, h: y1 - y0 });
            return Ok(Some(Counted { rejected: rejected.into(), longest, rect }));
        }
        let needed = 4 * (u64::from(bin_entries) + u64::from(tile_entries));
        let limit = memory.min(gpu.adapter.max_binding);
        if needed > limit {
            return Err(Error::Capacity {
                what: "the triangle lists of all tiles".into(),
                needed,
                limit,
                advice: "raise memory=, or render with pipeline=\"linked_list\" or device=\"cpu\"".into(),
            });
        }
        gpu.checked("the bins", || {
            let entries = |label: &str, capacity: u32| storage(gpu, label, 4 * u64::from(capacity));
            if pieces > self.piece_capacity {
                self.piece_capacity = pieces;
                self.pieces = storage(gpu, "pieces", PIECE_BYTES * u64::from(pieces));
            }
            if !bin_fits {
                grid.bin_capacity = bin_entries;
                self.bin_entries = entries("bin entries", bin_entries);
            }
            // Of bins that were not whole nothing is known.
            if !tile_fits {
                grid.tile_capacity = tile_entries;
                self.tile_entries = entries("tile entries", tile_entries);
            }
            Ok(None)
        })
    }
}
