//! What shows where nothing is listed: outside the rectangle that lists are made for, and behind them.

use rayon::prelude::*;

use super::buffers::{bind, storage};
use super::passes::Frame;
use super::pool::{Budget, Pool};
use super::readback::copied;
use super::rect::Rect;
use super::resolve::TILE;
use super::targets::place;
use super::timing::Timing;
use crate::error::Result;
use crate::frame::{BlendOrder, Output, Request};
use crate::memory::allocate;
use crate::methods::{self, Method};
use crate::resolve::{Fragment, Resolve};
use crate::threads::threads;

/// Writes the image and counts outside `rect`, where nothing is listed. `behind`: straight, of a pixel's sample.
pub fn fill_outside(
    output: &mut Output<f32>,
    request: &Request,
    behind: impl Fn(usize, usize) -> [f32; 4] + Sync,
    rect: Option<Rect>,
) -> Result<()> {
    let (width, each) = (request.width as usize, request.image_samples());
    // As the shaders resolve an empty list.
    let resolve = Resolve {
        method: Method::Exact,
        samples: request.samples,
        msaa: request.msaa_resolve,
        mixes: false,
        order: BlendOrder::FrontToBack,
        least_transmittance: 0.0,
    };
    let own = methods::Fragment { color: [0.0; 4], depth: 0.0, order: 0, primitive: 0, mode: 0 };
    let none = |_| Fragment { own, coverage: 0 };
    let inside = |x: usize, y: usize| {
        rect.is_some_and(|r| {
            (r.x0..r.x0 + r.w).contains(&(x as u32)) && (r.y0..r.y0 + r.h).contains(&(y as u32))
        })
    };
    threads()?.install(|| {
        output.image.par_chunks_mut(width * each).enumerate().for_each(|(y, row)| {
            for (x, colors) in row.chunks_exact_mut(each).enumerate().filter(|(x, _)| !inside(*x, y)) {
                resolve.pixel((0, 0), 0, none, |s| behind(y * width + x, s), |s, rgba| colors[s] = rgba);
            }
        });
    });
    if let Some(counts) = &mut output.counts {
        for (y, row) in counts.chunks_exact_mut(width).enumerate() {
            row.iter_mut().enumerate().filter(|(x, _)| !inside(*x, y)).for_each(|(_, n)| *n = 0);
        }
    }
    Ok(())
}

/// The straight colours behind all lists, opaque surfaces included, one a sample.
pub fn read(frame: &Frame, budget: &Budget, request: &Request) -> Result<Vec<[f32; 4]>> {
    let (gpu, samples) = (frame.gpu, request.samples as usize);
    let pipeline = frame.pipelines.background(gpu)?;
    let mut all = allocate("background", request.pixels() * samples, [f32::NAN; 4])?;
    let whole = Rect { x0: 0, y0: 0, w: request.width, h: request.height };
    for rect in whole.parts((budget.pixels / samples as u64).max(1)) {
        let bytes = 16 * rect.pixels() * samples as u64;
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let result = gpu.checked("reading the background", || {
            // The stage reads no list.
            let pool = Pool::new(gpu, &frame.pipelines.variant, 1, 1)?;
            let colors = storage(gpu, "background", bytes);
            let read_group = frame.read_group(&pool, &frame.band(&pool, rect));
            let layout = &frame.pipelines.layouts.background;
            let group = bind(gpu, "background", layout, &[(&colors).into()]);
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &read_group, &[]);
            pass.set_bind_group(1, &group, &[]);
            pass.dispatch_workgroups(rect.w.div_ceil(TILE), rect.h.div_ceil(TILE), 1);
            drop(pass);
            Ok(copied(gpu, &mut encoder, &colors, bytes))
        })?;
        let timing = Timing::new(gpu);
        let mut unused = Default::default();
        let words = frame.submit(encoder, &timing, &[&result], &mut unused)?;
        place(&words[0], &mut all, request.width, rect, samples);
    }
    Ok(all)
}
