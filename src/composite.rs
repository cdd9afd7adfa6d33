//! Compositing captured lists, apart from any pipeline.

use rayon::prelude::*;

use crate::blend::{MODES, OVER};
use crate::error::{Error, Result};
use crate::fragments::Background;
use crate::frame::MsaaResolve;
use crate::memory::allocate;
use crate::methods::{self, Order};
use crate::real::Real;
use crate::resolve::{Fragment, Resolve};
use crate::threads::threads;

/// Captured lists, as a user may give them.
#[derive(Debug, Clone, Copy)]
pub struct Lists<'a, C> {
    pub offsets: &'a [i64],
    /// Straight, front to back.
    pub color: &'a [[C; 4]],
    pub depth: &'a [f64],
    /// In the order of submission.
    pub primitive: &'a [i32],
    pub coverage: Option<&'a [u32]>,
    pub blend: Option<&'a [u8]>,
}

impl<C: Real> Lists<'_, C> {
    fn check(&self) -> Result<()> {
        let n = self.color.len();
        let rise = self.offsets.first() == Some(&0)
            && self.offsets.last() == Some(&(n as i64))
            && self.offsets.windows(2).all(|w| w[0] <= w[1]);
        if !rise {
            return Err(Error::Scene(format!("offsets must rise from 0 to the number of fragments, {n}")));
        }
        if self.depth.len() != n || self.primitive.len() != n {
            return Err(Error::Scene(format!("depth and primitive must have one entry a fragment, {n}")));
        }
        if self.coverage.is_some_and(|c| c.len() != n) || self.blend.is_some_and(|b| b.len() != n) {
            return Err(Error::Scene(format!("coverage and blend must have one entry a fragment, {n}")));
        }
        if let Some(&mode) = self.blend.and_then(|b| b.iter().find(|&&mode| mode as usize >= MODES.len())) {
            return Err(Error::Scene(format!("blend holds {mode}, which is none of {MODES:?}")));
        }
        Ok(())
    }

    fn fragment(&self, i: usize, place: u32) -> Fragment<f64> {
        let own = methods::Fragment {
            color: self.color[i].map(C::to_f64),
            depth: self.depth[i],
            // Lists are sorted.
            order: f64::entry(0, place),
            primitive: self.primitive[i] as u32,
            mode: self.blend.map_or(OVER, |b| b[i]),
        };
        Fragment { own, coverage: self.coverage.map_or(u32::MAX, |c| c[i]) }
    }
}

/// Where lists lie in an image.
#[derive(Debug, Clone, Copy)]
pub struct Window {
    pub x0: u32,
    pub y0: u32,
    pub width: u32,
}

/// Composites lists in float64, premultiplied. `background`: one colour, or one a sample of each pixel. Returns
/// a colour a pixel, or a sample where `resolve` asks for those.
pub fn composite<C: Real>(
    lists: Lists<C>,
    window: Window,
    resolve: &Resolve,
    background: Background<'_, f64>,
) -> Result<Vec<[f64; 4]>> {
    lists.check()?;
    let pixels = lists.offsets.len() - 1;
    let samples = resolve.samples as usize;
    if let Background::Image(image) = background
        && image.len() != pixels * samples
    {
        return Err(Error::Scene(format!(
            "background has {} colours where {} are needed",
            image.len(),
            pixels * samples
        )));
    }
    let each = if resolve.msaa == MsaaResolve::None { samples } else { 1 };
    let mut image = allocate("the image", pixels * each, [f64::NAN; 4])?;
    threads()?.install(|| {
        image.par_chunks_mut(each).enumerate().for_each_init(Vec::new, |order, (pixel, colors)| {
            let (first, end) = (lists.offsets[pixel] as usize, lists.offsets[pixel + 1] as usize);
            order.clear();
            order.extend(0..(end - first) as u32);
            if resolve.takes() == Order::Submission {
                order.sort_by_key(|&place| lists.primitive[first + place as usize]);
            }
            let fragment = |i: usize| lists.fragment(first + order[i] as usize, order[i]);
            let behind = |s| background.at(pixel * samples + s);
            let (x, y) = (pixel as u32 % window.width, pixel as u32 / window.width);
            let at = (window.x0 + x, window.y0 + y);
            resolve.pixel(at, end - first, fragment, behind, |s, rgba| colors[s] = rgba);
        });
    });
    Ok(image)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::BlendOrder;
    use crate::methods::Method;

    const WINDOW: Window = Window { x0: 0, y0: 0, width: 1 };

    const RESOLVE: &Resolve = &Resolve {
        method: Method::Exact,
        samples: 1,
        msaa: MsaaResolve::PerPixel,
        mixes: false,
        order: BlendOrder::FrontToBack,
        least_transmittance: 0.0,
    };

    fn lists<'a>(offsets: &'a [i64], color: &'a [[f32; 4]]) -> Lists<'a, f32> {
        Lists { offsets, color, depth: &[1.0], primitive: &[0], coverage: None, blend: None }
    }

    #[test]
    fn composite_refuses_offsets_that_do_not_fit_the_fragments() {
        let color = [[0.5_f32; 4]];
        let black = Background::Constant([0.0; 4]);
        for offsets in [vec![], vec![0, 2], vec![1, 1], vec![0, 2, 1]] {
            assert!(composite(lists(&offsets, &color), WINDOW, RESOLVE, black).is_err(), "{offsets:?}");
        }
        let image =
            composite(lists(&[0, 1, 1], &color), WINDOW, RESOLVE, Background::Constant([1.0; 4])).unwrap();
        assert_eq!(image, [[0.75, 0.75, 0.75, 1.0], [1.0; 4]]);
    }

    #[test]
    fn composite_refuses_modes_that_there_are_not() {
        let mut bad = lists(&[0, 1], &[[0.5; 4]]);
        bad.blend = Some(&[5]);
        assert!(composite(bad, WINDOW, RESOLVE, Background::Constant([0.0; 4])).is_err());
    }
}
