//! One camera's image from setup to resolve: what it is made with, and the commands.

use std::time::Instant;

use wgpu::BufferUsages;

use super::bins::{Bins, BinsKey, MOST_TRIES};
use super::classes::{CLASS_COUNT, CLASS_WORDS, Wanted, classes};
use super::counted::{Room, never_settles};
use super::image::{Band, Ended, Found, Image, ImageKey, values};
use super::opaque::{Opaque, OpaqueKey};
use super::ready::Ready;
use super::stages::Leaves;
use crate::error::{Error, Result};
use crate::gpu::buffers::{bind, with_contents};
use crate::gpu::device::Gpu;
use crate::gpu::kept::Kept;
use crate::gpu::readback::copied;
use crate::gpu::timing::Timing;
use crate::gpu::uniforms::Window;

/// What one camera's image is made with. It may be used again for others of the same size.
pub struct Canvas {
    bins: Bins,
    bins_key: BinsKey,
    image: Image,
    image_key: ImageKey,
    opaque: Opaque,
    opaque_key: OpaqueKey,
    wanted: Wanted,
}

impl Canvas {
    pub fn new(of: &Ready, leaves: Leaves, memory: u64, kept: &mut Kept) -> Result<Self> {
        let (gpu, size, variant) = (&of.gpu, of.size, of.variant());
        let bins_key = BinsKey { triangles: of.scene.triangles, size, colors: variant.colors, memory };
        let image_key = ImageKey { size, leaves, memory };
        let opaque_key = OpaqueKey::of(variant, size);
        let mut canvas = Self {
            bins: Bins::taken(kept, &bins_key)?,
            image: kept.image.take(&image_key, || Image::new(gpu, &image_key))?,
            opaque: kept.opaque.take(&opaque_key, || Opaque::new(gpu, &opaque_key))?,
            bins_key,
            image_key,
            opaque_key,
            wanted: kept.wanted.with_made(of.context().stages().made(leaves)),
        };
        canvas.leave_room_for_bins(gpu)?;
        Ok(canvas)
    }

    /// Bytes that lists may take: they share `memory` with bins.
    fn left_for_lists(&self) -> u64 {
        self.image_key.memory.saturating_sub(self.bins.entry_bytes())
    }

    fn leave_room_for_bins(&mut self, gpu: &Gpu) -> Result<()> {
        let left = self.left_for_lists();
        self.image.listed.as_mut().map_or(Ok(()), |listed| listed.shrink(gpu, left))
    }

    /// Leaves what the next frame can use. A frame that is on its way has its commands already.
    pub fn leave(self, kept: &mut Kept) {
        kept.bins.put(self.bins_key, self.bins);
        kept.image.put(self.image_key, self.image);
        kept.opaque.put(self.opaque_key, self.opaque);
        kept.wanted = self.wanted;
    }

    pub fn bytes(&self) -> Vec<(&'static str, u64)> {
        [&self.bins.bytes()[..], &[("targets", self.opaque.bytes())], &self.image.bytes()].concat()
    }

    /// Turns to the first band. Whether that is the whole image.
    pub fn turn_to_first(&mut self) -> bool {
        self.bins.turn_to(0) && self.bins.is_whole()
    }

    /// Renders. `None` where registers do not do, or lists do not fit.
    pub fn render(&mut self, of: &Ready) -> Result<Option<Found>> {
        let gpu = &of.gpu;
        let mut found = Found::default();
        let mut first_row = 0;
        let mut tries = 0;
        while self.bins.turn_to(first_row) {
            // Pieces, bins, tiles, classes: each may show the next demand; and each halving of the band.
            tries += 1;
            if tries > MOST_TRIES {
                return Err(never_settles(gpu));
            }
            match self.submit_band(of)?.read(gpu, &mut found)? {
                Ended::Found(fragments) => {
                    first_row = self.bins.end_row();
                    tries = 0;
                    if let Some(listed) = &self.image.listed {
                        found.listed.push(listed.read(gpu, fragments, first_row)?);
                    }
                }
                Ended::Needs(room) => {
                    match self.grow(gpu, room) {
                        Err(Error::Capacity { .. }) if self.image.listed.is_some() => return Ok(None),
                        grown => grown?,
                    }
                    self.leave_room_for_bins(gpu)?;
                }
                Ended::NeedsFragments(fragments) => {
                    let left = self.left_for_lists();
                    let listed = self.image.listed.as_mut();
                    let fits = listed.map_or(Ok(false), |listed| listed.grow(gpu, fragments, left))?;
                    if !fits && !self.bins.halve(gpu)? {
                        return Ok(None);
                    }
                }
                Ended::NeedsClasses => self.wanted.want_all(),
                Ended::TooDeep => return Ok(None),
            }
        }
        self.wanted.learn(&found.parts);
        self.bins.turn_to(0);
        Ok(Some(found))
    }

