//! The `tiles` pipeline on the CPU: set up, bin, then one tile at a time in cache, in parallel.

mod bin;
mod clip;
mod coverage;
mod plane;
mod region;
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
use crate::scene::Scene;
use bin::Binning;
use target::{ImageTarget, ListTarget, background_at};
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
    let (width, height) = (request.width, request.height);
    let pixels = width as usize * height as usize;
    let memory = request.memory.unwrap_or(DEFAULT_MEMORY);
    let mut stats = Stats { device: "cpu".into(), ..Stats::default() };

    let clock = Instant::now();
    let setup = setup::set_up::<T>(scene, camera, width, height);
    stats.rejected_triangles = setup.rejected;
    stats.stage("setup", clock);

    let clock = Instant::now();
    let binning = Binning::new(&setup, width, height, memory / 2)?;
    stats.stage("bin", clock);

    let walk = Walk {
        setup: &setup,
        meshes: &scene.meshes,
        hides: scene.has_opaque() && request.lists != Lists::All,
        list_opaque: scene.has_opaque() && request.lists == Lists::All,
        // Half for the bins, a quarter for what threads hold, a quarter for the one deepest pixel.
        scratch_bytes: memory / 4 / rayon::current_num_threads() as u64,
        deep_pixel: Mutex::new(DeepPixel { limit: memory / 4, held: 0 }),
    };
    let wants_lists = matches!(request.lists, Lists::Translucent | Lists::All);
    // Poisoned: a pixel that no tile writes would show.
    let mut image = allocate("the image", pixels, [T::NAN; 4])?;
    let mut counts = (request.lists != Lists::None).then(|| allocate("counts", pixels, -1)).transpose()?;
    let mut behind =
        (wants_lists && walk.hides).then(|| allocate("background", pixels, [T::NAN; 4])).transpose()?;
    let scratches = Scratches::<T>::default();

    let clock = Instant::now();
    let mut targets = ImageTarget::cut(&mut image, counts.as_deref_mut(), behind.as_deref_mut(), width);
    binning.each_run(|bins| {
        targets[bins.run.clone()].par_iter_mut().zip(bins.run.clone()).try_for_each(|(target, tile)| {
            scratches.with(|scratch| {
                walk.visit(bins.tile(tile), binning.region(tile), scratch, &mut |pixel| {
                    target.resolve(&walk, &pixel, background_at(&background, pixel.x, pixel.y, width));
                })
            })
        })
    })?;
    stats.fragments = targets.iter().map(|t| t.fragments).sum();
    stats.max_depth_complexity = targets.iter().map(|t| t.deepest).max();
    drop(targets);
    stats.stage("resolve", clock);

    let clock = Instant::now();
    let fragments = match &counts {
        Some(counts) if wants_lists => {
            // A second walk, now that every list's place is known: nothing is held twice.
            let mut lists = Fragments::with_counts(counts, Extras { coverage: false, blend: false })
                .ok_or_else(|| {
                    let entry = size_of::<(T, T::Key, [T; 4], i32)>() as u64;
                    out_of_memory("fragment lists", stats.fragments * entry)
                })?;
            let (mut targets, offsets) = ListTarget::cut(&mut lists, width);
            binning.each_run(|bins| {
                targets[bins.run.clone()].par_iter_mut().zip(bins.run.clone()).try_for_each(
                    |(target, tile)| {
                        scratches.with(|scratch| {
                            walk.visit(bins.tile(tile), binning.region(tile), scratch, &mut |pixel| {
                                let start = offsets[pixel.y as usize * width as usize + pixel.x as usize];
                                target.write(&walk, &pixel, start);
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
struct Scratches<T: Real>(Mutex<Vec<Scratch<T>>>);

impl<T: Real> Default for Scratches<T> {
    fn default() -> Self {
        Self(Mutex::new(Vec::new()))
    }
}

impl<T: Real> Scratches<T> {
    fn with<R>(&self, use_it: impl FnOnce(&mut Scratch<T>) -> R) -> R {
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
