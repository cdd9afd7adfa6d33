//! The quick way through a tile, for float32 with one sample a pixel and nothing but `over`: lists are kept layer by
//! layer, so that neighbouring pixels are neighbours in memory, and are sorted and composited several at a time.
//!
//! Emission writes the k-th fragment of pixel p, in submission order, to entry k of p, eight pixels at a time and
//! without a branch: pixels that are not covered are written to, but keep their count. A list may have so many
//! entries as there are layers. Deeper tiles, and whatever else is special, go the general way (`tile.rs`),
//! which gives the same bits.
//!
//! All loops run over arrays of fixed length, which become vector instructions of whatever instructions there are.
//! They are compiled twice, for any processor and for AVX2; no operation is contracted or reordered, so
//! that both give the same bits.

mod colors;
mod emit;
mod network;
mod shade;
#[cfg(test)]
mod tests;

use super::region::{Region, TILE};
use super::setup::{FLAT, Record};
use super::target::{ImageTarget, Rules};
use super::tile::Walk;
use crate::cpu::entry::Listed;
#[cfg(target_arch = "x86_64")]
use crate::cpu::lanes::Avx2;
use crate::cpu::lanes::{Instructions, Lanes, Plain};
use crate::fragments::Background;
use crate::frame::{BlendOrder, Sort};
use colors::Shades;
use emit::{Append, Hide, InFront, Opaque};
use network::QUAD;

/// Pixels of a tile, and entries of a layer.
const PIXELS: usize = (TILE * TILE) as usize;
/// Sorts behind all entries; its lower half, the rank, names the shade of nothing.
const NOTHING: i64 = (i32::MAX as i64) << 32;
/// The most layers that a tile is given.
const MOST_LAYERS: usize = 256;
/// What it is given first. Doubled as needed, so that networks of up to 8 and 16 entries find as many.
const FIRST_LAYERS: usize = 4;
/// What memory must allow for.
const LEAST_LAYERS: usize = 2 * network::LONGEST;
/// Records that are emitted between two looks at how deep the tile has become, at most, and at least.
const LOOK_EVERY: usize = 64;
const LOOK_AFTER: usize = 8;

#[derive(Debug)]
struct Places([u32; PIXELS]);
impl Default for Places {
    fn default() -> Self {
        Self(std::array::from_fn(|p| p as u32))
    }
}

/// A thread's buffers for one tile.
#[derive(Debug, Default)]
pub struct Layers {
    /// Sort key and rank in one integer, smaller in front. Entry k of pixel p lies at k · `PIXELS` + p.
    entries: Vec<i64>,
    /// Where each pixel's next entry goes.
    next: Places,
    /// What hides, in tiles where something does.
    opaque: Option<Box<Opaque>>,
    hides: bool,
    /// What each rank of the tile looks like. The last record has rank 0, since later triangles win ties.
    shades: Shades,
    /// One pixel's list, where it is longer than networks are.
    list: Vec<[i64; 4]>,
    /// Copies of the next few records.
    records: Vec<Record<f32>>,
}

impl Layers {
    pub fn bytes(&self) -> u64 {
        (self.entries.capacity() * size_of::<i64>()
            + size_of::<Self>()
            + self.opaque.as_ref().map_or(0, |_| size_of::<Opaque>())
            + self.list.capacity() * size_of::<[i64; 4]>()
            + self.records.capacity() * size_of::<Record<f32>>()) as u64
            + self.shades.bytes()
    }

    fn clear(&mut self) {
        self.next = Places::default();
        self.hides = false;
    }

    /// Makes room for `wanted` more records or so, each of which adds at most one to each list. Returns for how many
    /// there is: 0 if `limit` layers do not hold that.
    fn make_room(&mut self, wanted: usize, limit: usize) -> usize {
        let deepest = self.deepest();
        // One layer is where pixels with full lists are written to.
        let mut layers = self.entries.len() / PIXELS;
        if layers < limit && layers < deepest + 1 + wanted {
            layers = (2 * layers).clamp(FIRST_LAYERS, limit);
            self.entries.resize(layers * PIXELS, NOTHING);
        }
        layers.saturating_sub(deepest + 1)
    }

