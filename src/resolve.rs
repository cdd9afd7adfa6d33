//! Resolve: one pixel's sorted fragments become its colour, or one colour a sample (GPU Pro 2, sections 2.6.4,
//! 2.7.2 and 2.8.3). Where fragments come from, a pipeline or captured lists, is the caller's business.

use crate::blend::{Affine, MODES, premultiplied};
use crate::frame::{BlendOrder, MsaaResolve, Request, Stats};
use crate::methods::{self, Method, Order, Place, exact};
use crate::real::Real;
use crate::samples::MAX_SAMPLES;
use crate::scene::Scene;

/// What a resolve sees of a fragment.
#[derive(Debug, Clone, Copy)]
pub struct Fragment<T: Real> {
    pub own: methods::Fragment<T>,
    /// Bit s: sample s is covered.
    pub coverage: u32,
}

/// How fragments become colours.
#[derive(Debug, Clone)]
pub struct Resolve {
    pub method: Method,
    pub samples: u32,
    pub msaa: MsaaResolve,
    /// Some fragment is blended otherwise than `over`.
    pub mixes: bool,
    pub order: BlendOrder,
    /// As in `Request`.
    pub least_transmittance: f64,
}

/// One sample's colour on its way, in one direction through the list.
trait Blender<T: Real>: Copy {
    const BACK_TO_FRONT: bool;
    fn begin(behind: [T; 4]) -> Self;
    fn add(&mut self, fragment: &Fragment<T>);
    /// Nothing that follows can change the result, or by no more than was asked for: `least` is let through at most.
    fn is_done(&self, least: T) -> bool;
    fn end(self, behind: [T; 4]) -> [T; 4];
}

impl<T: Real> Blender<T> for exact::State<T> {
    const BACK_TO_FRONT: bool = false;
    #[inline]
    fn begin(_: [T; 4]) -> Self {
        Self::begin()
    }
    #[inline]
    fn add(&mut self, fragment: &Fragment<T>) {
        self.insert(fragment.own.color);
    }
    #[inline]
    fn is_done(&self, least: T) -> bool {
        self.is_saturated(least)
    }
    #[inline]
    fn end(self, behind: [T; 4]) -> [T; 4] {
        self.end(behind)
    }
}

impl<T: Real> Blender<T> for Affine<T> {
    const BACK_TO_FRONT: bool = false;
    fn begin(_: [T; 4]) -> Self {
        Self::identity()
    }
    fn add(&mut self, fragment: &Fragment<T>) {
        *self = self.onto(Self::of(fragment.own.mode, fragment.own.color));
    }
    fn is_done(&self, _: T) -> bool {
        self.is_saturated() // additive adds without end: no transmittance but 0 bounds what is to come
    }
    fn end(self, behind: [T; 4]) -> [T; 4] {
        self.over(behind)
    }
}

/// The premultiplied colour behind what is still to come.
#[derive(Clone, Copy)]
struct Destination<T>([T; 4]);

impl<T: Real> Blender<T> for Destination<T> {
    const BACK_TO_FRONT: bool = true;
    fn begin(behind: [T; 4]) -> Self {
        Self(premultiplied(behind))
    }
    fn add(&mut self, fragment: &Fragment<T>) {
        self.0 = Affine::of(fragment.own.mode, fragment.own.color).of_destination(self.0);
    }
    fn is_done(&self, _: T) -> bool {
        false
    }
    fn end(self, _: [T; 4]) -> [T; 4] {
        self.0
    }
}

impl Resolve {
    pub fn of(request: &Request, scene: &Scene) -> Self {
        Self {
            method: request.method.clone(),
            samples: request.samples,
            msaa: request.msaa_resolve,
            mixes: scene.mixes_modes(),
            order: request.blend_order,
            least_transmittance: request.least_transmittance,
        }
    }

    /// Notes what is blended, and in which direction.
    pub fn describe(&self, scene: &Scene, ids: &str, stats: &mut Stats) {
        let used = |id: u8| scene.meshes.iter().any(|m| !m.opaque && m.blend == id && m.face_count() > 0);
        let mut modes: Vec<_> = (0..).zip(MODES).filter(|(id, _)| used(*id)).map(|(_, name)| name).collect();
        let has_own = scene.meshes.iter().any(|m| m.blend as usize >= MODES.len());
        if has_own {
            modes.push("your own");
        }
        let modes = if self.mixes { modes.join(", ") } else { "all over".into() };
        stats.choose("blend", modes, ids);
        let (direction, why) = match (has_own, self.order) {
            (true, _) => ("back to front", "a blend of your own is no affine map"),
            (false, BlendOrder::BackToFront) => ("back to front", "as asked"),
            (false, BlendOrder::FrontToBack) => {
                ("front to back", "every mode is an affine map, and a pixel may stop early")
            }
        };
        stats.choose("direction", direction, why);
    }

