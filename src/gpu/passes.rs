//! The passes of a render: opaque geometry, then for each rectangle the lists and what they resolve to.

use std::sync::Arc;
use std::time::Instant;

use wgpu::BufferUsages;

use super::buffers::{Bound, bind, with_contents};
use super::device::Gpu;
use super::geometry::Geometry;
use super::pipelines::Pipelines;
use super::pool::Pool;
use super::readback::copied;
use super::rect::Rect;
use super::targets::Targets;
use super::tiles::{self, Walker};
use super::timing::Timing;
use super::uniforms::Band;
use super::variant::BuildStage;
use crate::error::Result;
use crate::frame::Stats;

/// Steps of one invocation along a list before it stores its state: far below the 65,535 loop iterations
/// after which Mesa's llvmpipe ends every loop of an invocation, and 20 ms of dependent loads on a GPU.
const TRIP_BUDGET: u32 = 32_768;

/// One render on its way.
pub struct Frame<'a> {
    pub gpu: &'a Gpu,
    pub pipelines: Arc<Pipelines>,
    pub raster: Raster,
    pub view: wgpu::Buffer,
    pub targets: Targets,
    pub width: u32,
    /// Entries of scratch for long lists.
    pub scratch: u64,
}

/// What turns triangles into fragments.
pub enum Raster {
    Hardware(Geometry),
    Tiles(Box<Walker>),
}

impl Raster {
    pub fn rejected(&self) -> u64 {
        match self {
            Self::Hardware(geometry) => geometry.found.rejected,
            Self::Tiles(walker) => walker.counted.rejected,
        }
    }

    pub fn bytes(&self) -> Vec<(&'static str, u64)> {
        match self {
            Self::Hardware(geometry) => vec![("geometry", geometry.bytes)],
            Self::Tiles(walker) => walker.bytes(),
        }
    }
}

