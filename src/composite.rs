//! Compositing captured lists, apart from any pipeline.

use rayon::prelude::*;

use crate::blend::MODES;
use crate::error::{Error, Result};
use crate::fragments::Background;
use crate::frame::MsaaResolve;
use crate::memory::allocate;
use crate::real::Real;
use crate::resolve::{Fragment, Resolve};
use crate::threads::threads;

/// Captured lists, as a user may give them.
#[derive(Debug, Clone, Copy)]
pub struct Lists<'a, C> {
    pub offsets: &'a [i64],
    /// Straight, front to back.
    pub color: &'a [[C; 4]],
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
        if self.coverage.is_some_and(|c| c.len() != n) || self.blend.is_some_and(|b| b.len() != n) {
            return Err(Error::Scene(format!("coverage and blend must have one entry a fragment, {n}")));
        }
        if let Some(&mode) = self.blend.and_then(|b| b.iter().find(|&&mode| mode as usize >= MODES.len())) {
            return Err(Error::Scene(format!("blend holds {mode}, which is none of {MODES:?}")));
        }
        Ok(())
    }

    fn fragment(&self, i: usize) -> Fragment<f64> {
        Fragment {
            color: self.color[i].map(C::to_f64),
            mode: self.blend.map_or(0, |b| b[i]),
            coverage: self.coverage.map_or(u32::MAX, |c| c[i]),
        }
    }
}

/// Composites lists in float64, premultiplied. `background`: one colour, or one a sample of each pixel. Returns
/// a colour a pixel, or a sample where `resolve` asks for those.
pub fn composite<C: Real>(
    lists: Lists<C>,
    resolve: Resolve,
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
        image.par_chunks_mut(each).enumerate().for_each(|(pixel, colors)| {
            let (first, end) = (lists.offsets[pixel] as usize, lists.offsets[pixel + 1] as usize);
            let fragment = |i| lists.fragment(first + i);
            let behind = |s| background.at(pixel * samples + s);
            resolve.pixel(end - first, fragment, behind, |s, rgba| colors[s] = rgba);
        });
    });
    Ok(image)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::BlendOrder;

    const RESOLVE: Resolve = Resolve {
        samples: 1,
        msaa: MsaaResolve::PerPixel,
        mixes: false,
        order: BlendOrder::FrontToBack,
        least_transmittance: 0.0,
    };

    fn lists<'a>(offsets: &'a [i64], color: &'a [[f32; 4]]) -> Lists<'a, f32> {
        Lists { offsets, color, coverage: None, blend: None }
    }

    #[test]
    fn composite_refuses_offsets_that_do_not_fit_the_fragments() {
        let color = [[0.5_f32; 4]];
        let black = Background::Constant([0.0; 4]);
        for offsets in [vec![], vec![0, 2], vec![1, 1], vec![0, 2, 1]] {
            assert!(composite(lists(&offsets, &color), RESOLVE, black).is_err(), "{offsets:?}");
        }
        let image = composite(lists(&[0, 1, 1], &color), RESOLVE, Background::Constant([1.0; 4])).unwrap();
        assert_eq!(image, [[0.75, 0.75, 0.75, 1.0], [1.0; 4]]);
    }

    #[test]
    fn composite_refuses_modes_that_there_are_not() {
        let mut bad = lists(&[0, 1], &[[0.5; 4]]);
        bad.blend = Some(&[5]);
        assert!(composite(bad, RESOLVE, Background::Constant([0.0; 4])).is_err());
    }
}
