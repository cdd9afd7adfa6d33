//! A render whose fragments never leave a tile.

use std::sync::Arc;
use std::time::Instant;

use super::canvas::Canvas;
use super::classes::{CLASS_COUNT, CLASS_NAMES};
use super::counted::Counted;
use super::image::{Band, Ended, Found};
use super::is_enough;
use super::listed::assemble;
use super::ready::Ready;
use super::stages::Leaves;
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
        Some((frame, canvas)) => frame.render(canvas, kept, background),
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
    if matches!(request.lists, Lists::Translucent | Lists::All) || !request.method.is_exact() {
        return Ok(None); // lists are fetched once it is known how long they are
    }
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
        let nothing_behind = &Background::Constant([0.0; 4]); // nobody asks: there are no lists
        match band.read(&kept.gpu, &mut found)? {
            Ended::Found(_) => {
                kept.wanted.learn(&found.parts);
                frame.output(found, None).map(Some)
            }
            Ended::TooDeep | Ended::NeedsFragments(_) => Ok(None),
            Ended::Needs(room) => {
                let mut canvas = Canvas::new(&frame.ready, frame.leaves, frame.memory, kept)?;
                canvas.grow(&kept.gpu, room)?;
                frame.render(canvas, kept, nothing_behind)
            }
            Ended::NeedsClasses => {
                kept.wanted.want_all();
                let canvas = Canvas::new(&frame.ready, frame.leaves, frame.memory, kept)?;
                frame.render(canvas, kept, nothing_behind)
            }
        }
    }
}

/// All that one image takes.
struct Frame {
    ready: Ready,
    leaves: Leaves,
    perspective: bool,
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
        if !is_enough(&gpu, &variant, scene, request)
            || 16 * request.pixels() as u64 > gpu.adapter.max_binding
        {
            return Ok(None);
        }
        let mut stats = Stats { device: gpu.adapter.name.clone(), ..Stats::default() };
        let clock = Instant::now();
        let leaves = match request.lists {
            Lists::None => Leaves::Color,
            Lists::Count => Leaves::Counts,
            Lists::Translucent | Lists::All => Leaves::Lists,
        };
        let variant = variant.without_nodes();
        let memory = request.memory.unwrap_or(DEFAULT_MEMORY);
        let ready = Ready::new(kept, &variant, (scene, camera), request, background)?;
        let canvas = Canvas::new(&ready, leaves, memory, kept)?;
        stats.stage("upload", clock);
        stats.bytes = canvas.bytes();
        stats.bytes.push(("geometry", ready.scene.bytes));
        plan::describe_upload(kept.is_kept, &mut stats);
        stats.choose("samples", "1", "no masks");
        Resolve::of(request, scene).describe(scene, "known from the triangle", &mut stats);
        let (lists, why) = match leaves {
            Leaves::Lists => ("sorted", "a tile's fragments are sorted in registers, then kept"),
            Leaves::Color | Leaves::Counts => ("none", "each tile's fragments are sorted in registers"),
        };
        stats.choose("lists", lists, why);
        if variant.hides {
            stats.choose(
                "opaque geometry",
                "walked first",
                "the nearest of each pixel hides what is behind it",
            );
        }
        let frame = Self {
            ready,
            leaves,
            perspective: camera.is_perspective(),
            memory,
            request: request.clone(),
            stats,
        };
        Ok(Some((frame, canvas)))
    }

    fn render(
        mut self,
        mut canvas: Canvas,
        kept: &mut Kept,
        background: &Background<f32>,
    ) -> Result<Option<Output<f32>>> {
        let Some(found) = canvas.render(&self.ready)? else {
            canvas.leave(kept);
            return Ok(None);
        };
        let behind = (self.leaves == Leaves::Lists && self.ready.variant().hides)
            .then(|| canvas.read_opaque(&self.ready))
            .transpose()?
            .map(|mut colors| {
                let nothing = |(_, color): &(usize, &mut [f32; 4])| color[3] != 1.0;
                colors
                    .iter_mut()
                    .enumerate()
                    .filter(nothing)
                    .for_each(|(i, color)| *color = background.at(i));
                colors
            });
        self.stats.bytes = canvas.bytes();
        self.stats.bytes.push(("geometry", self.ready.scene.bytes));
        canvas.leave(kept);
        self.output(found, behind).map(Some)
    }

    /// `background`: straight, opaque surfaces included, where they are behind lists.
    fn output(self, mut found: Found, background: Option<Vec<[f32; 4]>>) -> Result<Output<f32>> {
        let Self { request, mut stats, perspective, .. } = self;
        describe(&request, &found, &mut stats);
        let (image, counts) = (std::mem::take(&mut found.image), found.counts.take());
        let clock = Instant::now();
        let fragments = match &counts {
            Some(counts) if self.leaves == Leaves::Lists => {
                Some(assemble(&found.listed, &found.starts, counts, request.width, perspective)?)
            }
            _ => None,
        };
        if fragments.is_some() {
            stats.stage("lists", clock);
        }
        Ok(Output { image, counts, background, fragments, stats })
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