    /// The order that `pixel` takes fragments in.
    pub fn takes(&self) -> Order {
        self.method.order()
    }

    /// Resolves `n` fragments, in the order that is asked for, over the straight colour `behind` each sample. Calls
    /// `write` with the premultiplied colour of the pixel at (x, y), or of each of its samples where those are asked
    /// for. Returns how many of them a bounded method merged or dropped: of several samples, the one with most.
    #[inline]
    pub fn pixel<T: Real>(
        &self,
        (x, y): (u32, u32),
        n: usize,
        fragment: impl Fn(usize) -> Fragment<T>,
        behind: impl Fn(usize) -> [T; 4],
        write: impl FnMut(usize, [T; 4]),
    ) -> u32 {
        if self.method.is_exact() {
            match (self.order, self.mixes) {
                (BlendOrder::BackToFront, _) => self.run::<T, Destination<T>>(n, fragment, behind, write),
                (BlendOrder::FrontToBack, true) => self.run::<T, Affine<T>>(n, fragment, behind, write),
                (BlendOrder::FrontToBack, false) => {
                    self.run::<T, exact::State<T>>(n, fragment, behind, write)
                }
            }
            return 0;
        }
        let mut most = 0;
        let mut colors = [[T::ZERO; 4]; MAX_SAMPLES];
        let samples = self.samples as usize;
        for (sample, color) in colors[..samples].iter_mut().enumerate() {
            let covering = (0..n).map(&fragment).filter(|f| f.coverage >> sample & 1 == 1).map(|f| f.own);
            let place = Place { x, y, sample: sample as u32 };
            if let Some((own, left_out)) = self.method.streamed(place, covering, behind(sample)) {
                *color = own;
                most = most.max(left_out);
            }
        }
        self.write_samples(&colors[..samples], write);
        most
    }

    fn write_samples<T: Real>(&self, colors: &[[T; 4]], mut write: impl FnMut(usize, [T; 4])) {
        match (self.msaa, colors) {
            (MsaaResolve::None, _) => colors.iter().enumerate().for_each(|(s, color)| write(s, *color)),
            (_, [one]) => write(0, *one),
            (MsaaResolve::Hdr, _) => write(0, weighted_mean(colors, hdr_weight)),
            (MsaaResolve::PerSample | MsaaResolve::PerPixel, _) => {
                write(0, weighted_mean(colors, |_| T::ONE))
            }
        }
    }

    #[inline]
    fn run<T: Real, B: Blender<T>>(
        &self,
        n: usize,
        fragment: impl Fn(usize) -> Fragment<T>,
        behind: impl Fn(usize) -> [T; 4],
        mut write: impl FnMut(usize, [T; 4]),
    ) {
        let samples = self.samples as usize;
        let least = T::from_f64(self.least_transmittance);
        if samples == 1 {
            return write(0, one::<T, B>(n, |i| Some(fragment(i)), behind(0), least));
        }
        let mut colors = [[T::ZERO; 4]; MAX_SAMPLES];
        if self.msaa == MsaaResolve::PerSample {
            for (s, color) in colors[..samples].iter_mut().enumerate() {
                let covering = |i| Some(fragment(i)).filter(|f| f.coverage >> s & 1 == 1);
                *color = one::<T, B>(n, covering, behind(s), least);
            }
        } else {
            let mut states: [B; MAX_SAMPLES] =
                std::array::from_fn(|s| B::begin(if s < samples { behind(s) } else { [T::ZERO; 4] }));
            for k in 0..n {
                let f = fragment(if B::BACK_TO_FRONT { n - 1 - k } else { k });
                for (s, state) in states[..samples].iter_mut().enumerate() {
                    if f.coverage >> s & 1 == 1 {
                        state.add(&f);
                    }
                }
                if states[..samples].iter().all(|state| state.is_done(least)) {
                    break;
                }
            }
            for s in 0..samples {
                colors[s] = states[s].end(behind(s));
            }
        }
        self.write_samples(&colors[..samples], write);
    }
}

