//! The peelings: a layer, or one at either end, with each pass over the geometry.

use wgpu::TextureFormat::{R32Float, Rg32Float, Rg32Uint};

use super::canvas::{CLEAR, Canvas, FADE, MAX, ONES, OPEN, OVER, Target, UNDER};
use super::stages::{Depth, Drawing};
use crate::error::Result;
use crate::gpu::pipelines::{COLOR_FORMAT, DEPTH_FORMAT};

/// Peels so many layers from the front, and returns the image (shaders/hardware/depth_peeling.wgsl).
pub fn depth_peeling(canvas: &mut Canvas, layers: u32) -> Result<wgpu::TextureView> {
    let color = canvas.texture("layer", canvas.colors, 1)?;
    let depth = canvas.texture("depth of the layer", DEPTH_FORMAT, 1)?;
    let orders = [canvas.texture("order", Rg32Uint, 1)?, canvas.texture("order", Rg32Uint, 1)?];
    let rgb = canvas.texture("layers", COLOR_FORMAT, 1)?;
    let coverage = canvas.texture("coverage", COLOR_FORMAT, 1)?;
    // In front of all; behind all, where a pass finds nothing.
    const BEHIND: f64 = u32::MAX as f64;
    let none = wgpu::Color { r: BEHIND, g: BEHIND, b: 0.0, a: 0.0 };
    canvas.clear(
        "peel",
        &[
            Target::new(&orders[1], None, CLEAR),
            Target::new(&rgb, None, OPEN),
            Target::new(&coverage, None, OPEN),
        ],
    );
    let opaque = canvas.opaque_depth.clone();
    for layer in 0..layers as usize {
        let (last, own) = (&orders[(layer + 1) % 2], &orders[layer % 2]);
        let targets = [Target::new(&color, None, CLEAR), Target::new(own, None, none)];
        let peel = Drawing {
            vertex: "vs_translucent",
            fragment: "fs_peel",
            targets: &targets,
            depth: Depth::Written,
            samples: 1,
            reads: &[last.into(), (&opaque).into()],
        };
        canvas.pass("peel", &peel, Some((&depth, Some(0.0))))?;
        canvas.drawn += 1;
        let under = [Target::more(&rgb, UNDER), Target::more(&coverage, UNDER)];
        canvas.screen("under", "fs_under", &under, &[(&color).into(), own.into()])?;
    }
    let image = canvas.texture("image", COLOR_FORMAT, 1)?;
    let reads = [(&rgb).into(), (&coverage).into()];
    canvas.screen("composite", "fs_composite", &[Target::new(&image, None, CLEAR)], &reads)?;
    Ok(image)
}

/// Peels from both ends until nothing is left of lists up to `deepest` (shaders/hardware/dual_depth_peeling.wgsl).
pub fn dual_depth_peeling(canvas: &mut Canvas, deepest: u32) -> Result<wgpu::TextureView> {
    let ends = [canvas.texture("ends", Rg32Float, 1)?, canvas.texture("ends", Rg32Float, 1)?];
    let front = canvas.texture("front layer", canvas.colors, 1)?;
    let back = canvas.texture("back layer", canvas.colors, 1)?;
    let front_rgb = canvas.texture("front layers", COLOR_FORMAT, 1)?;
    let front_coverage = canvas.texture("coverage", COLOR_FORMAT, 1)?;
    let back_color = canvas.texture("back layers", COLOR_FORMAT, 1)?;
    let back_transmittance = canvas.texture("transmittance", R32Float, 1)?;
    // Outside all: z is from 0 to 1. Then below all, which is what is found of nothing.
    let outside = wgpu::Color { r: 2.0, g: 1.0, b: 0.0, a: 0.0 };
    let none = wgpu::Color { r: -2.0, g: -2.0, b: 0.0, a: 0.0 };
    canvas.clear(
        "peel",
        &[
            Target::new(&front_rgb, None, OPEN),
            Target::new(&front_coverage, None, OPEN),
            Target::new(&back_color, None, CLEAR),
            Target::new(&back_transmittance, None, ONES),
        ],
    );
    canvas.clear("peel", &[Target::new(&ends[1], None, outside)]);
    // The first finds the first two ends.
    let passes = if deepest == 0 { 0 } else { 1 + deepest.div_ceil(2) };
    for pass in 0..passes as usize {
        let (last, own) = (&ends[(pass + 1) % 2], &ends[pass % 2]);
        let targets =
            [Target::new(own, MAX, none), Target::new(&front, OVER, CLEAR), Target::new(&back, OVER, CLEAR)];
        canvas.draw("peel", "fs_peel", &targets, &[last.into()])?;
        let merged = [
            Target::more(&front_rgb, UNDER),
            Target::more(&front_coverage, UNDER),
            Target::more(&back_color, OVER),
            Target::more(&back_transmittance, FADE),
        ];
        canvas.screen("merge", "fs_merge", &merged, &[(&front).into(), (&back).into()])?;
    }
    let image = canvas.texture("image", COLOR_FORMAT, 1)?;
    let reads =
        [(&front_rgb).into(), (&front_coverage).into(), (&back_color).into(), (&back_transmittance).into()];
    canvas.screen("composite", "fs_composite", &[Target::new(&image, None, CLEAR)], &reads)?;
    Ok(image)
}
