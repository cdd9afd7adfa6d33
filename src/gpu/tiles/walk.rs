//! Walks over the tiles of an image: what opaque geometry hides, and the fragments that stages keep in lists.

use std::sync::Arc;

use wgpu::BufferUsages;

use super::Context;
use super::bins::{Bins, BinsKey, MOST_TRIES};
use super::counted::{Counted, Room, counted, never_settles};
use super::opaque::{Opaque, OpaqueKey};
use crate::error::Result;
use crate::gpu::buffers::with_contents;
use crate::gpu::device::{Gpu, SOFTWARE_TURNS};
use crate::gpu::kept::Kept;
use crate::gpu::rect::Rect;
use crate::gpu::resolve::TILE;
use crate::gpu::timing::Timing;
use crate::gpu::uniforms::Eye;
use crate::gpu::upload::Uploaded;
use crate::gpu::variant::{BuildStage, Variant};
use crate::methods::Method;

/// Triangles of a tile's list that one dispatch walks: a few milliseconds, or on a software driver, with what each takes
/// inside (up to seven pieces, their edges, and samples), as many turns as its loops have.
pub fn window_length(gpu: &Gpu, samples: u32) -> u32 {
    if gpu.adapter.is_software() { SOFTWARE_TURNS / walk_trips(samples) } else { 1 << 14 }
}

/// Loop iterations of a walk for each triangle, at most.
pub fn walk_trips(samples: u32) -> u32 {
    9 * samples + 21
}

/// Triangles of a tile's list that one workgroup keeps the fragments of.
const SLICE: u32 = 1024;

/// A scene as one camera sees it, in tiles; in bands of their rows, where not all have room at once.
pub struct Walker {
    scene: Arc<Uploaded>,
    eye: Eye,
    bins: Bins,
    bins_key: BinsKey,
    /// Of all bands.
    pub counted: Counted,
    pub opaque: Opaque,
}

impl Walker {
    /// Sets up and bins until every band has room. `memory`: bytes that lists of triangles may take.
    pub fn new(
        of: Context,
        (kept, scene): (&mut Kept, Arc<Uploaded>),
        eye: Eye,
        size: (u32, u32),
        memory: u64,
        mut add_time: impl FnMut(String, f64),
    ) -> Result<Self> {
        let gpu = of.gpu;
        let bins_key = BinsKey { triangles: scene.triangles, size, colors: of.variant().colors, memory };
        let bins = Bins::taken(kept, &bins_key)?;
        let opaque_key = OpaqueKey::of(of.variant(), size);
        let opaque = kept.opaque.take(&opaque_key, || Opaque::new(gpu, &opaque_key))?;
        let mut walker = Self { scene, eye, bins, bins_key, counted: Counted::default(), opaque };
        let mut first_row = 0;
        let mut tries = 0;
        while walker.bins.turn_to(first_row) {
            tries += 1;
            if tries > MOST_TRIES {
                return Err(never_settles(gpu));
            }
            match walker.bin(of, &mut add_time)? {
                Ok(counted) => {
                    walker.counted = walker.counted.with(counted);
                    first_row = walker.bins.end_row();
                    tries = 0;
                }
                Err(needed) => {
                    let rows = walker.bins.rows();
                    walker.bins.grow(gpu, needed, memory)?;
                    if walker.bins.rows() != rows {
                        // Bands begin at other rows now.
                        (first_row, walker.counted) = (0, Counted::default());
                    }
                }
            }
        }
        Ok(walker)
    }

    /// Bins the band that bins are turned to, and counts.
    fn bin(
        &self,
        of: Context,
        add_time: &mut impl FnMut(String, f64),
    ) -> Result<std::result::Result<Counted, Room>> {
        let gpu = of.gpu;
        let timing = Timing::new(gpu);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        gpu.checked("binning", || self.encode_bins(of, &mut encoder, &timing))?;
        let counters = self.bins.read(gpu, &mut encoder);
        let times = timing.finish(&mut encoder);
        let buffers: Vec<&wgpu::Buffer> = [&counters].into_iter().chain(times).collect();
        let words = gpu.submit_and_read(encoder, &buffers)?;
        if let Some(times) = words.get(1) {
            timing.read(times).into_iter().for_each(|(stage, ms)| add_time(stage.into_owned(), ms));
        }
        counted(gpu, &words[0], self.bins.room())
    }

