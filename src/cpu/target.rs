//! Where tiles write the image: parts of whole-image arrays, handed out before the threads start, so that no two
//! threads share a pixel and none of it needs `unsafe`.

use std::mem::MaybeUninit;

use super::entry::Listed;
use super::region::TILE;
use super::tile::{Pixel, Walk, rank_of};
use crate::blend::OVER;
use crate::frame::LimitPolicy;
use crate::methods;
use crate::real::{Real, depth_of_key};
use crate::resolve::{Fragment, Resolve};

/// A tile's part of a row-major array: at most `TILE` rows.
pub struct TileRows<'a, V> {
    rows: [&'a mut [V]; TILE as usize],
    /// Values a pixel.
    each: usize,
}

impl<'a, V> TileRows<'a, V> {
    /// Cuts a band of the array, `TILE` rows or what is left of them, with `each` values a pixel into tiles.
    fn cut(band: &'a mut [V], width: u32, each: usize) -> Vec<Self> {
        let tile = TILE as usize;
        let empty = || Self { rows: std::array::from_fn(|_| &mut [][..]), each };
        let mut tiles: Vec<Self> = (0..width.div_ceil(TILE)).map(|_| empty()).collect();
        for (j, row) in band.chunks_mut(width as usize * each).enumerate() {
            for (slot, part) in tiles.iter_mut().zip(row.chunks_mut(tile * each)) {
                slot.rows[j] = part;
            }
        }
        tiles
    }

    /// `n` values of a row from pixel x on.
    #[inline(always)]
    fn row(&mut self, x: i32, y: i32, n: usize) -> &mut [V] {
        let column = x as usize % TILE as usize;
        &mut self.rows[y as usize % TILE as usize][column..column + n]
    }

    fn set(&mut self, x: i32, y: i32, sample: usize, value: V) {
        let column = x as usize % TILE as usize * self.each + sample;
        self.rows[y as usize % TILE as usize][column] = value;
    }
}

/// How a pixel's list becomes its part of the image.
#[derive(Clone)]
pub struct Rules {
    pub resolve: Resolve,
    pub limit: Option<(u32, LimitPolicy)>,
}

impl Rules {
    /// The fragments that are composited, in `kept` where they are not simply the first.
    fn limited<'l, T: Real, L: Listed<T>>(&self, entries: &'l [L], kept: &'l mut Vec<L>) -> &'l [L] {
        match self.limit {
            Some((n, policy)) if entries.len() > n as usize => match policy {
                LimitPolicy::Nearest => &entries[..n as usize],
                LimitPolicy::LastSubmitted => {
                    kept.clear();
                    kept.extend_from_slice(entries);
                    kept.sort_unstable_by_key(|l| rank_of::<T, L>(*l));
                    kept.truncate(n as usize);
                    kept.sort_unstable();
                    kept
                }
            },
            _ => entries,
        }
    }
}

/// What the resolving walk writes of a whole image.
pub struct ImageParts<'a, T> {
    pub image: &'a mut [MaybeUninit<[T; 4]>],
    pub counts: Option<&'a mut [i32]>,
    /// One colour a sample.
    pub behind: Option<&'a mut [[T; 4]]>,
    pub width: u32,
    /// Colours a pixel of the image.
    pub each: usize,
    pub samples: usize,
}

/// A row of tiles, and what was found there.
pub struct Band<'a, T> {
    parts: ImageParts<'a, T>,
    pub found: Found,
}

/// What tiles hold.
#[derive(Debug, Clone, Copy, Default)]
pub struct Found {
    pub fragments: u64,
    pub dropped: u64,
    /// By a bounded method.
    pub left_out: u64,
    pub deepest: u32,
    /// Tiles with fragments.
    pub filled: usize,
}

impl Found {
    pub fn and(self, other: Self) -> Self {
        Self {
            fragments: self.fragments + other.fragments,
            dropped: self.dropped + other.dropped,
            left_out: self.left_out + other.left_out,
            deepest: self.deepest.max(other.deepest),
            filled: self.filled + other.filled,
        }
    }
}

impl<'a, T: Real> ImageParts<'a, T> {
    /// Cuts the image into rows of tiles.
    pub fn bands(self) -> Vec<Band<'a, T>> {
        let Self { image, counts, behind, width, each, samples } = self;
        let pixels = (width * TILE) as usize;
        let mut counts = counts.map(|c| c.chunks_mut(pixels));
        let mut behind = behind.map(|b| b.chunks_mut(pixels * samples));
        let mut band = |image| Band {
            parts: Self {
                image,
                counts: counts.as_mut().and_then(Iterator::next),
                behind: behind.as_mut().and_then(Iterator::next),
                width,
                each,
                samples,
            },
            found: Found::default(),
        };
        image.chunks_mut(pixels * each).map(&mut band).collect()
    }
}

