//! The `tiles` pipeline on the CPU: set up, bin, then one tile at a time in cache, in parallel.

mod bin;
mod centers;
mod coverage;
mod entry;
mod lanes;
mod layers;
mod lists;
mod plane;
mod region;
mod samples;
mod setup;
mod sort;
mod target;
mod tile;
mod tile_walk;

use std::mem::MaybeUninit;
use std::ops::{Deref, DerefMut, Range};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use rayon::prelude::*;

use crate::camera::Camera;
use crate::error::Result;
use crate::fragments::{Background, Extras, Fragments};
use crate::frame::{Lists, Output, Request, Stats};
use crate::memory::{allocate, out_of_memory, recycled};
use crate::methods::Order;
use crate::real::Real;
use crate::resolve::Resolve;
use crate::samples::pattern;
use crate::scene::Scene;
use bin::Binning;
use entry::{Covered, Listed, Single};
use lanes::Instructions;
use layers::{Layers, Quick};
use lists::ListTarget;
use region::{Region, TILE};
use setup::{Faces, Part};
use target::{Found, ImageParts, ImageTarget, Rules};
use tile::{DeepPixel, Scratch, Walk};

/// What bins and scratch may take together unless `memory=` says otherwise.
const DEFAULT_MEMORY: u64 = 1 << 30;

/// `f32` or `f64`, and the quick ways that there are in it.
pub trait Precision: Real {
    /// Adds what is visible of some faces.
    fn add_faces(_: Instructions, part: &mut Part<Self>, of: &Faces<Self>, faces: Range<usize>) {
        part.add_each(of, faces);
    }
    /// `None` where there is none for this render.
    fn quick<'a>(_: &'a Walk<'a, Self>, _: &Rules, _: Background<'a, Self>) -> Option<Quick<'a>> {
        None
    }
    /// Resolves a tile the quick way. `false` if it must go the general one.
    fn resolve<L: Listed<Self>>(
        _: &Quick,
        _records: &[u32],
        _: Region,
        _: &mut Layers,
        _: &mut ImageTarget<'_, '_, Self, L>,
    ) -> bool {
        false
    }
}
impl Precision for f64 {}
impl Precision for f32 {
    fn add_faces(instructions: Instructions, part: &mut Part<Self>, of: &Faces<Self>, faces: Range<usize>) {
        setup::add_faces(instructions, part, of, faces);
    }
    fn quick<'a>(
        walk: &'a Walk<'a, Self>,
        rules: &Rules,
        background: Background<'a, Self>,
    ) -> Option<Quick<'a>> {
        Quick::of(walk, rules, background)
    }
    fn resolve<L: Listed<Self>>(
        quick: &Quick,
        records: &[u32],
        region: Region,
        layers: &mut Layers,
        target: &mut ImageTarget<'_, '_, Self, L>,
    ) -> bool {
        quick.resolve(records, region, layers, target)
    }
}

/// Renders a scene. `T` is the precision of everything after the positions.
pub fn render<T: Precision>(
    scene: &Scene,
    camera: &Camera,
    request: &Request,
    background: Background<T>,
) -> Result<Output<T>> {
    render_with(Instructions::detected(), scene, camera, request, background)
}

fn render_with<T: Precision>(
    instructions: Instructions,
    scene: &Scene,
    camera: &Camera,
    request: &Request,
    background: Background<T>,
) -> Result<Output<T>> {
    if request.samples == 1 {
        render_listed::<T, Single<T::Entry>>(instructions, scene, camera, request, background)
    } else {
        render_listed::<T, Covered<T::Entry>>(instructions, scene, camera, request, background)
    }
}

