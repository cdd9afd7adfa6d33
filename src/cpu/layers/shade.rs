//! Sorted lists become colours: four pixels at a time, front to back.

use std::mem::MaybeUninit;

use super::colors::{Color, OfFlat, OfPlanes};
use super::network::{LONGEST, QUAD, sort, sort_long};
use super::{Layers, NOTHING, PIXELS, Quick};
use crate::cpu::entry::Listed;
use crate::cpu::lanes::Lanes;
use crate::cpu::region::{Region, TILE};
use crate::cpu::target::ImageTarget;
use crate::fragments::Background;
use crate::methods::exact;

/// Layers that are composited between two looks at what they let through, where colours are dear. Others, and lists
/// that networks sort, are composited whole: to look costs more than it saves, and not to stop keeps any bound.
const LOOK_EVERY: usize = 8;

/// Resolves every pixel of the tile.
#[inline(always)]
pub fn resolve<V: Lanes, L: Listed<f32>>(
    v: V,
    quick: &Quick,
    region: Region,
    layers: &mut Layers,
    target: &mut ImageTarget<'_, '_, f32, L>,
) {
    let Layers { entries, next, shades, list, .. } = layers;
    let colors = (shades.flat.as_slice(), shades.planes.as_slice());
    let nothing = NOTHING | shades.nothing as i64;
    let tile = Tile { quick, region, entries, next: &next.0, nothing };
    match (shades.has_gradients, quick.walk.setup.perspective) {
        (false, _) => tile.resolve(v, &OfFlat(colors.0), list, target),
        (true, false) => tile.resolve(v, &OfPlanes::<false>(colors.1), list, target),
        (true, true) => tile.resolve(v, &OfPlanes::<true>(colors.1), list, target),
    }
}

/// Writes the background to every pixel of a tile.
pub fn nothing<L: Listed<f32>>(quick: &Quick, region: Region, target: &mut ImageTarget<'_, '_, f32, L>) {
    let Region { x0, y0, w, h } = region;
    let over = |behind: [f32; 4]| MaybeUninit::new(exact::State::begin().end(behind));
    for y in y0..y0 + h {
        target.count(y, &[0; TILE as usize][..w as usize], 1);
        let row = target.row(x0, y, w as usize);
        match quick.background {
            Background::Constant(color) => row.fill(over(color)),
            Background::Image(image) => {
                let first = y as usize * quick.walk.width as usize + x0 as usize;
                row.iter_mut().zip(&image[first..]).for_each(|(pixel, &behind)| *pixel = over(behind));
            }
        }
    }
}

struct Tile<'a> {
    quick: &'a Quick<'a>,
    region: Region,
    entries: &'a [i64],
    next: &'a [u32; PIXELS],
    /// What is put where a list is shorter than those beside it.
    nothing: i64,
}

