//! What a pipeline is asked for, and what it gives.

use std::time::Instant;

use crate::error::{Error, Result};
use crate::fragments::{Background, Fragments};
use crate::real::Real;

/// Which fragment lists come back.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lists {
    None,
    Count,
    Translucent,
    /// Opaque surfaces too, hiding nothing.
    All,
}

#[derive(Debug, Clone)]
pub struct Request {
    pub width: u32,
    pub height: u32,
    pub lists: Lists,
    /// Bytes that lists, bins and scratch may take. `None`: the pipeline's own default.
    pub memory: Option<u64>,
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
    pub dropped_fragments: u64,
    /// Parts that the image was rendered in to stay within memory.
    pub bands: usize,
    pub bytes: Vec<(&'static str, u64)>,
    pub ms: Vec<(&'static str, f64)>,
    pub device: String,
}

impl Stats {
    /// Records the wall time of a stage that began at `start`.
    pub fn stage(&mut self, name: &'static str, start: Instant) {
        self.add(name, start.elapsed().as_secs_f64() * 1e3);
    }

    /// Adds to the time of a stage.
    pub fn add(&mut self, name: &'static str, ms: f64) {
        match self.ms.iter_mut().find(|(stage, _)| *stage == name) {
            Some((_, total)) => *total += ms,
            None => self.ms.push((name, ms)),
        }
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
    /// Premultiplied, over the background, row 0 on top.
    pub image: Vec<[T; 4]>,
    pub counts: Option<Vec<i32>>,
    /// Straight colours behind the lists, where opaque geometry makes them differ from the request's.
    pub background: Option<Vec<[T; 4]>>,
    pub fragments: Option<Fragments<T>>,
    pub stats: Stats,
}

impl Request {
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    pub fn check<T>(&self, background: &Background<T>) -> Result<()> {
        let valid = 1..=MAX_SIZE;
        if !valid.contains(&self.width) || !valid.contains(&self.height) {
            return Err(Error::Parameter(format!(
                "width and height must be from 1 to {MAX_SIZE}, got {} and {}",
                self.width, self.height
            )));
        }
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

/// `n` values, or an error where the system has no memory for them.
pub fn allocate<V: Clone>(what: &str, n: usize, value: V) -> Result<Vec<V>> {
    let mut v = Vec::new();
    v.try_reserve_exact(n).map_err(|_| out_of_memory(what, (n * size_of::<V>()) as u64))?;
    v.resize(n, value);
    Ok(v)
}

pub fn out_of_memory(what: &str, needed: u64) -> Error {
    Error::Capacity {
        what: what.into(),
        needed,
        limit: 0,
        advice: "the system has no such memory left: lower width and height, or ask for fewer fragments"
            .into(),
    }
}
