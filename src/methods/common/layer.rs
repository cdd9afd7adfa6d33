//! Layers: what several fragments together add to a pixel and what they let through, and the algebra of putting one in
//! front of another.
//!
//! Alpha is accumulated, as A + T α: as 1 − T it would lose every small alpha to cancellation.

use crate::real::Real;

#[derive(Debug, Clone, Copy)]
pub struct Layer<T> {
    /// Premultiplied.
    pub rgba: [T; 4],
    pub transmittance: T,
}

impl<T: Real> Layer<T> {
    #[inline]
    pub fn clear() -> Self {
        Self { rgba: [T::ZERO; 4], transmittance: T::ONE }
    }

    /// One fragment, straight.
    #[inline]
    pub fn of([r, g, b, a]: [T; 4]) -> Self {
        Self { rgba: [a * r, a * g, a * b, a], transmittance: T::ONE - a }
    }

    /// This layer in front of another.
    #[inline]
    pub fn onto(self, back: Self) -> Self {
        let Self { rgba, transmittance } = self;
        Self {
            rgba: std::array::from_fn(|i| transmittance.times_plus(back.rgba[i], rgba[i])),
            transmittance: transmittance * back.transmittance,
        }
    }

    /// Premultiplied, over a straight background.
    #[inline]
    pub fn over(self, [r, g, b, a]: [T; 4]) -> [T; 4] {
        self.onto(Self::of([r, g, b, a])).rgba
    }
}

/// A sum of weighted colours, and last of their weights, with one more.
#[inline]
pub fn add_weighted<T: Real>([x, y, z, w]: [T; 4], weight: T, [r, g, b]: [T; 3]) -> [T; 4] {
    [x + weight * r, y + weight * g, z + weight * b, w + weight]
}

/// Alpha 1 − Π (1 − αᵢ) and transmittance of fragments in whatever order they come.
#[derive(Debug, Clone, Copy)]
pub struct Coverage<T> {
    pub alpha: T,
    pub transmittance: T,
}

impl<T: Real> Coverage<T> {
    pub fn none() -> Self {
        Self { alpha: T::ZERO, transmittance: T::ONE }
    }

    #[inline]
    pub fn add(&mut self, alpha: T) {
        self.alpha = self.transmittance.times_plus(alpha, self.alpha);
        self.transmittance = self.transmittance * (T::ONE - alpha);
    }

    /// A layer of this coverage, of the mean of weighted colours: their sum, and last the sum of their weights. Black
    /// where the weights come to nothing.
    #[inline]
    pub fn of_mean(self, [r, g, b, weight]: [T; 4]) -> Layer<T> {
        let Self { alpha, transmittance } = self;
        let mean = |sum: T| if weight > T::ZERO { sum / weight * alpha } else { T::ZERO };
        Layer { rgba: [mean(r), mean(g), mean(b), alpha], transmittance }
    }
}