/// `L`: what lists hold of a fragment.
fn render_listed<T: Precision, L: Listed<T>>(
    instructions: Instructions,
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
    let setup = setup::set_up::<T>(instructions, scene, camera, (width, height), samples > 1);
    stats.rejected_triangles = setup.rejected;
    stats.stage("setup", clock);

    let clock = Instant::now();
    let binning = Binning::new(&setup, width, height, memory / 2)?;
    stats.stage("bin", clock);

    let walk = Walk {
        setup: &setup,
        width,
        meshes: &scene.meshes,
        pattern: pattern(request.samples),
        instructions,
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
    let each = request.image_samples();
    let mut image = recycled::room("the image", pixels * each)?;
    let unwritten = &mut image.spare_capacity_mut()[..pixels * each];
    if cfg!(debug_assertions) {
        unwritten.fill(MaybeUninit::new([T::NAN; 4])); // a pixel that no tile writes would show
    }
    let mut counts = (request.lists != Lists::None).then(|| allocate("counts", pixels, -1)).transpose()?;
    let mut behind = (wants_lists && walk.hides)
        .then(|| allocate("background", pixels * samples, [T::NAN; 4]))
        .transpose()?;
    let scratches = Scratches::<T, L>::default();

    let clock = Instant::now();
    let parts = ImageParts {
        image: unwritten,
        counts: counts.as_deref_mut(),
        behind: behind.as_deref_mut(),
        width,
        each,
        samples,
    };
    let mut bands = parts.bands();
    let quick = T::quick(&walk, &rules, background);
    let flat = |x: i32, y: i32| y as usize * width as usize + x as usize;
    binning.each_run(|bins| {
        bands.par_iter_mut().enumerate().try_for_each(|(ty, band)| {
            let (tiles, of_run) = binning.of_row(ty, &bins.run);
            let mut cut = band.tiles();
            let mut targets = cut.targets::<L>();
            targets[of_run].par_iter_mut().zip(tiles).try_for_each_init(
                || scratches.borrow(),
                |scratch, (target, tile)| {
                    let (records, region) = (bins.tile(tile), binning.region(tile));
                    if let Some(quick) = &quick
                        && T::resolve(quick, records, region, &mut scratch.layers, target)
                    {
                        return Ok(());
                    }
                    walk.visit(rules.resolve.takes(), records, region, scratch, &mut |pixel| {
                        target.resolve(&walk, &rules, &pixel, background.at(flat(pixel.x, pixel.y)));
                    })
                },
            )?;
            let found = targets.iter().map(ImageTarget::found).fold(Found::default(), Found::and);
            drop(targets);
            drop(cut);
            band.found = band.found.and(found);
            Ok(())
        })
    })?;
    let found = bands.iter().map(|band| band.found).fold(Found::default(), Found::and);
    drop(bands);
    // SAFETY: there is room for as many, and every tile has written all of its pixels.
    unsafe { image.set_len(pixels * each) };
    stats.fragments = found.fragments;
    stats.dropped_fragments = found.dropped;
    stats.leave_out(&request.method, found.left_out);
    stats.max_depth_complexity = Some(found.deepest);
    stats.choose("rectangle", binning.describe_box(), "where geometry lands; elsewhere is background");
    let tiles = format!("{} of {} hold translucent geometry", found.filled, binning.tile_count());
    stats.choose("tiles", tiles, format!("{TILE}×{TILE} pixels each"));
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
                        let scratch = &mut scratches.borrow();
                        let (records, region) = (bins.tile(tile), binning.region(tile));
                        walk.visit(Order::FrontToBack, records, region, scratch, &mut |pixel| {
                            target.write(&walk, &pixel, offsets[flat(pixel.x, pixel.y)]);
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

/// Buffers that threads borrow.
struct Scratches<T: Real, L>(Mutex<Vec<Scratch<T, L>>>);

impl<T: Real, L> Default for Scratches<T, L> {
    fn default() -> Self {
        Self(Mutex::new(Vec::new()))
    }
}

impl<T: Real, L> Scratches<T, L> {
    // A poisoned lock means that a thread panicked between two pushes: the buffers are still sound.
    fn free(&self) -> MutexGuard<'_, Vec<Scratch<T, L>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn borrow(&self) -> Borrowed<'_, T, L> {
        let scratch = self.free().pop().unwrap_or_default();
        Borrowed { scratch, owner: self }
    }

    fn bytes(&self) -> u64 {
        self.free().iter().map(Scratch::bytes).sum()
    }
}

/// One thread's buffers, which go back when it is done.
struct Borrowed<'a, T: Real, L> {
    scratch: Scratch<T, L>,
    owner: &'a Scratches<T, L>,
}

impl<T: Real, L> Deref for Borrowed<'_, T, L> {
    type Target = Scratch<T, L>;
    fn deref(&self) -> &Self::Target {
        &self.scratch
    }
}

impl<T: Real, L> DerefMut for Borrowed<'_, T, L> {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.scratch
    }
}

impl<T: Real, L> Drop for Borrowed<'_, T, L> {
    fn drop(&mut self) {
        self.owner.free().push(std::mem::take(&mut self.scratch));
    }
}
