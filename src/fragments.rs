//! Per-pixel fragment lists in compressed-row form: pixel p owns entries `offsets[p]..offsets[p + 1]`,
//! sorted front to back.

use bytemuck::Zeroable;

use crate::memory::allocate;
use crate::real::Real;

/// Fragment lists of an image, `offsets` one longer than the pixels, the rest one entry a fragment.
#[derive(Debug, Default)]
pub struct Fragments<T: Real> {
    pub offsets: Vec<i64>,
    pub depth: Vec<T>,
    pub key: Vec<T::Key>,
    pub color: Vec<[T; 4]>,
    pub primitive: Vec<i32>,
    /// Which samples each fragment covers, where a pixel has more than one.
    pub coverage: Option<Vec<u32>>,
    /// Each fragment's blend mode, where a scene has others than `over`.
    pub blend: Option<Vec<u8>>,
}

/// What lists hold beside depth, colour and primitive: only what the scene requires.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Extras {
    pub coverage: bool,
    pub blend: bool,
}

impl<T: Real> Fragments<T> {
    /// Empty lists with room for these counts a pixel. `None` where the memory cannot be had.
    pub fn with_counts(counts: &[i32], extras: Extras) -> Option<Self> {
        let mut offsets = Vec::new();
        offsets.try_reserve_exact(counts.len() + 1).ok()?;
        offsets.push(0);
        let mut total = 0_i64;
        for &count in counts {
            total += i64::from(count);
            offsets.push(total);
        }
        let n = usize::try_from(total).ok()?;
        Some(Self {
            offsets,
            depth: filled(n, T::NAN)?,
            key: filled(n, T::Key::default())?,
            color: filled(n, [T::NAN; 4])?,
            primitive: filled(n, -1)?,
            coverage: if extras.coverage { Some(filled(n, 0)?) } else { None },
            blend: if extras.blend { Some(filled(n, 0)?) } else { None },
        })
    }
}

fn filled<V: Clone + Zeroable>(n: usize, poison: V) -> Option<Vec<V>> {
    allocate("fragment lists", n, poison).ok()
}

/// Straight RGBA behind all fragments: one colour, or one a pixel.
#[derive(Debug, Clone, Copy)]
pub enum Background<'a, T> {
    Constant([T; 4]),
    Image(&'a [[T; 4]]),
}

impl<T: Copy> Background<'_, T> {
    #[inline]
    pub fn at(&self, pixel: usize) -> [T; 4] {
        match self {
            Self::Constant(c) => *c,
            Self::Image(pixels) => pixels[pixel],
        }
    }
}
