//! The `linked_list` pipeline (GPU Pro 2, chapter III.2): opaque geometry into depth and colour, translucent
//! geometry into per-pixel lists, lists into an image.
//!
//! The pool of nodes is never guessed. The counter of the build runs past its capacity, so that one pass
//! tells the exact demand; what did not fit is rendered again in a larger pool or, past `memory` or the
//! device's limits, in two halves of its rectangle, down to a tile.

use std::time::Instant;

use wgpu::BufferUsages;

use super::buffers::{bind, readable, storage, with_contents};
use super::device::Gpu;
use super::geometry::Geometry;
use super::lists::{BandLists, assemble};
use super::long;
use super::pipelines::{COLOR_FORMAT, DEPTH_FORMAT, Pipelines};
use super::timing::Timing;
use super::uniforms::{Band, View};
use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::fragments::Background;
use crate::frame::{Lists, Output, Request, Stats};
use crate::scene::Scene;
use crate::shader::TEMP_FRAGMENTS;

/// What heads, nodes and scratch may take together unless `memory=` says otherwise.
const DEFAULT_MEMORY: u64 = 2 << 30;
/// Bytes of a node: colour 16, key and order 8, next 4.
pub const NODE_BYTES: u64 = 28;
/// Bytes of scratch for a node of a long list: two entries, each padded to at most twice its number.
const SCRATCH_BYTES: u64 = 16;
/// Rectangles are not cut below this.
const MIN_SIDE: u32 = 16;
/// Steps of one invocation along a list before it stores its state: far below the 65,535 loop iterations
/// after which Mesa's llvmpipe ends every loop of an invocation, and 20 ms of dependent loads on a GPU.
const TRIP_BUDGET: u32 = 32_768;

/// A rectangle of pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rect {
    pub x0: u32,
    pub y0: u32,
    pub w: u32,
    pub h: u32,
}

impl Rect {
    pub fn pixels(&self) -> u64 {
        u64::from(self.w) * u64::from(self.h)
    }

    /// Two halves: bands of rows as long as there are some, then across. `None` for a tile.
    fn halves(&self) -> Option<[Self; 2]> {
        let half = |side: u32| (side / 2).next_multiple_of(MIN_SIDE).min(side - 1);
        if self.h > MIN_SIDE {
            let h = half(self.h);
            Some([Self { h, ..*self }, Self { y0: self.y0 + h, h: self.h - h, ..*self }])
        } else if self.w > MIN_SIDE {
            let w = half(self.w);
            Some([Self { w, ..*self }, Self { x0: self.x0 + w, w: self.w - w, ..*self }])
        } else {
            None
        }
    }
}

/// Buffers for the lists and results of one rectangle.
pub struct Pool {
    pub heads: wgpu::Buffer,
    pub counter: wgpu::Buffer,
    pub node_color: wgpu::Buffer,
    pub node_order: wgpu::Buffer,
    pub node_next: wgpu::Buffer,
    pub image: wgpu::Buffer,
    pub counts: wgpu::Buffer,
    /// A count, then pixels.
    pub long_pixels: wgpu::Buffer,
    pub pixels: u64,
    pub capacity: u64,
}

impl Pool {
    fn new(gpu: &Gpu, pixels: u64, capacity: u64) -> Result<Self> {
        gpu.checked("the node pool", || {
            Ok(Self {
                heads: storage(gpu, "heads", 4 * pixels),
                counter: storage(gpu, "counter", 4),
                node_color: storage(gpu, "node colours", 16 * capacity),
                node_order: storage(gpu, "node orders", 8 * capacity),
                node_next: storage(gpu, "node links", 4 * capacity),
                image: storage(gpu, "image", 16 * pixels),
                counts: storage(gpu, "counts", 4 * pixels),
                long_pixels: storage(gpu, "long pixels", 4 * (pixels + 1)),
                pixels,
                capacity,
            })
        })
    }

    /// Bytes of the lists.
    fn bytes(&self) -> u64 {
        4 * self.pixels + NODE_BYTES * self.capacity
    }
}

/// What `memory=` and the device allow.
struct Budget {
    /// Pixels of a rectangle: heads take at most a quarter of the memory.
    pixels: u64,
    /// Nodes of the pool.
    nodes: u64,
    /// Entries of scratch for long lists.
    scratch: u64,
    memory: u64,
}

