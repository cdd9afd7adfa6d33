//! Depth and colour at any pixel of a triangle.
//!
//! They come from the *unsnapped*, unclipped triangle: a plane anchored at a vertex and built from
//! differences, clamped to the range of the vertices. (For 20-pixel triangles in float32, the 99th percentile
//! of the relative depth error is below 1e-5 this way, 8e-5 with a plane anchored at the image's corner and
//! 5e-4 with the snapped vertices.) Under a perspective the planes hold 1/w and colour/w (Heckbert and Moreton
//! 1991).

use crate::clip::Vertex;
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
    /// What a sort key is made of: to the bit the same everywhere.
    #[inline]
    pub fn at(&self, dx: T, dy: T) -> T {
        (self.value + self.gx * dx + self.gy * dy).clamped(self.low, self.high)
    }

    /// A channel of the colour, over w under a perspective. To be clamped.
    #[inline]
    pub fn color(&self, dx: T, dy: T) -> T {
        self.gy.times_plus(dy, self.gx.times_plus(dx, self.value))
    }
}

/// The planes of a triangle.
pub struct Frame<T> {
    pub anchor: [T; 2],
    pub key: Plane<T>,
    /// `None` if all corners have one colour.
    pub colors: Option<[Plane<T>; 4]>,
}

impl<T: Real> Frame<T> {
    /// An attribute c over w is m · (X, Y, 1) in NDC, where m solves (x, y, w)ᵢ · m = cᵢ at the three vertices
    /// (Olano and Greer 1997): right for triangles around the eye too. Written in differences from one
    /// vertex, so that small triangles do not cancel; the constant comes from the anchor, which is exact.
    ///
    /// `visible`: what clipping left of the triangle. `None` if a value is not finite.
    pub fn of(
        triangle: &[Vertex<T>; 3],
        visible: &[Vertex<T>],
        perspective: bool,
        view: [T; 2],
    ) -> Option<Self> {
        let [a, b, c] = triangle;
        // A power of two makes the largest coordinate about 1: products of three neither over- nor underflow.
        let largest =
            triangle.iter().fold(T::ZERO, |m, v| m.larger(v.x.abs()).larger(v.y.abs()).larger(v.w.abs()));
        let scale = largest.inverse_binade();
        let scaled = |v: &Vertex<T>| [v.x * scale, v.y * scale, v.w * scale];
        let origin = scaled(a);
        let ab = minus(scaled(b), origin);
        let ac = minus(scaled(c), origin);
        let normal = cross(ab, ac);
        let determinant = origin[0] * normal[0] + origin[1] * normal[1] + origin[2] * normal[2];
        // Seen edge-on: any corner's value is as good as another.
        let inverse = if determinant == T::ZERO { T::ZERO } else { scale / determinant };
        let two = T::from_f64(2.0);
        let to_pixels = [two / view[0] * inverse, -two / view[1] * inverse];
        let across = |v: [T; 3]| [v[0] * to_pixels[0], v[1] * to_pixels[1]];
        let slopes = Slopes {
            constant: across(normal),
            along_b: across(cross(ac, origin)),
            along_c: across(cross(origin, ab)),
        };

        // The corner in front of the eye that lands nearest the middle of the screen.
        let off = |v: &Vertex<T>| v.x.abs().larger(v.y.abs()) / v.w;
        let in_front = triangle.iter().filter(|v| v.w > T::ZERO);
        let at = in_front.reduce(|best, v| if off(v) < off(best) { v } else { best })?;
        let anchor = on_screen(at, view);
        let of_key = |v: &Vertex<T>| if perspective { T::ONE / v.w } else { v.depth };
        let low = visible.iter().map(of_key).reduce(T::smaller)?;
        let high = visible.iter().map(of_key).reduce(T::larger)?;
        let attribute = triangle.map(|v| if perspective { T::ONE } else { v.depth });
        let key = slopes.plane(attribute, of_key(at), low, high)?;
        let colors = slopes.color_planes(triangle.map(|v| v.color), at.color, at.w)?;
        Some(Self { anchor, key, colors })
    }
}

/// What gives the slopes of anything that is linear on the triangle, over w.
pub struct Slopes<T> {
    pub constant: [T; 2],
    pub along_b: [T; 2],
    pub along_c: [T; 2],
}

impl<T: Real> Slopes<T> {
    /// The plane that a sort key comes from. `None` if a value is not finite.
    #[inline(always)]
    fn plane(&self, [a, b, c]: [T; 3], value: T, low: T, high: T) -> Option<Plane<T>> {
        let (db, dc) = (b - a, c - a);
        let slope = |i: usize| a * self.constant[i] + db * self.along_b[i] + dc * self.along_c[i];
        finite(value, slope(0), slope(1), low, high)
    }

    /// The plane of a colour channel.
    #[inline(always)]
    fn color_plane(&self, [a, b, c]: [T; 3], value: T, low: T, high: T) -> Option<Plane<T>> {
        let (db, dc) = (b - a, c - a);
        let slope =
            |i: usize| dc.times_plus(self.along_c[i], db.times_plus(self.along_b[i], a * self.constant[i]));
        finite(value, slope(0), slope(1), low, high)
    }

    /// The planes of the corners' colours, `at` and `w` the anchor's; `None` inside if they are one colour.
    #[inline(always)]
    #[allow(clippy::type_complexity)]
    pub fn color_planes(&self, [a, b, c]: [[T; 4]; 3], at: [T; 4], w: T) -> Option<Option<[Plane<T>; 4]>> {
        if a == b && a == c {
            return Some(None);
        }
        let nothing = Plane { value: T::ZERO, gx: T::ZERO, gy: T::ZERO, low: T::ZERO, high: T::ZERO };
        let mut planes = [nothing; 4];
        for (i, channel) in planes.iter_mut().enumerate() {
            let low = a[i].smaller(b[i]).smaller(c[i]);
            let high = a[i].larger(b[i]).larger(c[i]);
            *channel = self.color_plane([a[i], b[i], c[i]], at[i] / w, low, high)?;
        }
        Some(Some(planes))
    }
}

#[inline(always)]
fn finite<T: Real>(value: T, gx: T, gy: T, low: T, high: T) -> Option<Plane<T>> {
    (value + gx + gy).is_finite().then_some(Plane { value, gx, gy, low, high })
}

/// Pixels, y down. `view`: width and height.
pub fn on_screen<T: Real>(v: &Vertex<T>, view: [T; 2]) -> [T; 2] {
    let half = T::from_f64(0.5);
    [(v.x / v.w * half + half) * view[0], (half - v.y / v.w * half) * view[1]]
}

fn minus<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn cross<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
