//! The image alone, with no list stored: fragments live in workgroup memory and registers, a tile at a time.

use std::time::Instant;

use wgpu::BufferUsages;

use super::bins::{Bins, Counted};
use super::classes::CLASS_COUNT;
use super::opaque::Opaque;
use super::ready::Ready;
use super::walk::window_length;
use crate::error::{Error, Result};
use crate::frame::{Lists, Request, Sort};
use crate::gpu::buffers::{bind, copied, storage, with_contents};
use crate::gpu::device::Gpu;
use crate::gpu::timing::Timing;
use crate::gpu::variant::Variant;

/// Words of `Classes` in shaders/tiles/classes.wgsl.
const CLASS_WORDS: usize = CLASS_COUNT + 1 + 3;

/// What the stages bind, and hold in workgroup memory.
const STORAGE_BUFFERS: u32 = 17;
const WORKGROUP_BYTES: u32 = 28_672;

/// Of a band: three demands, and as many halvings as a row has bits.
const MOST_TRIES: u32 = 20;

/// Whether registers will do: one sample, one mode, all fragments, no list.
pub fn is_enough(gpu: &Gpu, variant: &Variant, request: &Request) -> bool {
    let plain = variant.layout.samples == 1 && !variant.layout.mixed && variant.limit.is_none();
    let listed = matches!(request.lists, Lists::Translucent | Lists::All);
    // Nothing else is asked of the order that fragments are blended in.
    let front = !variant.back_to_front() && variant.sort == Sort::Auto;
    variant.tiles
        && plain
        && front
        && !listed
        && gpu.limits.max_storage_buffers_per_shader_stage >= STORAGE_BUFFERS
        && gpu.limits.max_compute_workgroup_storage_size >= WORKGROUP_BYTES
}

/// What one camera's image is made in. It may be used again for others of the same size.
pub struct Canvas {
    bins: Bins,
    image: wgpu::Buffer,
    counts: wgpu::Buffer,
    opaque: Opaque,
    size: (u32, u32),
}

/// What a frame found, of all its bands together.
#[derive(Debug, Default)]
pub struct Found {
    pub counted: Counted,
    pub image: Vec<u32>,
    pub counts: Option<Vec<u32>>,
    pub fragments: u64,
    pub deepest: u32,
    pub filled_tiles: u32,
    /// Parts of tiles that each class resolved, and those that no class has room for.
    pub parts: [u32; CLASS_COUNT + 1],
    pub bands: usize,
    pub times: Vec<(String, f64)>,
    /// From the first begin to the last end.
    pub gpu_ms: Option<f64>,
}

impl Found {
    /// Adds what a band counted.
    fn add(&mut self, counted: Counted, classes: &[u32]) {
        let all = &mut self.counted;
        all.rejected = counted.rejected; // of the whole scene, each time
        all.rect = counted.rect;
        all.longest = all.longest.max(counted.longest);
        all.entries += counted.entries;
        self.parts.iter_mut().zip(classes).for_each(|(all, own)| *all += own);
        let [fragments, deepest, filled_tiles] = [1, 2, 3].map(|i| classes[CLASS_COUNT + i]);
        self.fragments += u64::from(fragments);
        self.deepest = self.deepest.max(deepest);
        self.filled_tiles += filled_tiles;
        self.bands += 1;
    }
}

impl Canvas {
    pub fn new(of: &Ready, wants_counts: bool, memory: u64) -> Result<Self> {
        let (size, context) = (of.size, of.context());
        let gpu = context.gpu;
        let pixels = u64::from(size.0) * u64::from(size.1);
        let bins = Bins::new(context, of.scene.triangles, size, memory)?;
        let opaque = Opaque::new(context, size)?;
        gpu.checked("the image", || {
            Ok(Self {
                bins,
                image: storage(gpu, "image", 16 * pixels),
                counts: storage(gpu, "counts", if wants_counts { 4 * pixels } else { 0 }),
                opaque,
                size,
            })
        })
    }

    pub fn bytes(&self) -> Vec<(&'static str, u64)> {
        let image = self.image.size() + self.counts.size();
        [&self.bins.bytes()[..], &[("targets", self.opaque.bytes()), ("image band", image)]].concat()
    }

