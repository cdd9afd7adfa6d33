//! What the ranks of a tile look like: colours of flat triangles, planes of others.

use super::emit::inverse_w;
use crate::cpu::lanes::Lanes;
use crate::cpu::plane::Plane;
use crate::cpu::setup::{FLAT, Record};

/// The colour planes of a triangle, a channel each; without slopes if it is flat.
#[derive(Debug, Clone, Copy, Default)]
pub struct Shade {
    value: [f32; 4],
    gx: [f32; 4],
    gy: [f32; 4],
    low: [f32; 4],
    high: [f32; 4],
    anchor: [f32; 2],
}

/// What the ranks of a tile look like, and behind them what nothing looks like.
#[derive(Debug, Default)]
pub struct Shades {
    /// Straight RGBA, where the tile has no other triangles than flat ones.
    pub flat: Vec<[f32; 4]>,
    /// Else these.
    pub planes: Vec<Shade>,
    pub has_gradients: bool,
    pub nothing: usize,
}

impl Shades {
    pub fn bytes(&self) -> u64 {
        (self.flat.capacity() * size_of::<[f32; 4]>() + self.planes.capacity() * size_of::<Shade>()) as u64
    }

    /// For ranks below `n`.
    pub fn begin(&mut self, n: usize, has_gradients: bool) {
        (self.has_gradients, self.nothing) = (has_gradients, n);
        if has_gradients {
            self.planes.resize(n + 1, Shade::default());
            self.planes[n] = Shade::default();
        } else {
            self.flat.resize(n + 1, [0.0; 4]);
            self.flat[n] = [0.0; 4];
        }
    }

    #[inline(always)]
    pub fn set(&mut self, rank: usize, record: &Record<f32>, gradients: &[[Plane<f32>; 4]]) {
        if !self.has_gradients {
            self.flat[rank] = record.color;
            return;
        }
        let anchor = record.anchor;
        self.planes[rank] = match gradients.get(record.gradient as usize) {
            Some(planes) if record.gradient != FLAT => Shade {
                value: planes.map(|p| p.value),
                gx: planes.map(|p| p.gx),
                gy: planes.map(|p| p.gy),
                low: planes.map(|p| p.low),
                high: planes.map(|p| p.high),
                anchor,
            },
            // Clamped to one colour, whatever the planes give.
            _ => Shade { low: record.color, high: record.color, anchor, ..Shade::default() },
        };
    }
}

impl Shades {
    /// What hides is wholly opaque.
    pub fn set_opaque(&mut self, rank: usize) {
        if self.has_gradients {
            (self.planes[rank].low[3], self.planes[rank].high[3]) = (1.0, 1.0);
        } else {
            self.flat[rank][3] = 1.0;
        }
    }
}

/// Straight RGBA of the entries of two neighbours, the left one's centre at (x, y).
pub trait Color {
    /// It takes longer to make a colour than to look whether it can be seen.
    const IS_DEAR: bool;
    fn pair<V: Lanes>(&self, v: V, entries: [i64; 2], x: f32, y: f32) -> V::F32;
}

pub struct OfFlat<'a>(pub &'a [[f32; 4]]);
impl Color for OfFlat<'_> {
    const IS_DEAR: bool = false;
    #[inline(always)]
    fn pair<V: Lanes>(&self, v: V, [a, b]: [i64; 2], _: f32, _: f32) -> V::F32 {
        v.pair(self.0[a as u32 as usize], self.0[b as u32 as usize])
    }
}

pub struct OfPlanes<'a, const PERSPECTIVE: bool>(pub &'a [Shade]);
impl<const PERSPECTIVE: bool> Color for OfPlanes<'_, PERSPECTIVE> {
    const IS_DEAR: bool = true;
    #[inline(always)]
    fn pair<V: Lanes>(&self, v: V, entries: [i64; 2], x: f32, y: f32) -> V::F32 {
        let [a, b] = [&self.0[entries[0] as u32 as usize], &self.0[entries[1] as u32 as usize]];
        let dx = v.pair([x - a.anchor[0]; 4], [x + 1.0 - b.anchor[0]; 4]);
        let dy = v.pair([y - a.anchor[1]; 4], [y - b.anchor[1]; 4]);
        let across = v.times_plus(v.pair(a.gx, b.gx), dx, v.pair(a.value, b.value));
        let mut value = v.times_plus(v.pair(a.gy, b.gy), dy, across);
        if PERSPECTIVE {
            let inverse = v.pair([inverse_w(entries[0]); 4], [inverse_w(entries[1]); 4]);
            value = v.mul(value, v.div(v.splat(1.0), inverse));
        }
        v.clamped(value, v.pair(a.low, b.low), v.pair(a.high, b.high))
    }
}