impl<T: Real> Band<'_, T> {
    /// Cuts the band into tiles, from left to right.
    pub fn tiles(&mut self) -> Tiles<'_, T> {
        let ImageParts { image, counts, behind, width, each, samples } = &mut self.parts;
        Tiles {
            image: TileRows::cut(image, *width, *each),
            counts: counts.as_mut().map(|c| TileRows::cut(c, *width, 1)),
            behind: behind.as_mut().map(|b| TileRows::cut(b, *width, *samples)),
        }
    }
}

/// The tiles of a band.
pub struct Tiles<'a, T> {
    image: Vec<TileRows<'a, MaybeUninit<[T; 4]>>>,
    counts: Option<Vec<TileRows<'a, i32>>>,
    behind: Option<Vec<TileRows<'a, [T; 4]>>>,
}

impl<'a, T: Real> Tiles<'a, T> {
    pub fn targets<L: Listed<T>>(&mut self) -> Vec<ImageTarget<'_, 'a, T, L>> {
        let mut counts = self.counts.as_mut().map(|c| c.iter_mut());
        let mut behind = self.behind.as_mut().map(|b| b.iter_mut());
        let target = |image| ImageTarget {
            image,
            counts: counts.as_mut().and_then(Iterator::next),
            behind: behind.as_mut().and_then(Iterator::next),
            kept: Vec::new(),
            found: Found::default(),
        };
        self.image.iter_mut().map(target).collect()
    }
}

/// What the resolving walk writes for a tile.
pub struct ImageTarget<'t, 'a, T, L> {
    image: &'t mut TileRows<'a, MaybeUninit<[T; 4]>>,
    counts: Option<&'t mut TileRows<'a, i32>>,
    behind: Option<&'t mut TileRows<'a, [T; 4]>>,
    kept: Vec<L>,
    found: Found,
}

impl<T: Real, L: Listed<T>> ImageTarget<'_, '_, T, L> {
    pub fn found(&self) -> Found {
        Found { filled: usize::from(self.found.fragments > 0), ..self.found }
    }

    /// The colours behind lists are asked for too.
    pub fn wants_behind(&self) -> bool {
        self.behind.is_some()
    }

    /// Colours of `n` pixels of one sample, to be written, from (x, y) to the right.
    #[inline(always)]
    pub fn row(&mut self, x: i32, y: i32, n: usize) -> &mut [MaybeUninit<[T; 4]>] {
        self.image.row(x, y, n)
    }

    /// Takes note of how many fragments the pixels of a row have: `each` for every fragment.
    #[inline(always)]
    pub fn count(&mut self, y: i32, row: &[u32], each: u32) {
        self.found.fragments += row.iter().map(|&n| n / each).sum::<u32>() as u64;
        self.found.deepest = self.found.deepest.max(row.iter().map(|&n| n / each).max().unwrap_or_default());
        if let Some(counts) = &mut self.counts {
            for (count, &n) in counts.row(0, y, row.len()).iter_mut().zip(row) {
                *count = (n / each) as i32;
            }
        }
    }

    pub fn resolve(&mut self, walk: &Walk<T>, rules: &Rules, pixel: &Pixel<L>, background: [T; 4]) {
        let Pixel { x, y, entries, .. } = *pixel;
        let Rules { resolve, .. } = rules;
        let behind = |s: usize| pixel.opaque(s).map_or(background, |listed| walk.color(listed, x, y));
        let listed = rules.limited(entries, &mut self.kept);
        let fragment = |i: usize| Fragment {
            own: methods::Fragment {
                color: walk.color(listed[i], x, y),
                depth: depth_of_key(T::key_of(listed[i].entry()), walk.setup.perspective),
                order: listed[i].entry(),
                primitive: walk.primitive(listed[i]),
                mode: if resolve.mixes { walk.mode(listed[i]) } else { OVER },
            },
            coverage: listed[i].coverage(),
        };
        let image = &mut self.image;
        let write = |s, rgba| image.set(x, y, s, MaybeUninit::new(rgba));
        let left_out = resolve.pixel((x as u32, y as u32), listed.len(), fragment, behind, write);
        self.found.fragments += entries.len() as u64;
        self.found.dropped += (entries.len() - listed.len()) as u64;
        self.found.left_out += u64::from(left_out);
        self.found.deepest = self.found.deepest.max(entries.len() as u32);
        if let Some(counts) = &mut self.counts {
            counts.set(x, y, 0, entries.len() as i32);
        }
        if let Some(target) = &mut self.behind {
            (0..resolve.samples as usize).for_each(|s| target.set(x, y, s, behind(s)));
        }
    }
}
