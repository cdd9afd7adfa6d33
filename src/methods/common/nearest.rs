//! The nearest fragments of a pixel, front to back, at most so many.

use arrayvec::ArrayVec;

use super::layer::Layer;
use crate::methods::Fragment;
use crate::real::Real;

/// The most that `k` may be.
pub const MOST: usize = 64;

#[derive(Debug, Clone)]
pub struct Nearest<T: Real>(ArrayVec<Fragment<T>, MOST>);

impl<T: Real> Nearest<T> {
    pub fn none() -> Self {
        Self(ArrayVec::new())
    }

    /// All of them together.
    pub fn layer(&self) -> Layer<T> {
        self.0.iter().fold(Layer::clear(), |front, f| front.onto(Layer::of(f.color)))
    }

    pub fn alphas(&self) -> impl Iterator<Item = T> {
        self.0.iter().map(|f| f.color[3])
    }

    /// Takes a fragment in. Returns the farthest, which is this one perhaps, if that makes more than `k`.
    #[inline]
    pub fn insert(&mut self, fragment: Fragment<T>, k: usize) -> Option<Fragment<T>> {
        let place = self.0.iter().rposition(|f| f.order < fragment.order).map_or(0, |i| i + 1);
        if self.0.len() < k {
            self.0.insert(place, fragment);
            return None;
        }
        if place >= k {
            return Some(fragment);
        }
        let farthest = self.0.pop();
        self.0.insert(place, fragment);
        farthest
    }

    /// Whether all of them are in front of a fragment.
    pub fn end_before(&self, fragment: &Fragment<T>) -> bool {
        self.0.last().is_none_or(|last| last.order < fragment.order)
    }
}
