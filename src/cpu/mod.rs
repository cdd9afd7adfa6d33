//! The `tiles` pipeline on the CPU: set up, bin, then one tile at a time in cache, in parallel.

mod bin;
mod coverage;
mod entry;
mod plane;
mod region;
mod samples;
mod setup;
mod sort;
mod target;
mod tile;

use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use rayon::prelude::*;

use crate::camera::Camera;
use crate::error::Result;
use crate::fragments::{Background, Extras, Fragments};
use crate::frame::{Lists, Output, Request, Stats, allocate, out_of_memory};
use crate::real::Real;
use crate::resolve::Resolve;
use crate::samples::pattern;
use crate::scene::Scene;
use bin::Binning;
use entry::{Covered, Listed, Single};
use region::TILE;
use target::{ImageTarget, ListTarget, Rules};
use tile::{DeepPixel, Scratch, Walk};

/// What bins and scratch may take together unless `memory=` says otherwise.
const DEFAULT_MEMORY: u64 = 1 << 30;

/// Renders a scene. `T` is the precision of everything after the positions.
pub fn render<T: Real>(
    scene: &Scene,
    camera: &Camera,
    request: &Request,
    background: Background<T>,
) -> Result<Output<T>> {
    if request.samples == 1 {
        render_listed::<T, Single<T::Entry>>(scene, camera, request, background)
    } else {
        render_listed::<T, Covered<T::Entry>>(scene, camera, request, background)
    }
}

/// `L`: what lists hold of a fragment.
fn render_listed<T: Real, L: Listed<T>>(
    scene: &Scene,
    camera: &Camera,
    request: &Request,
    background: Background<T>,
) -> Result<Output<T>> {
    let (width, height) = (request.width, request.height);
    let (pixels, samples) = (request.pixels(), request.samples as usize);
    let memory = request.memory.unwrap_or(DEFAULT_MEMORY);
    let mut stats = Stats { device: "cpu".into(), ..Stats::default() };

    let clock = Instant::now();
    let setup = setup::set_up::<T>(scene, camera, (width, height), samples > 1);
    stats.rejected_triangles = setup.rejected;
    stats.stage("setup", clock);

    let clock = Instant::now();
    let binning = Binning::new(&setup, width, height, memory / 2)?;
    stats.stage("bin", clock);

    let walk = Walk {
        setup: &setup,
        meshes: &scene.meshes,
        pattern: pattern(request.samples),
        sort: request.sort,
        hides: scene.has_opaque() && request.lists != Lists::All,
        list_opaque: scene.has_opaque() && request.lists == Lists::All,
        // Half for the bins, a quarter for what threads hold, a quarter for the one deepest pixel.
        scratch_bytes: memory / 4 / rayon::current_num_threads() as u64,
        deep_pixel: Mutex::new(DeepPixel { limit: memory / 4, held: 0 }),
    };
    let samples_why = if samples > 1 { "a mask with each fragment" } else { "no masks" };
    stats.choose("samples", samples.to_string(), samples_why);
    let resolve = Resolve::of(request, scene);
    resolve.describe(scene, "known from the triangle", &mut stats);
    let rules = Rules { resolve, limit: request.limit };
    let wants_lists = matches!(request.lists, Lists::Translucent | Lists::All);
    // Poisoned: a pixel that no tile writes would show.
    let each = request.image_samples();
    let mut image = allocate("the image", pixels * each, [T::NAN; 4])?;
    let mut counts = (request.lists != Lists::None).then(|| allocate("counts", pixels, -1)).transpose()?;
    let mut behind = (wants_lists && walk.hides)
        .then(|| allocate("background", pixels * samples, [T::NAN; 4]))
        .transpose()?;
    let scratches = Scratches::<T, L>::default();

    let clock = Instant::now();
    let mut targets = ImageTarget::<T, L>::cut(
        (&mut image, each),
        counts.as_deref_mut(),
        behind.as_deref_mut(),
        width,
        samples,
    );
    let flat = |x: i32, y: i32| y as usize * width as usize + x as usize;
    binning.each_run(|bins| {
        targets[bins.run.clone()].par_iter_mut().zip(bins.run.clone()).try_for_each(|(target, tile)| {
            scratches.with(|scratch| {
                walk.visit(bins.tile(tile), binning.region(tile), scratch, &mut |pixel| {
                    target.resolve(&walk, &rules, &pixel, background.at(flat(pixel.x, pixel.y)));
                })
            })
        })
    })?;
    stats.fragments = targets.iter().map(|t| t.fragments).sum();
    stats.dropped_fragments = targets.iter().map(|t| t.dropped).sum();
    stats.max_depth_complexity = targets.iter().map(|t| t.deepest).max();
    stats.choose(
        "rectangle",
        setup.describe_box(width, height),
        "where geometry lands; elsewhere is background",
    );
    let filled = targets.iter().filter(|t| t.fragments > 0).count();
    let tiles = format!("{filled} of {} hold translucent geometry", targets.len());
    stats.choose("tiles", tiles, format!("{TILE}×{TILE} pixels each"));
    drop(targets);
    stats.stage("resolve", clock);

    let clock = Instant::now();
    let fragments = match &counts {
        Some(counts) if wants_lists => {
            // A second walk, now that every list's place is known: nothing is held twice.
            let extras = Extras { coverage: samples > 1, blend: scene.mixes_modes() };
            let mut lists = Fragments::with_counts(counts, extras).ok_or_else(|| {
                let entry = size_of::<(T, T::Key, [T; 4], i32)>() as u64;
                out_of_memory("fragment lists", stats.fragments * entry)
            })?;
            let (mut targets, offsets) = ListTarget::cut(&mut lists, width);
            binning.each_run(|bins| {
                targets[bins.run.clone()].par_iter_mut().zip(bins.run.clone()).try_for_each(
                    |(target, tile)| {
                        scratches.with(|scratch| {
                            walk.visit(bins.tile(tile), binning.region(tile), scratch, &mut |pixel| {
                                target.write(&walk, &pixel, offsets[flat(pixel.x, pixel.y)]);
                            })
                        })
                    },
                )
            })?;
            drop(targets);
            stats.stage("lists", clock);
            Some(lists)
        }
        _ => None,
    };
    stats.bands = binning.runs.len();
    let deep = walk.deep_pixel.lock().unwrap_or_else(PoisonError::into_inner).held;
    let scratch = scratches.bytes() + deep;
    stats.bytes = vec![("setup", setup.bytes()), ("bins", binning.bytes()), ("scratch", scratch)];
    Ok(Output { image, counts, background: behind, fragments, stats })
}

/// Buffers that threads borrow for one tile at a time.
struct Scratches<T: Real, L>(Mutex<Vec<Scratch<T, L>>>);

impl<T: Real, L> Default for Scratches<T, L> {
    fn default() -> Self {
        Self(Mutex::new(Vec::new()))
    }
}

impl<T: Real, L> Scratches<T, L> {
    fn with<R>(&self, use_it: impl FnOnce(&mut Scratch<T, L>) -> R) -> R {
        // A poisoned lock means that a thread panicked between two pushes: the buffers are still sound.
        let free = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut scratch = free.unwrap_or_default();
        let result = use_it(&mut scratch);
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(scratch);
        result
    }

    fn bytes(&self) -> u64 {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).iter().map(Scratch::bytes).sum()
    }
}
