//! Per-pixel fragment lists in compressed-row form: pixel p owns entries `offsets[p]..offsets[p + 1]`,
//! sorted front to back.

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::methods::exact;
use crate::real::Real;

/// Fragment lists of an image, `offsets` one longer than the pixels, the rest one entry a fragment.
#[derive(Debug, Default)]
pub struct Fragments<T: Real> {
    pub offsets: Vec<i64>,
    pub depth: Vec<T>,
    pub key: Vec<T::Key>,
    pub color: Vec<[T; 4]>,
    pub primitive: Vec<i32>,
}

impl<T: Real> Fragments<T> {
    /// Empty lists with room for these counts a pixel. `None` where the memory cannot be had.
    pub fn with_counts(counts: &[i32]) -> Option<Self> {
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
        })
    }
}

fn filled<V: Clone>(n: usize, value: V) -> Option<Vec<V>> {
    let mut v = Vec::new();
    v.try_reserve_exact(n).ok()?;
    v.resize(n, value);
    Some(v)
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

/// Composites lists in float64 with method `exact`, premultiplied. `color` is straight, front to back.
pub fn composite<C: Real>(
    offsets: &[i64],
    color: &[[C; 4]],
    background: Background<'_, f64>,
) -> Result<Vec<[f64; 4]>> {
    let pixels = offsets.len().saturating_sub(1);
    let sound = offsets.first() == Some(&0)
        && offsets.last() == Some(&(color.len() as i64))
        && offsets.windows(2).all(|w| w[0] <= w[1]);
    if !sound {
        return Err(Error::Scene(format!(
            "offsets must rise from 0 to the number of fragments, {}",
            color.len()
        )));
    }
    Ok((0..pixels)
        .into_par_iter()
        .map(|pixel| {
            let mut state = exact::State::<f64>::begin();
            for c in &color[offsets[pixel] as usize..offsets[pixel + 1] as usize] {
                state.insert(c.map(C::to_f64));
            }
            state.end(background.at(pixel))
        })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn composite_refuses_offsets_that_do_not_fit_the_fragments() {
        let color = [[0.5_f32; 4]];
        let black = Background::Constant([0.0; 4]);
        for offsets in [vec![], vec![0, 2], vec![1, 1], vec![0, 2, 1]] {
            assert!(composite(&offsets, &color, black).is_err(), "{offsets:?}");
        }
        let image = composite(&[0, 1, 1], &color, Background::Constant([1.0; 4])).unwrap();
        assert_eq!(image, [[0.75, 0.75, 0.75, 1.0], [1.0; 4]]);
    }
}