    fn encode_bins(&self, of: Context, encoder: &mut wgpu::CommandEncoder, timing: &Timing) -> Result<()> {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("bin"),
            timestamp_writes: timing.compute("bin"),
        });
        self.bins.encode(of, &self.scene, self.eye, &mut pass)
    }

    /// First rows of pixels of the bands.
    pub fn bands(&self) -> Vec<u32> {
        self.bins.bands().into_iter().map(|row| row * TILE).collect()
    }

    /// Bins the band of a row of pixels, unless that is what was binned last.
    pub fn turn_to(&mut self, of: Context, y: u32) -> Result<()> {
        let first_row = self.bins.band_of(y / TILE);
        if self.bins.grid.first_row == first_row {
            return Ok(());
        }
        self.bins.turn_to(first_row);
        let mut encoder = of.gpu.device.create_command_encoder(&Default::default());
        of.gpu.checked("binning", || {
            self.encode_bins(of, &mut encoder, &Timing::new(of.gpu))?;
            of.gpu.queue.submit([encoder.finish()]);
            Ok(())
        })
    }

    /// Leaves what the next render can use.
    pub fn leave(self, kept: &mut Kept, variant: &Variant) {
        kept.opaque.put(OpaqueKey::of(variant, self.bins_key.size), self.opaque);
        kept.bins.put(self.bins_key, self.bins);
    }

    pub fn bytes(&self) -> Vec<(&'static str, u64)> {
        [&self.bins.bytes()[..], &[("geometry", self.scene.bytes), ("targets", self.opaque.bytes())]].concat()
    }

    /// The tiles' lists in slices of so many triangles, a workgroup for each slice of each of `tiles`; at most `side_by_side`
    /// of them in a dispatch.
    fn encode_slices(
        &self,
        of: Context,
        pass: &mut wgpu::ComputePass,
        tiles: (u32, u32),
        count: u32,
        side_by_side: u32,
    ) {
        let gpu = of.gpu;
        let longest = self.counted.longest.max(1);
        for first in (0..longest).step_by(count as usize * side_by_side as usize) {
            let slices = (longest - first).div_ceil(count).min(side_by_side);
            let window = self.bins.window(first, count);
            let window = with_contents(gpu, "window", BufferUsages::UNIFORM, &[window]);
            let group = self.bins.walk_group(of, &self.scene, &window);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(tiles.0, tiles.1, slices);
        }
    }

    pub fn encode_opaque(
        &self,
        of: Context,
        encoder: &mut wgpu::CommandEncoder,
        timing: &Timing,
    ) -> Result<()> {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("opaque"),
            timestamp_writes: timing.compute("opaque"),
        });
        self.opaque.set_walk(of, &mut pass)?;
        let grid = &self.bins.grid;
        // Of equal depths the later triangle hides, so slices come one after the other.
        let count = window_length(of.gpu, of.variant().layout.samples);
        self.encode_slices(of, &mut pass, (grid.tiles_x, grid.tiles_y), count, 1);
        Ok(())
    }

    /// Streams the fragments of rows of tiles into a method. `group`: what it binds beside the walk.
    pub fn encode_stream(
        &self,
        of: Context,
        method: &Method,
        group: &wgpu::BindGroup,
        rows: u32,
        encoder: &mut wgpu::CommandEncoder,
        timing: &Timing,
    ) -> Result<()> {
        let pipeline = of.stages().stream(of.gpu, of.variant(), method)?;
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("method"),
            timestamp_writes: timing.compute("method"),
        });
        let window = self.bins.window(0, u32::MAX);
        let window = with_contents(of.gpu, "window", BufferUsages::UNIFORM, &[window]);
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &self.bins.walk_group(of, &self.scene, &window), &[]);
        pass.set_bind_group(1, group, &[]);
        self.opaque.set_read(of, &mut pass);
        pass.dispatch_workgroups(self.bins.grid.tiles_x, rows, 1);
        Ok(())
    }

    /// Counts the fragments of a rectangle, or scatters them into its lists. `lists`: the layout and what is bound of
    /// that stage.
    pub fn encode_keep(
        &self,
        of: Context,
        stage: BuildStage,
        lists: (&wgpu::BindGroupLayout, &wgpu::BindGroup),
        rect: Rect,
        encoder: &mut wgpu::CommandEncoder,
        timing: &Timing,
    ) -> Result<()> {
        let pipeline = of.stages().keep(of.gpu, of.variant(), stage, lists.0)?;
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("lists"),
            timestamp_writes: timing.compute(if stage == BuildStage::Count { "count" } else { "scatter" }),
        });
        pass.set_pipeline(pipeline);
        pass.set_bind_group(1, lists.1, &[]);
        self.opaque.set_read(of, &mut pass);
        let tiles = |start: u32, length: u32| (start + length).div_ceil(TILE) - start / TILE;
        let tiles = (tiles(rect.x0, rect.w), tiles(rect.y0, rect.h));
        // Fragments come in any order, so that one tile of many triangles need not keep the others waiting.
        let count = SLICE.min(window_length(of.gpu, of.variant().layout.samples));
        self.encode_slices(of, &mut pass, tiles, count, of.gpu.limits.max_compute_workgroups_per_dimension);
        Ok(())
    }
}