impl Budget {
    fn of(gpu: &Gpu, memory: u64) -> Self {
        let binding = gpu.limits.max_storage_buffer_binding_size.min(gpu.limits.max_buffer_size);
        let pixels = (memory / 16).min(binding / 16).max(u64::from(MIN_SIDE * MIN_SIDE));
        let nodes = (memory - memory / 4) / (NODE_BYTES + SCRATCH_BYTES);
        Self {
            pixels,
            nodes: nodes.min(binding / 16).min(u64::from(u32::MAX >> 1)),
            scratch: (2 * nodes).max(1024).min(binding / 4),
            memory,
        }
    }
}

/// One render on its way.
pub struct Frame<'a> {
    pub gpu: &'a Gpu,
    pub pipelines: &'a Pipelines,
    geometry: Geometry,
    pub view: wgpu::Buffer,
    depth: wgpu::TextureView,
    pub background: wgpu::TextureView,
    background_is_texture: bool,
    width: u32,
    height: u32,
    scratch: u64,
}

pub fn render(
    gpu: &Gpu,
    scene: &Scene,
    camera: &Camera,
    request: &Request,
    background: Background<f32>,
) -> Result<Output<f32>> {
    let (width, height) = (request.width, request.height);
    let limit = gpu.limits.max_texture_dimension_2d;
    if width.max(height) > limit {
        return Err(Error::Unsupported(format!(
            "{} renders up to {limit} pixels a side, got {width}×{height}; device=\"cpu\" renders up to 16384",
            gpu.adapter.name
        )));
    }
    let pipelines = gpu.pipelines()?;
    let hides = scene.has_opaque() && request.lists != Lists::All;
    let mut stats = Stats { device: gpu.adapter.name.clone(), ..Stats::default() };
    let budget = Budget::of(gpu, request.memory.unwrap_or(DEFAULT_MEMORY));

    let clock = Instant::now();
    let frame = gpu.checked("uploading the scene", || {
        let rows = camera.clip_rows(scene.center);
        let view = view_uniform(scene, camera, request, &background);
        let view = with_contents(gpu, "view", BufferUsages::UNIFORM, &[view]);
        let geometry = Geometry::upload(gpu, pipelines, scene, &rows, &view);
        let background_is_texture = hides || matches!(background, Background::Image(_));
        let (w, h) = if background_is_texture { (width, height) } else { (1, 1) };
        let color = texture(gpu, "background", COLOR_FORMAT, w, h);
        if let Background::Image(pixels) = background {
            write_texture(gpu, &color, pixels, width, height);
        }
        Ok(Frame {
            gpu,
            pipelines,
            geometry,
            view,
            depth: texture(gpu, "depth", DEPTH_FORMAT, width, height).create_view(&Default::default()),
            background: color.create_view(&Default::default()),
            background_is_texture,
            width,
            height,
            scratch: budget.scratch,
        })
    })?;
    stats.rejected_triangles = frame.geometry.rejected;
    stats.stage("upload", clock);

    let constant = match background {
        Background::Constant(c) => Some(c),
        Background::Image(_) => None,
    };
    frame.draw_opaque(hides, constant, &mut stats)?;

    let mut output = Output {
        image: vec![[f32::NAN; 4]; request.pixels()],
        counts: (request.lists != Lists::None).then(|| vec![-1; request.pixels()]),
        background: None,
        fragments: None,
        stats,
    };
    let mut band_lists = Vec::new();
    let mut pool: Option<Pool> = None;
    let mut waiting = first_rects(width, height, budget.pixels);
    while let Some(rect) = waiting.pop() {
        let wanted = (4 * rect.pixels()).max(4096).min(budget.nodes);
        let fresh = match pool.take() {
            Some(pool) if pool.pixels >= rect.pixels() => pool,
            old => Pool::new(gpu, rect.pixels(), old.map_or(wanted, |p| p.capacity.max(wanted)))?,
        };
        let pool = pool.insert(fresh);
        let demand = frame.fill_and_resolve(pool, rect, &mut output)?;
        if demand <= pool.capacity {
            output.stats.fragments += demand;
            output.stats.bands += 1;
            if matches!(request.lists, Lists::Translucent | Lists::All) {
                band_lists.push(BandLists::read(gpu, pool, rect, demand, camera.is_perspective())?);
            }
        } else if demand <= budget.nodes {
            *pool = Pool::new(gpu, pool.pixels, demand)?;
            waiting.push(rect);
        } else {
            let halves = rect.halves().ok_or_else(|| Error::Capacity {
                what: format!("the fragments of the tile at [{}, {}]", rect.y0, rect.x0),
                needed: demand * (NODE_BYTES + SCRATCH_BYTES) + 4 * rect.pixels(),
                limit: budget.memory,
                advice: "raise memory=".into(),
            })?;
            waiting.extend(halves.into_iter().rev());
        }
    }
    let clock = Instant::now();
    if !band_lists.is_empty() {
        output.fragments = Some(assemble(band_lists, width, height)?);
        output.stats.stage("lists", clock);
        if hides {
            output.background = Some(frame.read_background()?);
        }
    }
    if let Some(counts) = &output.counts {
        output.stats.max_depth_complexity = counts.iter().max().map(|&n| n as u32);
    }
    let bytes = &mut output.stats.bytes;
    bytes.push(("geometry", frame.geometry.bytes));
    bytes.push(("pool", pool.as_ref().map_or(0, Pool::bytes)));
    let pixel_bytes = 4 + if frame.background_is_texture { 16 } else { 0 };
    bytes.push((
        "targets",
        pixel_bytes * request.pixels() as u64 + pool.as_ref().map_or(0, |p| 48 * p.pixels),
    ));
    Ok(output)
}

