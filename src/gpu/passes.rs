//! The passes of a render: opaque geometry, then for each rectangle the lists and what they resolve to.

use std::time::Instant;

use wgpu::BufferUsages;

use super::buffers::{bind, readable, with_contents};
use super::device::Gpu;
use super::geometry::Geometry;
use super::long;
use super::pipelines::Pipelines;
use super::pool::{Pool, Rect};
use super::targets::place;
use super::timing::Timing;
use super::uniforms::Band;
use crate::error::{Error, Result};
use crate::frame::{Output, Stats};
use crate::shader::TEMP_FRAGMENTS;

/// Steps of one invocation along a list before it stores its state: far below the 65,535 loop iterations
/// after which Mesa's llvmpipe ends every loop of an invocation, and 20 ms of dependent loads on a GPU.
const TRIP_BUDGET: u32 = 32_768;

/// One render on its way.
pub struct Frame<'a> {
    pub gpu: &'a Gpu,
    pub pipelines: &'a Pipelines,
    pub geometry: Geometry,
    pub view: wgpu::Buffer,
    pub depth: wgpu::TextureView,
    pub background: wgpu::TextureView,
    pub background_is_texture: bool,
    pub width: u32,
    /// Entries of scratch for long lists.
    pub scratch: u64,
}

impl Frame<'_> {
    /// Clears depth, and draws opaque geometry if it hides anything.
    pub fn draw_opaque(&self, hides: bool, constant: Option<[f32; 4]>, stats: &mut Stats) -> Result<()> {
        let timing = Timing::new(self.gpu);
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let [r, g, b, a] = constant.unwrap_or_default().map(f64::from);
        let load = match constant {
            Some(_) => wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a }),
            None => wgpu::LoadOp::Load,
        };
        let color = [Some(wgpu::RenderPassColorAttachment {
            view: &self.background,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load, store: wgpu::StoreOp::Store },
        })];
        self.gpu.checked("the opaque pass", || {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("opaque"),
                color_attachments: if hides { &color } else { &[] },
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: &self.depth,
                    // Depth is reversed: 0 is infinitely far.
                    depth_ops: Some(wgpu::Operations {
                        load: wgpu::LoadOp::Clear(0.0),
                        store: wgpu::StoreOp::Store,
                    }),
                    stencil_ops: None,
                }),
                timestamp_writes: timing.render("opaque"),
                ..Default::default()
            });
            if hides {
                pass.set_pipeline(&self.pipelines.opaque);
                self.geometry.draw(&mut pass);
            }
            Ok(())
        })?;
        self.submit(encoder, &timing, &[], stats).map(|_| ())
    }

    /// Builds and resolves the lists of a rectangle. Returns how many nodes it needs; where they fit the
    /// pool, its part of the image is written.
    pub fn fill_and_resolve(&self, pool: &Pool, rect: Rect, output: &mut Output<f32>) -> Result<u64> {
        let gpu = self.gpu;
        let timing = Timing::new(gpu);
        let pixels = rect.pixels();
        let numbers = readable(gpu, "numbers", 12);
        let image = readable(gpu, "image", 16 * pixels);
        let counts = output.counts.is_some().then(|| readable(gpu, "counts", 4 * pixels));
        let band = self.band_uniform(pool, rect);
        let read_group = self.read_group(pool, &band);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        gpu.checked("building the lists", || {
            self.encode_build(&mut encoder, pool, rect, &band, &timing);
            let group = bind(gpu, "long pixels", &self.pipelines.long_pixels, &[(&pool.long_pixels).into()]);
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("resolve"),
                timestamp_writes: timing.compute("resolve"),
            });
            pass.set_pipeline(&self.pipelines.resolve);
            pass.set_bind_group(0, &read_group, &[]);
            pass.set_bind_group(1, &group, &[]);
            pass.dispatch_workgroups(rect.w.div_ceil(8), rect.h.div_ceil(8), 1);
            drop(pass);
            encoder.copy_buffer_to_buffer(&pool.counter, 0, &numbers, 0, 8);
            encoder.copy_buffer_to_buffer(&pool.long_pixels, 0, &numbers, 8, 4);
            self.copy_results(&mut encoder, pool, rect, &image, counts.as_ref());
            Ok(())
        })?;
        let buffers: Vec<&wgpu::Buffer> = [&numbers, &image].into_iter().chain(&counts).collect();
        let mut results = self.submit(encoder, &timing, &buffers, &mut output.stats)?;
        let [low, high, long_count, ..] = *results[0].as_slice() else {
            return Err(Error::Device("the counter was not read back".into()));
        };
        let demand = u64::from(high) << 32 | u64::from(low);
        if demand > pool.capacity {
            return Ok(demand);
        }
        if long_count > 0 {
            debug_assert!(demand > u64::from(TEMP_FRAGMENTS));
            long::resolve(self, pool, &read_group, long_count, self.scratch, &mut output.stats)?;
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            self.copy_results(&mut encoder, pool, rect, &image, counts.as_ref());
            results = gpu.submit_and_read(encoder, &buffers)?;
        }
        place(&results[1], &mut output.image, self.width, rect);
        if let (Some(all), Some(counts)) = (&mut output.counts, results.get(2)) {
            place(counts, all, self.width, rect);
        }
        Ok(demand)
    }

    fn band_uniform(&self, pool: &Pool, rect: Rect) -> wgpu::Buffer {
        let band = Band {
            x0: rect.x0,
            y0: rect.y0,
            width: rect.w,
            height: rect.h,
            capacity: pool.capacity as u32,
            background_texture: u32::from(self.background_is_texture),
            trip_budget: TRIP_BUDGET,
            pad: 0,
        };
        with_contents(self.gpu, "band", BufferUsages::UNIFORM, &[band])
    }

    fn read_group(&self, pool: &Pool, band: &wgpu::Buffer) -> wgpu::BindGroup {
        bind(
            self.gpu,
            "read",
            &self.pipelines.read,
            &[
                (&self.view).into(),
                band.into(),
                (&pool.heads).into(),
                (&pool.node_color).into(),
                (&pool.node_order).into(),
                (&pool.node_next).into(),
                (&pool.image).into(),
                (&pool.counts).into(),
                (&self.background).into(),
            ],
        )
    }

    fn encode_build(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        pool: &Pool,
        rect: Rect,
        band: &wgpu::Buffer,
        timing: &Timing,
    ) {
        // Cleared here, at the start, never by the resolve: a frame must not depend on the one before it.
        encoder.clear_buffer(&pool.heads, 0, Some(4 * rect.pixels()));
        encoder.clear_buffer(&pool.counter, 0, None);
        encoder.clear_buffer(&pool.long_pixels, 0, Some(4));
        let lists = bind(
            self.gpu,
            "lists",
            &self.pipelines.lists,
            &[
                band.into(),
                (&pool.heads).into(),
                (&pool.counter).into(),
                (&pool.node_color).into(),
                (&pool.node_order).into(),
                (&pool.node_next).into(),
            ],
        );
        let depth = self
            .pipelines
            .depth
            .as_ref()
            .map(|layout| bind(self.gpu, "opaque depth", layout, &[(&self.depth).into()]));
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("build"),
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.depth,
                depth_ops: None, // read only
                stencil_ops: None,
            }),
            timestamp_writes: timing.render("build"),
            ..Default::default()
        });
        pass.set_pipeline(&self.pipelines.build);
        pass.set_scissor_rect(rect.x0, rect.y0, rect.w, rect.h);
        pass.set_bind_group(1, &lists, &[]);
        if let Some(depth) = &depth {
            pass.set_bind_group(2, depth, &[]);
        }
        self.geometry.draw(&mut pass);
    }

    fn copy_results(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        pool: &Pool,
        rect: Rect,
        image: &wgpu::Buffer,
        counts: Option<&wgpu::Buffer>,
    ) {
        encoder.copy_buffer_to_buffer(&pool.image, 0, image, 0, 16 * rect.pixels());
        if let Some(counts) = counts {
            encoder.copy_buffer_to_buffer(&pool.counts, 0, counts, 0, 4 * rect.pixels());
        }
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