impl Frame<'_> {
    /// Draws what hides, if anything does: it becomes the background of its samples.
    pub fn draw_opaque(&mut self, stats: &mut Stats) -> Result<()> {
        if !self.pipelines.variant.hides {
            return Ok(());
        }
        if let Raster::Tiles(walker) = &self.raster {
            for y in walker.bands() {
                self.turn_to(y)?;
                self.draw_opaque_band(stats)?;
            }
            return Ok(());
        }
        self.draw_opaque_band(stats)
    }

    /// Makes ready for a row of pixels.
    pub fn turn_to(&mut self, y: u32) -> Result<()> {
        let of = tiles::Context { gpu: self.gpu, pipelines: &self.pipelines, view: &self.view };
        match &mut self.raster {
            Raster::Hardware(_) => Ok(()),
            Raster::Tiles(walker) => walker.turn_to(of, y),
        }
    }

    fn draw_opaque_band(&self, stats: &mut Stats) -> Result<()> {
        let timing = Timing::new(self.gpu);
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let geometry = match &self.raster {
            Raster::Hardware(geometry) => geometry,
            Raster::Tiles(walker) => {
                self.gpu.checked("the opaque pass", || {
                    walker.encode_opaque(self.tiles(), &mut encoder, &timing)
                })?;
                return self.submit(encoder, &timing, &[], stats).map(|_| ());
            }
        };
        let pipeline = self.pipelines.opaque(self.gpu)?;
        let color = [Some(wgpu::RenderPassColorAttachment {
            view: &self.targets.opaque_color,
            depth_slice: None,
            resolve_target: None,
            // Alpha 0 marks what no opaque surface covers.
            ops: wgpu::Operations {
                load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                store: wgpu::StoreOp::Store,
            },
        })];
        self.gpu.checked("the opaque pass", || {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("opaque"),
                color_attachments: &color,
                depth_stencil_attachment: self.targets.depth_to_write(),
                timestamp_writes: timing.render("opaque"),
                ..Default::default()
            });
            pass.set_pipeline(pipeline);
            geometry.draw(&mut pass);
            Ok(())
        })?;
        self.submit(encoder, &timing, &[], stats).map(|_| ())
    }

    /// Of the tile rasteriser.
    fn tiles(&self) -> tiles::Context<'_> {
        tiles::Context { gpu: self.gpu, pipelines: &self.pipelines, view: &self.view }
    }

    pub fn band(&self, pool: &Pool, rect: Rect) -> wgpu::Buffer {
        let band = Band {
            x0: rect.x0,
            y0: rect.y0,
            width: rect.w,
            height: rect.h,
            capacity: pool.capacity as u32,
            trip_budget: TRIP_BUDGET,
            pad: [0; 2],
        };
        with_contents(self.gpu, "band", BufferUsages::UNIFORM, &[band])
    }

    /// What the stages after the build bind as group 0.
    pub fn read_group(&self, pool: &Pool, band: &wgpu::Buffer) -> wgpu::BindGroup {
        let opaque: Bound = match &self.raster {
            Raster::Hardware(_) => (&self.targets.opaque_color).into(),
            Raster::Tiles(walker) => (&walker.opaque.colors).into(),
        };
        bind(
            self.gpu,
            "read",
            &self.pipelines.layouts.read,
            &[
                (&self.view).into(),
                band.into(),
                (&pool.heads).into(),
                (&pool.nodes).into(),
                (&pool.image).into(),
                (&pool.counts).into(),
                (&self.targets.background).into(),
                opaque,
            ],
        )
    }

    /// A pass over translucent geometry: what it binds as group 1 is the stage's.
    pub fn encode_build(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        stage: BuildStage,
        lists: &wgpu::BindGroup,
        rect: Rect,
        timing: &Timing,
    ) -> Result<()> {
        let layouts = &self.pipelines.layouts;
        let geometry = match &self.raster {
            Raster::Hardware(geometry) => geometry,
            Raster::Tiles(walker) => {
                let scatters = stage == BuildStage::Scatter;
                let layout = if scatters { &layouts.scatter } else { &layouts.count };
                return walker.encode_keep(self.tiles(), stage, (layout, lists), rect, encoder, timing);
            }
        };
        let pipeline = self.pipelines.build(self.gpu, stage)?;
        let depth = (self.pipelines.layouts.depth.as_ref())
            .zip(self.targets.depth_to_load.as_ref())
            .map(|(layout, view)| bind(self.gpu, "opaque depth", layout, &[view.into()]));
        let nothing = self.targets.nothing();
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("build"),
            color_attachments: nothing.as_slice(),
            depth_stencil_attachment: self.targets.depth_to_test(),
            timestamp_writes: timing.render(match stage {
                BuildStage::Link => "build",
                BuildStage::Append => "append",
                BuildStage::Count => "count",
                BuildStage::Scatter => "scatter",
            }),
            ..Default::default()
        });
        pass.set_pipeline(pipeline);
        pass.set_scissor_rect(rect.x0, rect.y0, rect.w, rect.h);
        pass.set_bind_group(1, lists, &[]);
        if let Some(depth) = &depth {
            pass.set_bind_group(2, depth, &[]);
        }
        geometry.draw(&mut pass);
        Ok(())
    }

    /// How many fragments each pixel of a rectangle has.
    pub fn count(&self, pool: &Pool, rect: Rect, stats: &mut Stats) -> Result<Vec<u32>> {
        let timing = Timing::new(self.gpu);
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let bytes = 4 * rect.pixels();
        let band = self.band(pool, rect);
        let result = self.gpu.checked("counting fragments", || {
            self.encode_count(&mut encoder, &pool.counts, &band, rect, &timing)?;
            Ok(copied(self.gpu, &mut encoder, &pool.counts, bytes))
        })?;
        let mut counts = self.submit(encoder, &timing, &[&result], stats)?.remove(0);
        counts.truncate(rect.pixels() as usize);
        Ok(counts)
    }

    pub fn encode_count(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        counts: &wgpu::Buffer,
        band: &wgpu::Buffer,
        rect: Rect,
        timing: &Timing,
    ) -> Result<()> {
        // Beyond the pixels too: the scan takes one more.
        encoder.clear_buffer(counts, 0, None);
        let layout = &self.pipelines.layouts.count;
        let group = bind(self.gpu, "count", layout, &[band.into(), counts.into()]);
        self.encode_build(encoder, BuildStage::Count, &group, rect, timing)
    }

    /// Submits, reads `buffers`, and adds the GPU time of the passes to the stats.
    pub fn submit(
        &self,
        mut encoder: wgpu::CommandEncoder,
        timing: &Timing,
        buffers: &[&wgpu::Buffer],
        stats: &mut Stats,
    ) -> Result<Vec<Vec<u32>>> {
        let clock = Instant::now();
        let times = timing.finish(&mut encoder);
        let all: Vec<&wgpu::Buffer> = buffers.iter().copied().chain(times).collect();
        let mut results = self.gpu.submit_and_read(encoder, &all)?;
        let mut waited = clock.elapsed().as_secs_f64() * 1e3; // what the passes themselves do not account for
        if times.is_some() {
            for (stage, ms) in timing.read(&results.pop().unwrap_or_default()) {
                stats.add(stage, ms);
                waited -= ms;
            }
        }
        stats.add("wait and readback", waited.max(0.0));
        Ok(results)
    }
}
