//! Stochastic transparency by the hardware's samples: as many draws a pass as it has (shaders/hardware/stochastic.wgsl).

use wgpu::BufferUsages;

use super::canvas::{ADD, CLEAR, Canvas, Target};
use super::stages::{Depth, Drawing};
use crate::error::{Error, Result};
use crate::gpu::buffers::with_contents;
use crate::gpu::pipelines::{COLOR_FORMAT, DEPTH_FORMAT};
use crate::methods::Stochastic;

/// Draws all, and returns the image.
pub fn stochastic(canvas: &mut Canvas, own: &Stochastic) -> Result<wgpu::TextureView> {
    let gpu = canvas.gpu;
    // As few passes as can be, and of those as few samples.
    let draws = own.draws();
    let counts = || gpu.adapter.samples.iter().copied().filter(|&count| count > 1);
    let Some(samples) = counts().filter(|&count| count >= draws).min().or(counts().max()) else {
        return Err(Error::Unsupported(format!(
            "{} has 1 sample a pixel, and draws are samples in pipeline \"hardware\": give pipeline=\"tiles\"",
            gpu.adapter.name
        )));
    };
    let absorbance = canvas.texture("absorbance", wgpu::TextureFormat::R32Float, 1)?;
    if own.corrects_alpha() {
        canvas.draw("absorb", "fs_absorb", &[Target::new(&absorbance, ADD, CLEAR)], &[])?;
    }
    let color = canvas.texture("draws", canvas.colors, samples)?;
    let depth = canvas.texture("depths of draws", DEPTH_FORMAT, samples)?;
    let sum = canvas.texture("sum", COLOR_FORMAT, 1)?;
    for first in (0..draws).step_by(samples as usize) {
        let count = samples.min(draws - first);
        let uniform = gpu.checked("draws", || {
            Ok(with_contents(gpu, "draws", BufferUsages::UNIFORM, &[[first, count, 0, 0]]))
        })?;
        let of = [(&uniform).into()];
        let into = [Target::new(&color, None, CLEAR)];
        let hides = canvas.hides();
        if hides {
            let opaque = Drawing {
                vertex: "vs_opaque",
                fragment: "fs_opaque",
                targets: &into,
                depth: Depth::Written,
                samples,
                reads: &[],
            };
            canvas.pass("draw", &opaque, Some((&depth, Some(0.0))))?;
        }
        let draw = Drawing {
            vertex: "vs_translucent",
            fragment: "fs_draw",
            targets: &into,
            depth: Depth::Written,
            samples,
            reads: &of,
        };
        canvas.pass("draw", &draw, Some((&depth, (!hides).then_some(0.0))))?;
        canvas.drawn += 1;
        if own.weighs_visibility() {
            let into = [Target::new(&color, ADD, CLEAR)];
            let shade = Drawing { fragment: "fs_shade", targets: &into, depth: Depth::Tested, ..draw };
            canvas.pass("shade", &shade, Some((&depth, None)))?;
            canvas.drawn += 1;
        }
        let into = if first == 0 { Target::new(&sum, ADD, CLEAR) } else { Target::more(&sum, ADD) };
        canvas.screen("gather", "fs_gather", &[into], &[(&uniform).into(), (&color).into()])?;
    }
    let image = canvas.texture("image", COLOR_FORMAT, 1)?;
    let reads = [(&sum).into(), (&absorbance).into()];
    canvas.screen("composite", "fs_composite", &[Target::new(&image, None, CLEAR)], &reads)?;
    Ok(image)
}