    pub fn grow(&mut self, gpu: &Gpu, room: Room) -> Result<()> {
        self.bins.grow(gpu, room, self.bins_key.memory)
    }

    /// Gives the device the band that bins are turned to.
    pub fn submit_band(&self, of: &Ready) -> Result<Band> {
        let gpu = &of.gpu;
        let timing = Timing::new(gpu);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        gpu.checked("rendering tiles", || self.encode(of, &mut encoder, &timing))?;
        let mut buffers = vec![
            self.bins.read(gpu, &mut encoder),
            copied(gpu, &mut encoder, &self.bins.classes, 4 * CLASS_WORDS as u64),
        ];
        let is_last = self.bins.is_last();
        if is_last {
            // With the last band all of the image comes back.
            let pixels = u64::from(of.size.0) * u64::from(of.size.1);
            buffers.push(copied(gpu, &mut encoder, &self.image.image, 16 * pixels));
            if self.image_key.leaves != Leaves::Color {
                buffers.push(copied(gpu, &mut encoder, &self.image.counts, 4 * pixels));
            }
            if let Some(listed) = &self.image.listed {
                buffers.push(copied(gpu, &mut encoder, &listed.starts, 4 * pixels));
            }
        }
        let clock = Instant::now();
        buffers.extend(timing.finish(&mut encoder).cloned());
        let submitted = gpu.submit(encoder, buffers)?;
        Ok(Band {
            submitted,
            timing,
            had: self.bins.room(),
            clock,
            key: self.image_key,
            list_capacity: self.image.list_capacity(),
            wanted: self.wanted,
            is_last,
        })
    }

    /// What opaque surfaces show of the frame that was rendered last.
    pub fn read_opaque(&self, of: &Ready) -> Result<Vec<[f32; 4]>> {
        let gpu = &of.gpu;
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let pixels = of.size.0 as usize * of.size.1 as usize;
        let copy = gpu.checked("the opaque surfaces", || {
            Ok(copied(gpu, &mut encoder, &self.opaque.colors, 16 * pixels as u64))
        })?;
        values(gpu.submit_and_read(encoder, &[&copy])?.pop(), pixels)
    }

    /// Fragments that the frame encoded last composited.
    pub fn count_fragments(&self, gpu: &Gpu) -> Result<u64> {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let classes = copied(gpu, &mut encoder, &self.bins.classes, 4 * CLASS_WORDS as u64);
        let words = gpu.submit_and_read(encoder, &[&classes])?;
        Ok(words[0].get(CLASS_COUNT + 1).copied().unwrap_or(0).into())
    }

    pub fn encode(&self, ready: &Ready, encoder: &mut wgpu::CommandEncoder, timing: &Timing) -> Result<()> {
        let (of, scene) = (ready.context(), &ready.scene);
        let (gpu, stages, variant) = (of.gpu, of.stages(), of.variant());
        let leaves = self.image_key.leaves;
        stages.prepare(gpu, variant, leaves, &self.wanted)?;
        // One pass: between passes a device idles longer than a small stage takes.
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("tiles"),
            timestamp_writes: timing.compute("tiles"),
        });
        self.bins.encode(of, scene, ready.eye, &mut pass)?;
        let grid = &self.bins.grid;
        let window = Window { list_capacity: self.image.list_capacity(), ..self.bins.window(0, u32::MAX) };
        let window = with_contents(gpu, "window", BufferUsages::UNIFORM, &[window]);
        let walk = self.bins.walk_group(of, scene, &window);
        pass.set_bind_group(0, &walk, &[]);
        if variant.hides {
            self.opaque.set_walk(of, &mut pass)?;
            pass.dispatch_workgroups(grid.tiles_x, grid.tiles_y, 1);
        }
        let classes = classes(gpu);
        self.opaque.set_read(of, &mut pass);
        for class in self.wanted.classes() {
            let next = classes[class].next;
            let mut slots = vec![
                (&self.image.image).into(),
                (&self.image.counts).into(),
                (&self.bins.classes).into(),
                (&self.bins.parts).into(),
                (&self.bins.groups[next]).into(),
                (&ready.background).into(),
            ];
            let listed = self.image.listed.iter();
            slots.extend(listed.flat_map(|l| [&l.starts, &l.fragments, &l.colors].map(Into::into)));
            pass.set_pipeline(stages.resolve(gpu, variant, leaves, class)?);
            pass.set_bind_group(1, &bind(gpu, "resolve", stages.resolve_layout(leaves), &slots), &[]);
            pass.dispatch_workgroups_indirect(&self.bins.groups[class], 0);
        }
        Ok(())
    }
}
