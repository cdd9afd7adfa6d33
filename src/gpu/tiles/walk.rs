//! Walks over the tiles of an image: what opaque geometry hides, and the fragments that stages keep in lists.

use std::sync::Arc;

use wgpu::BufferUsages;

use super::Context;
use super::bins::{Bins, BinsKey, Counted, counted};
use super::opaque::{Opaque, OpaqueKey};
use super::stages::MAX_BINS;
use crate::error::{Error, Result};
use crate::gpu::buffers::with_contents;
use crate::gpu::device::Gpu;
use crate::gpu::kept::Kept;
use crate::gpu::pool::Rect;
use crate::gpu::resolve::TILE;
use crate::gpu::timing::Timing;
use crate::gpu::uniforms::Eye;
use crate::gpu::upload::Uploaded;
use crate::gpu::variant::{BuildStage, Variant};

/// Triangles of a tile's list that one dispatch walks: a few milliseconds, or on a software driver, with what each takes
/// inside (up to seven pieces, their edges, and samples), below the 65,535 loop iterations after which Mesa's llvmpipe
/// ends every loop of an invocation.
pub fn window_length(gpu: &Gpu, samples: u32) -> u32 {
    if gpu.adapter.is_software() { 60_000 / (9 * samples + 21) } else { 1 << 14 }
}

/// A scene as one camera sees it, in tiles.
pub struct Walker {
    scene: Arc<Uploaded>,
    bins: Bins,
    bins_key: BinsKey,
    pub counted: Counted,
    pub opaque: Opaque,
}

impl Walker {
    /// Sets up and bins until everything has room. `memory`: bytes that lists of triangles may take.
    pub fn new(
        of: Context,
        (kept, scene): (&mut Kept, Arc<Uploaded>),
        eye: Eye,
        size: (u32, u32),
        memory: u64,
        mut add_time: impl FnMut(String, f64),
    ) -> Result<Self> {
        let Context { gpu, .. } = of;
        let bins_key = BinsKey { triangles: scene.triangles, size, colors: of.variant().colors, memory };
        let mut bins = kept.bins.take(&bins_key, || Bins::new(gpu, &bins_key))?;
        if !bins.turn_to_whole() {
            return Err(Error::Unsupported(format!(
                "tiles on a GPU keep lists of up to {MAX_BINS} bins of 256×256 pixels, got {}×{}; \
                 device=\"cpu\" and pipeline=\"linked_list\" keep more",
                size.0, size.1
            )));
        }
        let opaque_key = OpaqueKey::of(of.variant(), size);
        let opaque = kept.opaque.take(&opaque_key, || Opaque::new(gpu, &opaque_key))?;
        // Pieces, then bins, then tiles: each may show the next demand.
        for _ in 0..4 {
            let timing = Timing::new(gpu);
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            gpu.checked("binning", || {
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                    label: Some("bin"),
                    timestamp_writes: timing.compute("bin"),
                });
                bins.encode(of, &scene, eye, &mut pass)
            })?;
            let counters = bins.read(gpu, &mut encoder);
            let times = timing.finish(&mut encoder);
            let buffers: Vec<&wgpu::Buffer> = [&counters].into_iter().chain(times).collect();
            let words = gpu.submit_and_read(encoder, &buffers)?;
            if let Some(times) = words.get(1) {
                timing.read(times).into_iter().for_each(|(stage, ms)| add_time(stage.into_owned(), ms));
            }
            match counted(gpu, &words[0], bins.room())? {
                Ok(counted) => return Ok(Self { scene, bins, bins_key, counted, opaque }),
                Err(needed) => bins.grow(gpu, needed, memory, false)?,
            }
        }
        Err(Error::Device(format!(
            "{} counts other triangles each time: its driver is at fault; device=\"cpu\" works",
            gpu.adapter.name
        )))
    }

    /// Leaves what the next render can use.
    pub fn leave(self, kept: &mut Kept, variant: &Variant) {
        kept.opaque.put(OpaqueKey::of(variant, self.bins_key.size), self.opaque);
        kept.bins.put(self.bins_key, self.bins);
    }

    pub fn bytes(&self) -> Vec<(&'static str, u64)> {
        [&self.bins.bytes()[..], &[("geometry", self.scene.bytes), ("targets", self.opaque.bytes())]].concat()
    }

    /// A dispatch for each part of the tiles' lists, each a workgroup for each of `tiles`.
    fn encode_windows(&self, of: Context, pass: &mut wgpu::ComputePass, tiles: (u32, u32)) {
        let gpu = of.gpu;
        let count = window_length(gpu, of.variant().layout.samples);
        for first in (0..self.counted.longest.max(1)).step_by(count as usize) {
            let window = self.bins.window(first, count);
            let window = with_contents(gpu, "window", BufferUsages::UNIFORM, &[window]);
            let group = self.bins.walk_group(of, &self.scene, &window);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(tiles.0, tiles.1, 1);
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
        self.encode_windows(of, &mut pass, (grid.tiles_x, grid.tiles_y));
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
        self.encode_windows(of, &mut pass, (tiles(rect.x0, rect.w), tiles(rect.y0, rect.h)));
        Ok(())
    }
}