/// One sample: the fragments that `covering` gives.
#[inline]
fn one<T: Real, B: Blender<T>>(
    n: usize,
    covering: impl Fn(usize) -> Option<Fragment<T>>,
    behind: [T; 4],
    least: T,
) -> [T; 4] {
    let mut state = B::begin(behind);
    for k in 0..n {
        if let Some(f) = covering(if B::BACK_TO_FRONT { n - 1 - k } else { k }) {
            state.add(&f);
            if state.is_done(least) {
                break;
            }
        }
    }
    state.end(behind)
}

/// Bright samples count less, so that one of them does not wash out an edge (section 2.8.3's HDR-correct
/// resolve).
fn hdr_weight<T: Real>([r, g, b, _]: [T; 4]) -> T {
    T::ONE / (T::ONE + r.larger(g).larger(b).larger(T::ZERO))
}

fn weighted_mean<T: Real>(samples: &[[T; 4]], weight: impl Fn([T; 4]) -> T) -> [T; 4] {
    let (mut sum, mut weights) = ([T::ZERO; 4], T::ZERO);
    for &sample in samples {
        let w = weight(sample);
        sum = std::array::from_fn(|i| w.times_plus(sample[i], sum[i]));
        weights = weights + w;
    }
    sum.map(|v| v / weights)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolve(samples: u32, msaa: MsaaResolve) -> Resolve {
        Resolve {
            method: Method::Exact,
            samples,
            msaa,
            mixes: false,
            order: BlendOrder::FrontToBack,
            least_transmittance: 0.0,
        }
    }

    fn fragment(color: [f64; 4], mode: u8, coverage: u32) -> Fragment<f64> {
        let own = methods::Fragment { color, depth: 1.0, order: 0, primitive: 0, mode };
        Fragment { own, coverage }
    }

    fn image(resolve: Resolve, fragments: &[Fragment<f64>]) -> Vec<[f64; 4]> {
        let mut out = Vec::new();
        resolve.pixel((0, 0), fragments.len(), |i| fragments[i], |_| [0.0; 4], |_, rgba| out.push(rgba));
        out
    }

    #[test]
    fn two_halves_of_a_pixel_give_alpha_and_not_alpha_scaled_by_popcount() {
        let half = |coverage| fragment([1.0, 1.0, 1.0, 0.6], 0, coverage);
        let seam = [half(0b0011), half(0b1100)];
        for msaa in [MsaaResolve::PerSample, MsaaResolve::PerPixel] {
            assert!((image(resolve(4, msaa), &seam)[0][3] - 0.6).abs() < 1e-15);
        }
        // The mistake: alpha · popcount / samples, which loses α²/4 at the seam.
        let scaled = [0.3, 0.3].iter().fold(1.0, |t, a| t * (1.0 - a));
        assert!((1.0 - scaled - (0.6 - 0.36 / 4.0_f64)).abs() < 1e-15);
    }

    #[test]
    fn both_resolves_give_the_same_bits_and_samples_average_to_them() {
        let fragments: Vec<_> = (1..12_u32)
            .map(|i| {
                fragment(
                    [0.1 * f64::from(i), 0.5, 0.9 / f64::from(i), 0.3],
                    (i % 5) as u8,
                    i.wrapping_mul(2654435761) >> 7 & 0xff,
                )
            })
            .collect();
        for order in [BlendOrder::FrontToBack, BlendOrder::BackToFront] {
            let of = |msaa| image(Resolve { mixes: true, order, ..resolve(8, msaa) }, &fragments);
            let pixel = of(MsaaResolve::PerPixel);
            assert_eq!(pixel, of(MsaaResolve::PerSample));
            let samples = of(MsaaResolve::None);
            assert_eq!(samples.len(), 8);
            let mean = samples.iter().map(|s| s[0]).sum::<f64>() / 8.0;
            assert!((mean - pixel[0][0]).abs() < 1e-15);
        }
    }

    #[test]
    fn the_hdr_resolve_weighs_bright_samples_less() {
        let bright = fragment([99.0, 0.0, 0.0, 1.0], 0, 0b01);
        let dark = fragment([1.0, 0.0, 0.0, 1.0], 0, 0b10);
        let red = image(resolve(2, MsaaResolve::Hdr), &[bright, dark])[0][0];
        assert!((red - (99.0 / 100.0 + 1.0 / 2.0) / (1.0 / 100.0 + 1.0 / 2.0)).abs() < 1e-12);
    }
}
