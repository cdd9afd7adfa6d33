//! Methods whose states add up: of each, the targets that hold one, and how a fragment's own is blended into them
//! (shaders/hardware/blended.wgsl).

use wgpu::TextureFormat::R32Float;

use super::canvas::{ADD, CLEAR, Canvas, FADE, ONES, OVER, Target};
use crate::error::Result;
use crate::gpu::buffers::Bound;
use crate::gpu::pipelines::COLOR_FORMAT;
use crate::methods::Method;

type Own = (&'static str, wgpu::TextureFormat, Option<wgpu::BlendState>, wgpu::Color);

/// Of each pass, in the order of the shader's locations. `colors`: the format of colours and their sums.
fn targets(method: &Method, colors: wgpu::TextureFormat) -> Vec<Vec<Own>> {
    let sum = ("sum", colors, ADD, CLEAR);
    let moments = ("moments", COLOR_FORMAT, ADD, CLEAR); // in 16 bits nothing would be left of their differences
    let absorbance = ("absorbance", R32Float, ADD, CLEAR);
    match method {
        Method::WeightedAverage(_) => vec![vec![sum, ("count", R32Float, ADD, CLEAR)]],
        Method::Wboit(_) => vec![vec![sum, absorbance]],
        Method::Unsorted(_) => {
            vec![vec![("painted", colors, OVER, CLEAR), ("transmittance", R32Float, FADE, ONES)]]
        }
        Method::Mboit(own) if own.has_high_moments() => vec![vec![absorbance, moments, moments], vec![sum]],
        Method::Mboit(_) => vec![vec![absorbance, moments], vec![sum]],
        _ => vec![vec![sum]],
    }
}

/// Draws all, and returns the image.
pub fn blended(canvas: &mut Canvas) -> Result<wgpu::TextureView> {
    let method = canvas.method;
    let mut seen: Vec<wgpu::TextureView> = Vec::new();
    let stages = [("first pass", "fs_first"), ("second pass", "fs_second")];
    for (own, (stage, fragment)) in targets(method, canvas.colors).into_iter().zip(stages) {
        let views = own
            .iter()
            .map(|&(label, format, ..)| canvas.texture(label, format, 1))
            .collect::<Result<Vec<_>>>()?;
        let into: Vec<_> = own
            .iter()
            .zip(&views)
            .map(|(&(_, _, blend, clear), view)| Target::new(view, blend, clear))
            .collect();
        let reads: Vec<Bound> = seen.iter().map(Into::into).collect();
        canvas.draw(stage, fragment, &into, &reads)?;
        seen.extend(views);
        if let Method::Mboit(own) = method
            && fragment == "fs_first"
            && !own.has_high_moments()
        {
            // The shader has a binding for them.
            seen.push(seen[1].clone());
        }
    }
    let image = canvas.texture("image", COLOR_FORMAT, 1)?;
    let reads: Vec<Bound> = seen.iter().map(Into::into).collect();
    canvas.screen("composite", "fs_composite", &[Target::new(&image, None, CLEAR)], &reads)?;
    Ok(image)
}
