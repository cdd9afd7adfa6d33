//! The `tiles` pipeline's rasteriser: triangles are set up and binned to 16×16 tiles by compute shaders, and a workgroup
//! walks a tile's triangles with an invocation a pixel.

mod binning;
mod bins;
mod canvas;
mod classes;
mod counted;
mod image;
mod listed;
mod opaque;
mod ready;
mod render;
mod stages;
mod stream;
mod walk;
mod yardstick;

pub use bins::{Bins, BinsKey};
pub use classes::Wanted;
pub use image::{Image, ImageKey, is_enough};
pub use opaque::{Opaque, OpaqueKey};
pub use ready::Ready;
pub use render::{Begun, begin, render};
pub use stages::Stages;
#[cfg(test)]
pub use stages::modules;
pub use stream::render as stream;
pub use walk::Walker;
pub use yardstick::{Times, measure};

use super::device::Gpu;
use super::pipelines::Pipelines;
use super::variant::Variant;

/// What every stage is encoded with.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    pub gpu: &'a Gpu,
    pub pipelines: &'a Pipelines,
    pub view: &'a wgpu::Buffer,
}

impl Context<'_> {
    fn stages(&self) -> &Stages {
        &self.pipelines.tiles
    }

    fn variant(&self) -> &Variant {
        &self.pipelines.variant
    }
}