impl Tile<'_> {
    #[inline(always)]
    fn resolve<V: Lanes, C: Color, L: Listed<f32>>(
        &self,
        v: V,
        colors: &C,
        list: &mut Vec<[i64; QUAD]>,
        target: &mut ImageTarget<'_, '_, f32, L>,
    ) {
        let (tile, quad) = (TILE as usize, QUAD);
        let Region { x0, y0, w, h } = self.region;
        let least = self.quick.least_transmittance;
        for j in 0..h as usize {
            let (y, counts) = (y0 + j as i32, &self.next[j * tile..(j + 1) * tile]);
            for i in (0..w as usize).step_by(quad) {
                let pixel = j * tile + i;
                let mut lengths = [0; QUAD];
                for l in 0..QUAD {
                    lengths[l] = i64::from(counts[i + l] / PIXELS as u32);
                }
                let most = lengths[0].max(lengths[1]).max(lengths[2].max(lengths[3])) as usize;
                let (x, width) = (x0 + i as i32, quad.min(w as usize - i));
                let behind = self.quick.background_of(x, y, width);
                let mut states = [State::begin(v); QUAD / 2];
                let at = (x as f32 + 0.5, y as f32 + 0.5);
                let lengths = v.longs(lengths);
                macro_rules! short {
                    ($n:literal) => {
                        states = self.short::<V, $n>(v, pixel, lengths, states, colors, at)
                    };
                }
                match most {
                    0 => {}
                    1 => short!(1),
                    2 => short!(2),
                    3 => short!(3),
                    4 => short!(4),
                    5 => short!(5),
                    6 => short!(6),
                    7 => short!(7),
                    8 => short!(8),
                    9 | 10 => short!(10),
                    11 | 12 => short!(12),
                    13..=LONGEST => short!(16),
                    _ => {
                        list.clear();
                        for k in 0..most {
                            list.push(v.long_array(self.layer(v, k, pixel, lengths)));
                        }
                        sort_long(v, list);
                        for (k, &entries) in list.iter().enumerate() {
                            if C::IS_DEAR && k % LOOK_EVERY == 0 && !let_through(v, states, least) {
                                break;
                            }
                            states = blend(v, entries, states, colors, at);
                        }
                    }
                }
                let left = v.split(states[0].over(v, behind[0], behind[1])).map(MaybeUninit::new);
                let right = v.split(states[1].over(v, behind[2], behind[3])).map(MaybeUninit::new);
                let row = target.row(x, y, width);
                match row.first_chunk_mut() {
                    Some([a, b, c, d]) => ([*a, *b], [*c, *d]) = (left, right),
                    // At the right end of the image. A copy of so many, for both, would be a call.
                    None => left.iter().chain(&right).zip(row).for_each(|(rgba, slot)| *slot = *rgba),
                }
            }
        }
    }

    /// Sorts and composites four lists of at most N entries.
    #[cfg_attr(not(debug_assertions), inline(always))] // without optimisation the stack would not hold all of them
    fn short<V: Lanes, const N: usize>(
        &self,
        v: V,
        pixel: usize,
        lengths: V::I64,
        mut states: [State<V>; QUAD / 2],
        colors: &impl Color,
        at: (f32, f32),
    ) -> [State<V>; QUAD / 2] {
        let mut list = [v.longs([self.nothing; QUAD]); N];
        for (k, entries) in list.iter_mut().enumerate() {
            *entries = self.layer(v, k, pixel, lengths);
        }
        sort(v, &mut list);
        for entries in &list {
            states = blend(v, v.long_array(*entries), states, colors, at);
        }
        states
    }

    /// The k-th entries of four pixels whose lists have these lengths.
    #[inline(always)]
    fn layer<V: Lanes>(&self, v: V, k: usize, pixel: usize, lengths: V::I64) -> V::I64 {
        let first = k * PIXELS + pixel;
        let entries = &self.entries[first..first + QUAD];
        let entries = v.longs([entries[0], entries[1], entries[2], entries[3]]);
        v.where_greater(lengths, k as i64, entries, v.longs([self.nothing; QUAD]))
    }
}

/// `methods::exact`, two pixels at a time.
#[derive(Clone, Copy)]
struct State<V: Lanes> {
    /// Premultiplied RGB, then alpha.
    rgba: V::F32,
    transmittance: V::F32,
}

impl<V: Lanes> State<V> {
    #[inline(always)]
    fn begin(v: V) -> Self {
        Self { rgba: v.splat(0.0), transmittance: v.splat(1.0) }
    }

    #[inline(always)]
    fn insert(self, v: V, color: V::F32) -> Self {
        let alpha = v.fourth(color);
        let weight = v.mul(self.transmittance, alpha);
        Self {
            rgba: v.times_plus(weight, v.with_one(color), self.rgba),
            transmittance: v.mul(self.transmittance, v.sub(v.splat(1.0), alpha)),
        }
    }

    #[inline(always)]
    fn over(self, v: V, a: [f32; 4], b: [f32; 4]) -> V::F32 {
        self.insert(v, v.pair(a, b)).rgba
    }
}

/// Whether some pixel lets more through than `least`.
#[inline(always)]
fn let_through<V: Lanes>(v: V, [left, right]: [State<V>; 2], least: f32) -> bool {
    v.any(v.less(v.splat(least), v.max(left.transmittance, right.transmittance)))
}

/// Composites an entry of each of four pixels.
#[inline(always)]
fn blend<V: Lanes>(
    v: V,
    entries: [i64; QUAD],
    [left, right]: [State<V>; 2],
    colors: &impl Color,
    (x, y): (f32, f32),
) -> [State<V>; 2] {
    let [a, b, c, d] = entries;
    [left.insert(v, colors.pair(v, [a, b], x, y)), right.insert(v, colors.pair(v, [c, d], x + 2.0, y))]
}