    /// Renders. `None` where registers do not do: a pixel is deeper than any class, or a list longer than a software
    /// driver's loops.
    pub fn render(&mut self, of: &Ready, wants_counts: bool, memory: u64) -> Result<Option<Found>> {
        let gpu = of.context().gpu;
        let mut found = Found::default();
        let mut first_row = 0;
        let mut tries = 0;
        while self.bins.turn_to(first_row) {
            // Pieces, then bins, then tiles: each may show the next demand; and each halving of the band.
            tries += 1;
            if tries > MOST_TRIES {
                return Err(Error::Device(format!(
                    "{} counts other triangles each time: its driver is at fault; device=\"cpu\" works",
                    gpu.adapter.name
                )));
            }
            let timing = Timing::new(gpu);
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            gpu.checked("rendering tiles", || self.encode(of, wants_counts, &mut encoder, &timing))?;
            let counters = self.bins.read(gpu, &mut encoder);
            let classes = copied(gpu, &mut encoder, &self.bins.classes, 4 * CLASS_WORDS as u64);
            // With the last band all of the image comes back.
            let pixels = u64::from(self.size.0) * u64::from(self.size.1);
            let last = self.bins.is_last();
            let image = last.then(|| copied(gpu, &mut encoder, &self.image, 16 * pixels));
            let counts = (last && wants_counts).then(|| copied(gpu, &mut encoder, &self.counts, 4 * pixels));
            let clock = Instant::now();
            let times = timing.finish(&mut encoder);
            let buffers: Vec<&wgpu::Buffer> =
                [&counters, &classes].into_iter().chain(&image).chain(&counts).chain(times).collect();
            let mut words = gpu.submit_and_read(encoder, &buffers)?;
            let mut waited = clock.elapsed().as_secs_f64() * 1e3;
            if times.is_some() {
                let ticks = words.pop().unwrap_or_default();
                found.gpu_ms = timing.span(&ticks).map(|ms| ms + found.gpu_ms.unwrap_or(0.0));
                for (stage, ms) in timing.read(&ticks) {
                    waited -= ms;
                    found.times.push((stage.into_owned(), ms));
                }
            }
            found.times.push(("wait and readback".into(), waited.max(0.0)));
            let Some(counted) = self.bins.counted(gpu, &words[0], memory, true)? else {
                found.gpu_ms = None; // some of it was in vain
                continue;
            };
            if words[1].len() < CLASS_WORDS {
                return Err(Error::Device("the classes were not read back".into()));
            }
            found.add(counted, &words[1]);
            let too_long = gpu.adapter.is_software() && counted.longest > window_length(gpu, 1);
            if found.parts[CLASS_COUNT] > 0 || too_long {
                return Ok(None);
            }
            let mut rest = words.into_iter().skip(2);
            found.image = image.and_then(|_| rest.next()).unwrap_or_default();
            found.counts = counts.and_then(|_| rest.next());
            first_row = self.bins.end_row();
            tries = 0;
        }
        self.bins.turn_to(0);
        Ok(Some(found))
    }

    /// Fragments that the frame encoded last composited.
    pub fn count_fragments(&self, gpu: &Gpu) -> Result<u64> {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let classes = copied(gpu, &mut encoder, &self.bins.classes, 4 * CLASS_WORDS as u64);
        let words = gpu.submit_and_read(encoder, &[&classes])?;
        Ok(words[0].get(CLASS_COUNT + 1).copied().unwrap_or(0).into())
    }

    pub fn encode(
        &self,
        ready: &Ready,
        wants_counts: bool,
        encoder: &mut wgpu::CommandEncoder,
        timing: &Timing,
    ) -> Result<()> {
        let (of, scene) = (ready.context(), &ready.scene);
        let (gpu, stages, variant) = (of.gpu, of.stages(), of.variant());
        // One pass: between passes a device idles longer than a small stage takes.
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("tiles"),
            timestamp_writes: timing.compute("tiles"),
        });
        self.bins.encode(of, scene, ready.eye, &mut pass)?;
        let grid = &self.bins.grid;
        let window = self.bins.window(0, u32::MAX);
        let window = with_contents(gpu, "window", BufferUsages::UNIFORM, &[window]);
        let walk = self.bins.walk_group(of, scene, &window);
        pass.set_bind_group(0, &walk, &[]);
        if variant.hides {
            self.opaque.set_walk(of, &mut pass)?;
            pass.dispatch_workgroups(grid.tiles_x, grid.tiles_y, 1);
        }
        let pipelines = stages.resolve(gpu, variant, wants_counts)?;
        let groups: Vec<_> = (0..CLASS_COUNT)
            .map(|class| {
                let next = pipelines.classes[class].next;
                let slots = [
                    (&self.image).into(),
                    (&self.counts).into(),
                    (&self.bins.classes).into(),
                    (&self.bins.parts).into(),
                    (&self.bins.groups[next]).into(),
                    (&ready.background).into(),
                ];
                bind(gpu, "resolve", &stages.resolve_layout, &slots)
            })
            .collect();
        self.opaque.set_read(of, &mut pass);
        for (class, group) in groups.iter().enumerate() {
            pass.set_pipeline(&pipelines.resolve[class]);
            pass.set_bind_group(1, group, &[]);
            pass.dispatch_workgroups_indirect(&self.bins.groups[class], 0);
        }
        Ok(())
    }
}
