//! Depth and colour at any pixel of a triangle.
//!
//! They come from the *unsnapped* triangle: a plane anchored at a vertex and built from differences, clamped
//! to the range of the vertices. (For 20-pixel triangles in float32, the 99th percentile of the relative
//! depth error is 1e-5 this way, 8e-5 with a plane anchored at the image's corner and 5e-4 with the snapped
//! vertices.) Under a perspective the planes hold 1/w and colour/w (Heckbert and Moreton 1991).

use super::clip::Vertex;
use crate::real::Real;

/// A value that is linear on the screen: at the anchor, per pixel right and down, and its range.
#[derive(Debug, Clone, Copy)]
pub struct Plane<T> {
    pub value: T,
    pub gx: T,
    pub gy: T,
    pub low: T,
    pub high: T,
}

impl<T: Real> Plane<T> {
    #[inline]
    pub fn unclamped(&self, dx: T, dy: T) -> T {
        self.value + self.gx * dx + self.gy * dy
    }

    #[inline]
    pub fn at(&self, dx: T, dy: T) -> T {
        self.unclamped(dx, dy).clamped(self.low, self.high)
    }
}

/// A vertex on the screen: unsnapped pixels, y down, and snapped.
#[derive(Clone, Copy, Default)]
pub struct Corner<T> {
    pub x: T,
    pub y: T,
    pub snapped: (i32, i32),
}

/// The planes of a triangle.
pub struct Frame<T> {
    pub anchor: [T; 2],
    pub key: Plane<T>,
    /// `None` if all corners have one colour.
    pub colors: Option<[Plane<T>; 4]>,
}

impl<T: Real> Frame<T> {
    /// `None` if a value is not finite.
    pub fn of(
        screen: &[Corner<T>],
        corners: &[Vertex<T>],
        perspective: bool,
        parent: &[Vertex<T>; 3],
    ) -> Option<Self> {
        // The largest triangle of the fan defines the planes; an unclipped triangle is its own fan.
        let doubled_area = |i: usize| {
            let (a, b, c) = (&screen[0], &screen[i], &screen[i + 1]);
            (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y)
        };
        let magnitude = |i: usize| doubled_area(i).larger(-doubled_area(i));
        let best =
            (2..screen.len() - 1).fold(1, |best, i| if magnitude(i) > magnitude(best) { i } else { best });
        let (a, b, c) = (&screen[0], &screen[best], &screen[best + 1]);
        let area = doubled_area(best);
        let plane = |v: [T; 3], low: T, high: T| {
            let (db, dc) = (v[1] - v[0], v[2] - v[0]);
            // No area before snapping: any corner's value is as good as another.
            let (gx, gy) = if area == T::ZERO {
                (T::ZERO, T::ZERO)
            } else {
                ((db * (c.y - a.y) - dc * (b.y - a.y)) / area, (dc * (b.x - a.x) - db * (c.x - a.x)) / area)
            };
            (v[0] + gx + gy).is_finite().then_some(Plane { value: v[0], gx, gy, low, high })
        };
        let of_key = |v: &Vertex<T>| if perspective { T::ONE / v.w } else { v.depth };
        let keys = corners.iter().map(of_key);
        let low = keys.clone().fold(of_key(&corners[0]), T::smaller);
        let high = keys.fold(of_key(&corners[0]), T::larger);
        let triple = [&corners[0], &corners[best], &corners[best + 1]];
        let key = plane(triple.map(of_key), low, high)?;

        let [p, q, r] = parent;
        let mut colors = None;
        if p.color != q.color || p.color != r.color {
            let mut planes = [key; 4];
            for (i, channel) in planes.iter_mut().enumerate() {
                let over_w = triple.map(|v| if perspective { v.color[i] / v.w } else { v.color[i] });
                let low = p.color[i].smaller(q.color[i]).smaller(r.color[i]);
                let high = p.color[i].larger(q.color[i]).larger(r.color[i]);
                *channel = plane(over_w, low, high)?;
            }
            colors = Some(planes);
        }
        Some(Self { anchor: [a.x, a.y], key, colors })
    }
}
