//! What a frame leaves whose fragments are sorted in workgroup memory and registers, a tile at a time: the image, counts,
//! and lists where they are asked for.

use std::time::Instant;

use bytemuck::allocation::try_cast_vec;

use super::classes::{CLASS_COUNT, CLASS_WORDS, Wanted};
use super::counted::{Counted, Room, counted};
use super::listed::{Listed, ListedBand};
use super::stages::Leaves;
use super::walk::window_length;
use crate::error::{Error, Result};
use crate::frame::{Lists, Request, Sort};
use crate::gpu::buffers::storage;
use crate::gpu::device::Gpu;
use crate::gpu::readback::Submitted;
use crate::gpu::timing::Timing;
use crate::gpu::variant::Variant;
use crate::scene::Scene;

/// What the stages bind, and hold in workgroup memory.
const STORAGE_BUFFERS: u32 = 20;
const WORKGROUP_BYTES: u32 = 28_672;

/// Whether registers will do: one sample, one mode, all fragments, no opaque surface listed.
pub fn is_enough(gpu: &Gpu, variant: &Variant, scene: &Scene, request: &Request) -> bool {
    let plain = variant.layout.samples == 1 && !variant.layout.mixed && variant.limit.is_none();
    let listed = request.lists == Lists::All && scene.has_opaque();
    // Nothing else is asked of the order that fragments are blended in.
    let front = !variant.back_to_front() && variant.sort == Sort::Auto;
    variant.tiles
        && plain
        && front
        && !listed
        && gpu.limits.max_storage_buffers_per_shader_stage >= STORAGE_BUFFERS
        && gpu.limits.max_compute_workgroup_storage_size >= WORKGROUP_BYTES
}

/// What an image is made for: pixels, what is left of each, and the bytes that lists may take.
#[derive(Clone, Copy, PartialEq)]
pub struct ImageKey {
    pub size: (u32, u32),
    pub leaves: Leaves,
    pub memory: u64,
}

/// What an image comes in.
pub struct Image {
    pub image: wgpu::Buffer,
    pub counts: wgpu::Buffer,
    pub listed: Option<Listed>,
}

impl Image {
    pub fn new(gpu: &Gpu, key: &ImageKey) -> Result<Self> {
        let pixels = u64::from(key.size.0) * u64::from(key.size.1);
        let counts = key.leaves != Leaves::Color;
        let listed = key.leaves == Leaves::Lists;
        let listed = listed.then(|| Listed::new(gpu, pixels, key.memory)).transpose()?;
        gpu.checked("the image", || {
            Ok(Self {
                image: storage(gpu, "image", 16 * pixels),
                counts: storage(gpu, "counts", if counts { 4 * pixels } else { 0 }),
                listed,
            })
        })
    }

    pub fn list_capacity(&self) -> u32 {
        self.listed.as_ref().map_or(0, |listed| listed.capacity)
    }

    pub fn bytes(&self) -> Vec<(&'static str, u64)> {
        let mut bytes = vec![("image band", self.image.size() + self.counts.size())];
        bytes.extend(self.listed.iter().flat_map(Listed::bytes));
        bytes
    }
}

/// What a frame found, of all its bands together.
#[derive(Debug, Default)]
pub struct Found {
    pub counted: Counted,
    pub image: Vec<[f32; 4]>,
    pub counts: Option<Vec<i32>>,
    pub starts: Vec<u32>,
    pub listed: Vec<ListedBand>,
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
        self.counted = self.counted.with(counted);
        self.parts.iter_mut().zip(classes).for_each(|(all, own)| *all += own);
        let [fragments, deepest, filled_tiles] = [1, 2, 3].map(|i| classes[CLASS_COUNT + i]);
        self.fragments += u64::from(fragments);
        self.deepest = self.deepest.max(deepest);
        self.filled_tiles += filled_tiles;
        self.bands += 1;
    }
}

/// A band on its way, which may be the whole image.
pub struct Band {
    pub submitted: Submitted,
    pub timing: Timing,
    pub had: Room,
    pub clock: Instant,
    pub key: ImageKey,
    pub list_capacity: u32,
    pub wanted: Wanted,
    pub is_last: bool,
}

/// How a band ended.
pub enum Ended {
    /// With so many fragments in lists, where there are lists.
    Found(u32),
    /// It had too little room, and is to be done again with this.
    Needs(Room),
    NeedsFragments(u32),
    /// It had tiles of classes that were not dispatched.
    NeedsClasses,
    /// Registers do not do: a pixel is deeper than any class, or a list longer than a software driver's loops.
    TooDeep,
}

impl Band {
    /// Waits, and adds what the band found. The last band brings the image.
    pub fn read(self, gpu: &Gpu, found: &mut Found) -> Result<Ended> {
        let Self { submitted, timing, had, clock, key, list_capacity, wanted, is_last } = self;
        let mut words = submitted.read(gpu)?;
        let mut waited = clock.elapsed().as_secs_f64() * 1e3;
        if timing.buffer().is_some() {
            let ticks = words.pop().unwrap_or_default();
            found.gpu_ms = timing.span(&ticks).map(|ms| ms + found.gpu_ms.unwrap_or(0.0));
            for (stage, ms) in timing.read(&ticks) {
                waited -= ms;
                found.times.push((stage.into_owned(), ms));
            }
        }
        found.times.push(("wait and readback".into(), waited.max(0.0)));
        let mut words = words.into_iter();
        let counted = match counted(gpu, &words.next().unwrap_or_default(), had)? {
            Ok(counted) => counted,
            Err(needed) => {
                found.gpu_ms = None; // some of it was in vain
                return Ok(Ended::Needs(needed));
            }
        };
        let classes = words.next().unwrap_or_default();
        if classes.len() < CLASS_WORDS {
            return Err(Error::Device("the classes were not read back".into()));
        }
        let too_long = gpu.adapter.is_software() && counted.longest > window_length(gpu, 1);
        if classes[CLASS_COUNT] > 0 || too_long {
            return Ok(Ended::TooDeep);
        }
        if !wanted.suffice(&classes) {
            return Ok(Ended::NeedsClasses);
        }
        let listed = classes[CLASS_WORDS - 1];
        if listed > list_capacity {
            found.gpu_ms = None;
            return Ok(Ended::NeedsFragments(listed));
        }
        found.add(counted, &classes);
        if is_last {
            // Buffers have at least 64 bytes, and so may be longer.
            let pixels = key.size.0 as usize * key.size.1 as usize;
            found.image = values(words.next(), pixels)?;
            if key.leaves != Leaves::Color {
                found.counts = Some(values(words.next(), pixels)?);
            }
            if key.leaves == Leaves::Lists {
                found.starts = values(words.next(), pixels)?;
            }
        }
        Ok(Ended::Found(listed))
    }
}

/// `n` values of what came back as words: a larger copy would take as long as the readback.
pub fn values<V: bytemuck::Pod>(words: Option<Vec<u32>>, n: usize) -> Result<Vec<V>> {
    let mut words = words.unwrap_or_default();
    words.truncate(n * size_of::<V>() / 4);
    match try_cast_vec(words) {
        Ok(values) if values.len() == n => Ok(values),
        _ => Err(Error::Device("the image did not come back whole".into())),
    }
}
