//! A render whose fragments never leave a tile.

use std::sync::Arc;
use std::time::Instant;

use super::bins::Counted;
use super::canvas::Canvas;
use super::classes::{CLASS_COUNT, CLASS_NAMES};
use super::image::{Band, Ended, Found};
use super::is_enough;
use super::ready::Ready;
use crate::camera::Camera;
use crate::error::Result;
use crate::fragments::Background;
use crate::frame::{Lists, Output, Request, Stats};
use crate::gpu::kept::Kept;
use crate::gpu::plan;
use crate::gpu::pool::DEFAULT_MEMORY;
use crate::gpu::resolve::TILE;
use crate::resolve::Resolve;
use crate::scene::Scene;

/// Renders, or leaves it to the stages that keep lists: `None` where something asks for those, or a pixel is too deep.
pub fn render(
    kept: &mut Kept,
    scene: &Scene,
    camera: &Camera,
    request: &Request,
    background: &Background<f32>,
) -> Result<Option<Output<f32>>> {
    match Frame::new(kept, scene, camera, request, background)? {
        Some((frame, canvas)) => frame.render(canvas, kept),
        None => Ok(None),
    }
}

/// A frame that a device has been given, of one band.
pub struct Begun {
    frame: Frame,
    band: Band,
}

/// Gives the device a frame without waiting for it. `None` where `render` would have more to do than one submission.
pub fn begin(
    kept: &mut Kept,
    scene: &Scene,
    camera: &Camera,
    request: &Request,
    background: &Background<f32>,
) -> Result<Option<Begun>> {
    let Some((frame, mut canvas)) = Frame::new(kept, scene, camera, request, background)? else {
        return Ok(None);
    };
    let band = canvas.turn_to_first().then(|| canvas.submit_band(&frame.ready)).transpose()?;
    canvas.leave(kept);
    Ok(band.map(|band| Begun { frame, band }))
}

impl Begun {
    /// Waits for the frame. `None` where a pixel is too deep for registers.
    pub fn finish(self, kept: &mut Kept) -> Result<Option<Output<f32>>> {
        let Self { frame, band } = self;
        if !Arc::ptr_eq(&frame.ready.gpu, &kept.gpu) {
            return Ok(None); // that device is lost
        }
        let mut found = Found::default();
        match band.read(&kept.gpu, &mut found)? {
            Ended::Found => Ok(Some(frame.output(found))),
            Ended::TooDeep => Ok(None),
            Ended::Needs(room) => {
                let mut canvas = Canvas::new(&frame.ready, frame.wants_counts, frame.memory, kept)?;
                canvas.grow(&kept.gpu, room, frame.memory)?;
                frame.render(canvas, kept)
            }
        }
    }
}

/// All that one image takes.
struct Frame {
    ready: Ready,
    wants_counts: bool,
    memory: u64,
    request: Request,
    stats: Stats,
}

impl Frame {
    fn new(
        kept: &mut Kept,
        scene: &Scene,
        camera: &Camera,
        request: &Request,
        background: &Background<f32>,
    ) -> Result<Option<(Self, Canvas)>> {
        let gpu = kept.gpu.clone();
        let variant = plan::variant(&gpu, scene, request)?;
        // An image in parts is what lists have.
        if !is_enough(&gpu, &variant, request) || 16 * request.pixels() as u64 > gpu.adapter.max_binding {
            return Ok(None);
        }
        let mut stats = Stats { device: gpu.adapter.name.clone(), ..Stats::default() };
        let clock = Instant::now();
        let (wants_counts, memory) =
            (request.lists == Lists::Count, request.memory.unwrap_or(DEFAULT_MEMORY));
        let is_kept = kept.has_scene();
        let ready = Ready::new(kept, &variant, (scene, camera), request, background)?;
        let canvas = Canvas::new(&ready, wants_counts, memory, kept)?;
        stats.stage("upload", clock);
        stats.bytes = canvas.bytes();
        stats.bytes.push(("geometry", ready.scene.bytes));
        plan::describe_upload(is_kept, &mut stats);
        stats.choose("samples", "1", "no masks");
        Resolve::of(request, scene).describe(scene, "known from the triangle", &mut stats);
        stats.choose("lists", "none", "each tile's fragments are sorted in registers");
        if variant.hides {
            stats.choose(
                "opaque geometry",
                "walked first",
                "the nearest of each pixel hides what is behind it",
            );
        }
        let frame = Self { ready, wants_counts, memory, request: request.clone(), stats };
        Ok(Some((frame, canvas)))
    }

    fn render(mut self, mut canvas: Canvas, kept: &mut Kept) -> Result<Option<Output<f32>>> {
        let found = canvas.render(&self.ready, self.memory)?;
        self.stats.bytes = canvas.bytes();
        self.stats.bytes.push(("geometry", self.ready.scene.bytes));
        canvas.leave(kept);
        Ok(found.map(|found| self.output(found)))
    }

    fn output(self, mut found: Found) -> Output<f32> {
        let Self { request, mut stats, .. } = self;
        describe(&request, &found, &mut stats);
        let (image, counts) = (std::mem::take(&mut found.image), found.counts.take());
        Output { image, counts, background: None, fragments: None, stats }
    }
}

fn describe(request: &Request, found: &Found, stats: &mut Stats) {
    found.times.iter().for_each(|(stage, ms)| stats.add(stage.clone(), *ms));
    stats.gpu_ms = found.gpu_ms;
    stats.rejected_triangles = found.counted.rejected;
    stats.fragments = found.fragments;
    stats.max_depth_complexity = Some(found.deepest);
    stats.bands = found.bands;
    plan::describe_rect(found.counted.rect, request, stats);
    let tiles = request.width.div_ceil(TILE) * request.height.div_ceil(TILE);
    stats.choose(
        "tiles",
        format!("{} of {tiles} hold translucent geometry", found.filled_tiles),
        format!("{TILE}×{TILE} pixels each"),
    );
    let used: Vec<_> = (0..CLASS_COUNT).filter(|&c| found.parts[c] > 0).map(|c| CLASS_NAMES[c]).collect();
    let Counted { longest, entries, .. } = found.counted;
    let why = format!("{entries} triangles in all tiles together, {longest} at most in one");
    stats.choose("tile classes", used.join(", "), why);
}