/// Bands of whole rows with at most `pixels` pixels, the top one last.
fn first_rects(width: u32, height: u32, pixels: u64) -> Vec<Rect> {
    let w = u64::from(width).min(pixels.max(1)) as u32;
    let h = ((pixels / u64::from(w)).max(1)).min(u64::from(height)) as u32;
    let mut rects = Vec::new();
    for y0 in (0..height).step_by(h as usize) {
        for x0 in (0..width).step_by(w as usize) {
            rects.push(Rect { x0, y0, w: w.min(width - x0), h: h.min(height - y0) });
        }
    }
    rects.reverse();
    rects
}

fn view_uniform(scene: &Scene, camera: &Camera, request: &Request, background: &Background<f32>) -> View {
    let rows = camera.clip_rows(scene.center);
    let (near, far) = camera.depth_range();
    let corners = scene.bounds.map(|(low, high)| [low, high]).unwrap_or_default();
    let mut depths = (f64::INFINITY, f64::NEG_INFINITY);
    for i in 0..8 {
        let pick = |bit: usize| corners[(i >> bit) & 1];
        let corner = glam::DVec3::new(pick(0).x, pick(1).y, pick(2).z) - scene.center;
        let depth = rows.depth.dot(corner.extend(1.0));
        depths = (depths.0.min(depth), depths.1.max(depth));
    }
    // Window z of an orthographic view spans the scene, with room for rounding: near and far are compared in
    // the shader, exactly.
    let (low, high) = (depths.0.max(near), depths.1.min(far).max(depths.0.max(near)));
    let room = 1e-5 * (high - low).max(low.abs()).max(high.abs()).max(f64::MIN_POSITIVE);
    let scale = 1.0 / (high - low + 2.0 * room);
    View {
        rows: [rows.x, rows.y, rows.w, rows.depth].map(|r| r.as_vec4().to_array()),
        background: match background {
            Background::Constant(c) => *c,
            Background::Image(_) => [0.0; 4],
        },
        width: request.width,
        height: request.height,
        perspective: u32::from(camera.is_perspective()),
        list_opaque: u32::from(request.lists == Lists::All),
        near: near as f32,
        far: far.min(f64::from(f32::MAX)) as f32,
        z_offset: ((high + room) * scale) as f32,
        z_scale: scale as f32,
    }
}

fn texture(gpu: &Gpu, label: &str, format: wgpu::TextureFormat, width: u32, height: u32) -> wgpu::Texture {
    use wgpu::TextureUsages as Usage;
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: Usage::RENDER_ATTACHMENT | Usage::TEXTURE_BINDING | Usage::COPY_SRC | Usage::COPY_DST,
        view_formats: &[],
    })
}