    /// Puts what hides at the end of the lists: composited last, an alpha of 1 lets nothing through.
    fn append_opaque(&mut self) {
        let Some(opaque) = self.opaque.as_ref().filter(|_| self.hides) else { return };
        for (pixel, next) in self.next.0.iter_mut().enumerate() {
            if let Some(entry) = opaque.entry(pixel) {
                self.entries[*next as usize] = entry;
                *next += PIXELS as u32;
            }
        }
    }

    /// Fragments of the deepest pixel.
    fn deepest(&self) -> usize {
        self.next.0.iter().max().map_or(0, |&next| next as usize / PIXELS)
    }
}

/// What the quick way needs to know of a render.
pub struct Quick<'a> {
    walk: &'a Walk<'a, f32>,
    background: Background<'a, f32>,
    instructions: Instructions,
    layers: usize,
    least_transmittance: f32,
}

impl<'a> Quick<'a> {
    /// `None` for a render that asks for something that only the general way does.
    pub fn of(walk: &'a Walk<f32>, rules: &Rules, background: Background<'a, f32>) -> Option<Self> {
        let plain = rules.resolve.method.is_exact()
            && walk.pattern.len() == 1
            && walk.sort == Sort::Auto
            && !walk.list_opaque
            && rules.limit.is_none()
            && !rules.resolve.mixes
            && rules.resolve.order == BlendOrder::FrontToBack;
        let layers = (walk.scratch_bytes as usize / (PIXELS * size_of::<i64>())).min(MOST_LAYERS);
        (plain && layers >= LEAST_LAYERS).then_some(Self {
            walk,
            background,
            instructions: walk.instructions,
            layers,
            least_transmittance: rules.resolve.least_transmittance as f32,
        })
    }

