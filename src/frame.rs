//! What a pipeline is asked for, and what it gives.

use std::borrow::Cow;
use std::sync::Arc;
use std::time::Instant;

use crate::error::{Error, Result};
use crate::fragments::{Background, Fragments};
use crate::methods::Method;
use crate::node_format::NodeFormat;
use crate::real::Real;
use crate::samples::check_samples;

/// Which fragment lists come back.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lists {
    None,
    Count,
    Translucent,
    /// Opaque surfaces too, hiding nothing.
    All,
}

/// How the samples of a pixel become what is returned (GPU Pro 2, sections 2.7.2 and 2.8.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MsaaResolve {
    /// Each sample is composited on its own, then their mean is taken.
    PerSample,
    /// All samples in one walk over the pixel's fragments: the same numbers.
    PerPixel,
    /// The mean weighs each sample by 1 / (1 + its largest channel).
    Hdr,
    /// The samples themselves.
    None,
}

/// How a pixel's list is sorted. All give the same order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Sort {
    Auto,
    Insertion,
    Selection,
    Bitonic,
    Merge,
    Heap,
}

/// Which fragments of a pixel are kept where their number is limited.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum LimitPolicy {
    /// The nearest (GPU Pro 2, listing 2.2).
    Nearest,
    /// Those of the greatest primitives: the first that a reverse list holds.
    LastSubmitted,
}

/// The direction in which sorted fragments are blended. Both give the same image, up to rounding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BlendOrder {
    /// Underblending, with a transmittance.
    FrontToBack,
    BackToFront,
}

#[derive(Debug, Clone)]
pub struct Request {
    pub method: Method,
    pub width: u32,
    pub height: u32,
    pub lists: Lists,
    /// Bytes that lists, bins and scratch may take. `None`: the pipeline's own default.
    pub memory: Option<u64>,
    /// Samples a pixel, of `samples::COUNTS`.
    pub samples: u32,
    pub msaa_resolve: MsaaResolve,
    pub sort: Sort,
    /// At most so many fragments of a pixel are composited; the others count as dropped.
    pub limit: Option<(u32, LimitPolicy)>,
    pub blend_order: BlendOrder,
    /// Front to back, a sample's list is left where no more than this is let through. At 0 that changes no bit.
    pub least_transmittance: f64,
    /// Native forms of methods draw colours, and sum them, in 16 bits.
    pub half_targets: bool,
    pub lists_on_gpu: ListOptions,
}

/// What concerns stored lists, which the GPU's pipelines keep.
#[derive(Debug, Clone)]
pub struct ListOptions {
    pub rasteriser: Rasteriser,
    pub storage: Storage,
    pub format: NodeFormat,
    /// The longest list of each class of the resolve, rising.
    pub classes: Vec<u32>,
    /// The resolve is a full-screen pass behind a stencil, not a dispatch.
    pub fullscreen: bool,
    /// Names and WGSL of a user's blends, ids 5 and on.
    pub blends: Arc<[(String, String)]>,
}

/// What turns triangles into fragments on a GPU. Of a method other than exact: `Hardware` is its native form.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Rasteriser {
    Hardware,
    /// `tiles`: compute shaders.
    Tiles,
}

/// How lists are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Storage {
    /// `linked_list`: appended and linked, in one pass over the geometry.
    Linked,
    /// `prefix_sum`: counted, scanned, scattered; contiguous, in two.
    Contiguous,
}

/// The largest width and height: with a viewport of guard band on each side, snapped coordinates stay
/// within ±2^23.
pub const MAX_SIZE: u32 = 16384;

/// What a render measured.
#[derive(Debug, Default)]
pub struct Stats {
    pub fragments: u64,
    pub max_depth_complexity: Option<u32>,
    pub rejected_triangles: u64,
    /// Beyond a limit, or those that a bounded method neither composites nor merges.
    pub dropped_fragments: u64,
    /// Those that a bounded method composites together with others.
    pub merged_fragments: u64,
    /// Parts that the image was rendered in to stay within memory.
    pub bands: usize,
    pub bytes: Vec<(&'static str, u64)>,
    pub ms: Vec<(Cow<'static, str>, f64)>,
    /// From the first begin to the last end of a GPU's stages, clears included; where one submission has them all.
    pub gpu_ms: Option<f64>,
    pub device: String,
    /// Choices that were made on the way: what, which, why.
    pub plan: Vec<(&'static str, String, String)>,
}

impl Stats {
    /// Records the wall time of a stage that began at `start`.
    pub fn stage(&mut self, name: &'static str, start: Instant) {
        self.add(name, start.elapsed().as_secs_f64() * 1e3);
    }

    /// Notes fragments that a bounded method left out.
    pub fn leave_out(&mut self, method: &Method, fragments: u64) {
        if method.drops() {
            self.dropped_fragments += fragments;
        } else {
            self.merged_fragments += fragments;
        }
    }

    /// Adds to the time of a stage.
    pub fn add(&mut self, name: impl Into<Cow<'static, str>>, ms: f64) {
        let name = name.into();
        match self.ms.iter_mut().find(|(stage, _)| *stage == name) {
            Some((_, total)) => *total += ms,
            None => self.ms.push((name, ms)),
        }
    }

    /// Records a choice and its reason.
    pub fn choose(&mut self, what: &'static str, choice: impl Into<String>, why: impl Into<String>) {
        self.plan.push((what, choice.into(), why.into()));
    }

    /// Records bytes of a use, of which the largest counts.
    pub fn raise(&mut self, name: &'static str, bytes: u64) {
        match self.bytes.iter_mut().find(|(what, _)| *what == name) {
            Some((_, most)) => *most = bytes.max(*most),
            None => self.bytes.push((name, bytes)),
        }
    }
}

/// An image with what was asked for beside it.
#[derive(Debug)]
pub struct Output<T: Real> {
    /// Premultiplied, over the background, row 0 on top; a pixel's samples side by side where they are asked for.
    pub image: Vec<[T; 4]>,
    pub counts: Option<Vec<i32>>,
    /// Straight colours behind the lists, one a sample, where opaque geometry makes them differ from the request's.
    pub background: Option<Vec<[T; 4]>>,
    pub fragments: Option<Fragments<T>>,
    pub stats: Stats,
}

impl Request {
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// The same in tiles.
    pub fn in_tiles(&self) -> Self {
        let mut request = self.clone();
        request.lists_on_gpu.rasteriser = Rasteriser::Tiles;
        request.lists_on_gpu.storage = Storage::Contiguous;
        request
    }

    /// Colours a pixel of the image.
    pub fn image_samples(&self) -> usize {
        if self.msaa_resolve == MsaaResolve::None { self.samples as usize } else { 1 }
    }

    pub fn check<T>(&self, background: &Background<T>) -> Result<()> {
        let valid = 1..=MAX_SIZE;
        if !valid.contains(&self.width) || !valid.contains(&self.height) {
            return Err(Error::Parameter(format!(
                "width and height must be from 1 to {MAX_SIZE}, got {} and {}",
                self.width, self.height
            )));
        }
        check_samples(self.samples)?;
        let pixels = self.pixels();
        if let Background::Image(image) = background
            && image.len() != pixels
        {
            return Err(Error::Parameter(format!(
                "background has {} pixels, the image {pixels}",
                image.len()
            )));
        }
        Ok(())
    }
}