fn write_texture(gpu: &Gpu, texture: &wgpu::Texture, pixels: &[[f32; 4]], width: u32, height: u32) {
    gpu.queue.write_texture(
        texture.as_image_copy(),
        bytemuck::cast_slice(pixels),
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(16 * width), rows_per_image: None },
        wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
    );
}

impl Frame<'_> {
    /// Clears depth, and draws opaque geometry if it hides anything.
    fn draw_opaque(&self, hides: bool, constant: Option<[f32; 4]>, stats: &mut Stats) -> Result<()> {
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
    fn fill_and_resolve(&self, pool: &Pool, rect: Rect, output: &mut Output<f32>) -> Result<u64> {
        let gpu = self.gpu;
        let timing = Timing::new(gpu);
        let pixels = rect.pixels();
        let numbers = readable(gpu, "numbers", 8);
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
            encoder.copy_buffer_to_buffer(&pool.counter, 0, &numbers, 0, 4);
            encoder.copy_buffer_to_buffer(&pool.long_pixels, 0, &numbers, 4, 4);
            self.copy_results(&mut encoder, pool, rect, &image, counts.as_ref());
            Ok(())
        })?;
        let buffers: Vec<&wgpu::Buffer> = [&numbers, &image].into_iter().chain(&counts).collect();
        let mut results = self.submit(encoder, &timing, &buffers, &mut output.stats)?;
        let [demand, long_count, ..] = *bytemuck::cast_slice::<u8, u32>(&results[0]) else {
            return Err(Error::Device("the counter was not read back".into()));
        };
        if u64::from(demand) > pool.capacity {
            return Ok(u64::from(demand));
        }
        if long_count > 0 {
            debug_assert!(demand > TEMP_FRAGMENTS);
            long::resolve(self, pool, &read_group, long_count, self.scratch, &mut output.stats)?;
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            self.copy_results(&mut encoder, pool, rect, &image, counts.as_ref());
            results = gpu.submit_and_read(encoder, &buffers)?;
        }
        place(&results[1], &mut output.image, self.width, rect);
        if let (Some(all), Some(counts)) = (&mut output.counts, results.get(2)) {
            place(counts, all, self.width, rect);
        }
        Ok(u64::from(demand))
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
    ) -> Result<Vec<Vec<u8>>> {
        let clock = Instant::now();
        let times = timing.finish(&mut encoder);
        let all: Vec<&wgpu::Buffer> = buffers.iter().copied().chain(times).collect();
        let mut results = self.gpu.submit_and_read(encoder, &all)?;
        if times.is_some() {
            let (passes, _) = timing.read(&results.pop().unwrap_or_default());
            for (stage, ms) in passes {
                stats.add(stage, ms);
            }
        }
        stats.add("submit to readback", clock.elapsed().as_secs_f64() * 1e3);
        Ok(results)
    }

    /// The straight colours behind the lists.
    fn read_background(&self) -> Result<Vec<[f32; 4]>> {
        // Copies of textures come in rows of a multiple of 256 bytes.
        let row = (16 * self.width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = readable(self.gpu, "background", u64::from(row) * u64::from(self.height));
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        encoder.copy_texture_to_buffer(
            self.background.texture().as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(row),
                    rows_per_image: None,
                },
            },
            wgpu::Extent3d { width: self.width, height: self.height, depth_or_array_layers: 1 },
        );
        let bytes = self.gpu.submit_and_read(encoder, &[&buffer])?.remove(0);
        let mut pixels = Vec::with_capacity(self.width as usize * self.height as usize);
        for line in bytes.chunks_exact(row as usize) {
            pixels.extend_from_slice(bytemuck::cast_slice::<u8, [f32; 4]>(&line[..16 * self.width as usize]));
        }
        Ok(pixels)
    }
}

/// Copies the rows of a rectangle into the whole image.
fn place<V: bytemuck::Pod>(bytes: &[u8], image: &mut [V], width: u32, rect: Rect) {
    let rows: &[V] = bytemuck::cast_slice(bytes);
    let w = rect.w as usize;
    for (row, y) in rows.chunks_exact(w).zip(rect.y0..rect.y0 + rect.h) {
        let start = y as usize * width as usize + rect.x0 as usize;
        image[start..start + w].copy_from_slice(row);
    }
}