    /// Resolves a tile. `false`, with nothing written, if it is one for the general way.
    pub fn resolve<L: Listed<f32>>(
        &self,
        records: &[u32],
        region: Region,
        layers: &mut Layers,
        target: &mut ImageTarget<'_, '_, f32, L>,
    ) -> bool {
        match self.instructions {
            Instructions::Any => self.resolve_with(Plain, records, region, layers, target),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `detected` has found AVX2 on this processor.
            Instructions::Avx2 => unsafe { self.resolve_with_avx2(records, region, layers, target) },
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn resolve_with_avx2<L: Listed<f32>>(
        &self,
        records: &[u32],
        region: Region,
        layers: &mut Layers,
        target: &mut ImageTarget<'_, '_, f32, L>,
    ) -> bool {
        // SAFETY: this function is called where there is AVX2.
        let v = unsafe { Avx2::new() };
        self.resolve_with(v, records, region, layers, target)
    }

    // Always inlined, so that it is compiled for the caller's instructions. So is all that it calls in loops.
    #[inline(always)]
    fn resolve_with<V: Lanes, L: Listed<f32>>(
        &self,
        v: V,
        records: &[u32],
        region: Region,
        layers: &mut Layers,
        target: &mut ImageTarget<'_, '_, f32, L>,
    ) -> bool {
        if target.wants_behind() {
            return false;
        }
        if records.is_empty() {
            shade::nothing(self, region, target);
            return true;
        }
        if !self.emit(v, records, region, layers) {
            return false;
        }
        for j in 0..region.h as usize {
            let row = &layers.next.0[j * TILE as usize..][..region.w as usize];
            target.count(region.y0 + j as i32, row, PIXELS as u32);
        }
        layers.append_opaque();
        shade::resolve(v, self, region, layers, target);
        true
    }

    /// The colours behind pixels from (x, y) to the right.
    #[inline(always)]
    fn background_of(&self, x: i32, y: i32, n: usize) -> [[f32; 4]; QUAD] {
        match self.background {
            Background::Constant(color) => [color; QUAD],
            Background::Image(image) => {
                let first = y as usize * self.walk.width as usize + x as usize;
                std::array::from_fn(|l| image[first + l.min(n - 1)])
            }
        }
    }

    /// Finds what hides. `false` if that depends on more than coverage.
    #[inline(always)]
    fn hide(&self, v: impl Lanes, records: &[u32], region: Region, layers: &mut Layers) -> bool {
        let opaque = layers.opaque.get_or_insert_with(|| Box::new(Opaque::none()));
        **opaque = Opaque::none();
        layers.hides = true;
        for (i, &index) in records.iter().enumerate() {
            let record = &self.walk.setup.records[index as usize];
            let rank = 2 * records.len() - 1 - i; // behind translucent ones of equal depth
            let mesh = &self.walk.meshes[record.mesh as usize];
            let cutoff = mesh.alpha_cutoff as f32;
            if !mesh.opaque || (cutoff != 0.0 && record.gradient == FLAT && record.color[3] < cutoff) {
                continue;
            }
            if cutoff != 0.0 && record.gradient != FLAT {
                return false;
            }
            layers.shades.set(rank, record, &self.walk.setup.gradients);
            layers.shades.set_opaque(rank);
            let hide = Hide(opaque, rank as u32);
            if self.walk.setup.perspective {
                emit::emit::<_, true>(v, record, region, hide);
            } else {
                emit::emit::<_, false>(v, record, region, hide);
            }
        }
        true
    }

    /// Fills the layers. `false` if there are too few, or if a triangle was cut.
    #[inline(always)]
    fn emit(&self, v: impl Lanes, records: &[u32], region: Region, layers: &mut Layers) -> bool {
        let record = |index: u32| &self.walk.setup.records[index as usize];
        if self.walk.setup.has_pieces
            && records.windows(2).any(|pair| record(pair[0]).primitive == record(pair[1]).primitive)
        {
            return false; // their masks are one fragment's
        }
        layers.clear();
        let gradients = self.walk.setup.gradients.as_slice();
        let has_gradients =
            !gradients.is_empty() && records.iter().any(|&index| record(index).gradient != FLAT);
        let is_opaque = |record: &Record<f32>| self.walk.meshes[record.mesh as usize].opaque;
        let hides = self.walk.hides && records.iter().any(|&index| is_opaque(record(index)));
        layers.shades.begin(records.len() * if hides { 2 } else { 1 }, has_gradients);
        if hides && !self.hide(v, records, region, layers) {
            return false;
        }
        let mut rest = records;
        while !rest.is_empty() {
            let room = layers.make_room(rest.len().min(LOOK_AFTER), self.layers);
            if room == 0 {
                return false;
            }
            let (now, later) = rest.split_at(rest.len().min(room).min(LOOK_EVERY));
            // Records lie far apart: copied together, they are waited for together.
            layers.records.clear();
            layers.records.extend(now.iter().map(|&index| *record(index)));
            let Layers { entries, next, shades, records, opaque, hides, .. } = layers;
            let hidden = opaque.as_ref().filter(|_| *hides).map(|opaque| &opaque.keys);
            for (i, record) in records.iter().enumerate() {
                if hidden.is_some() && is_opaque(record) {
                    continue;
                }
                let rank = rest.len() - 1 - i;
                shades.set(rank, record, gradients);
                // SAFETY: there is room for `room` more entries of each list, each record adds at most one, and
                // one layer is left over.
                let append = unsafe { Append::new(v, entries, &mut next.0, rank as u32) };
                match (hidden, self.walk.setup.perspective) {
                    (None, false) => emit::emit::<_, false>(v, record, region, append),
                    (None, true) => emit::emit::<_, true>(v, record, region, append),
                    (Some(keys), false) => emit::emit::<_, false>(v, record, region, InFront(keys, append)),
                    (Some(keys), true) => emit::emit::<_, true>(v, record, region, InFront(keys, append)),
                }
            }
            rest = later;
        }
        !layers.hides || layers.make_room(1, self.layers) > 0
    }
}
