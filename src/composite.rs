//! Compositing captured lists, apart from any pipeline.

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::fragments::Background;
use crate::methods::exact;
use crate::real::Real;
use crate::threads::threads;

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
    let all = || {
        (0..pixels)
            .into_par_iter()
            .map(|pixel| {
                let mut state = exact::State::<f64>::begin();
                for c in &color[offsets[pixel] as usize..offsets[pixel + 1] as usize] {
                    state.insert(c.map(C::to_f64));
                }
                state.end(background.at(pixel))
            })
            .collect()
    };
    Ok(threads()?.install(all))
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
