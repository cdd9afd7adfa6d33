//! What a pixel's list holds of a fragment: key and rank in one integer and, where a pixel has several
//! samples, which of them it covers.

use std::cmp::Ordering;

use crate::real::{Bounded, Real};
use crate::samples::Offset;

/// Where a fragment's depth and colour are taken, in the upper half of its word; its mask is the lower half.
const LOCATION_SHIFT: u32 = 16;
/// In place of a sample's number: the pixel's centre.
const CENTER: u32 = 16;

/// A geometric mask and whether the centre is covered, in one word. Depth and colour are taken at the centre if
/// it is covered, else at the lowest covered sample.
pub fn covered(mask: u32, center: bool) -> u32 {
    mask | if center { CENTER } else { mask.trailing_zeros() } << LOCATION_SHIFT
}

/// Of a word that `covered` made: the offset from the pixel's centre.
#[inline]
pub fn location(word: u32, pattern: &[Offset]) -> Offset {
    pattern.get((word >> LOCATION_SHIFT) as usize).copied().unwrap_or((0, 0))
}

/// A fragment in a list. Lists are sorted by key, then rank.
pub trait Listed<T: Real>: Copy + Ord + Bounded + Send + Sync + Default + std::fmt::Debug + 'static {
    /// `word`: as `covered` makes it; of samples that an opaque surface hides the bits are gone.
    fn new(entry: T::Entry, word: u32) -> Self;
    fn entry(self) -> T::Entry;
    /// Bit s: sample s is covered.
    fn coverage(self) -> u32;
    /// Where depth and colour are taken, from the centre.
    fn location(self, pattern: &[Offset]) -> Offset;
}

/// One sample a pixel: its centre.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Single<E>(E);

impl<E: Ord + Copy> PartialOrd for Single<E> {
    #[inline]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
    #[inline]
    fn lt(&self, other: &Self) -> bool {
        self.0 < other.0
    }
}

impl<E: Ord + Copy> Ord for Single<E> {
    #[inline]
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.cmp(&other.0)
    }
    // The integers' own, which take no branch.
    #[inline]
    fn min(self, other: Self) -> Self {
        Self(self.0.min(other.0))
    }
    #[inline]
    fn max(self, other: Self) -> Self {
        Self(self.0.max(other.0))
    }
}

impl<E: Bounded> Bounded for Single<E> {
    const MAX: Self = Self(E::MAX);
}

impl<T: Real> Listed<T> for Single<T::Entry> {
    #[inline]
    fn new(entry: T::Entry, _: u32) -> Self {
        Self(entry)
    }
    #[inline]
    fn entry(self) -> T::Entry {
        self.0
    }
    #[inline]
    fn coverage(self) -> u32 {
        1
    }
    #[inline]
    fn location(self, _: &[Offset]) -> Offset {
        (0, 0)
    }
}

/// Several samples a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct Covered<E> {
    entry: E,
    word: u32,
}

impl<E: Bounded> Bounded for Covered<E> {
    const MAX: Self = Self { entry: E::MAX, word: u32::MAX };
}

impl<T: Real> Listed<T> for Covered<T::Entry> {
    fn new(entry: T::Entry, word: u32) -> Self {
        Self { entry, word }
    }
    fn entry(self) -> T::Entry {
        self.entry
    }
    fn coverage(self) -> u32 {
        self.word & ((1 << LOCATION_SHIFT) - 1)
    }
    fn location(self, pattern: &[Offset]) -> Offset {
        location(self.word, pattern)
    }
}
