//! Clipping in homogeneous coordinates, before the divide: near and far, and a guard band around the
//! viewport that keeps snapped coordinates inside 2^23 units (Sutherland and Hodgman 1974).
//!
//! A cut is always computed from the kept vertex towards the dropped one, so that two triangles that
//! share an edge get the same bits, whichever way they run along it.

use crate::real::Real;

/// A vertex in clip space with what varies linearly along an edge.
#[derive(Debug, Clone, Copy)]
pub struct Vertex<T> {
    pub x: T,
    pub y: T,
    /// Eye depth under a perspective, 1 otherwise.
    pub w: T,
    pub depth: T,
    pub color: [T; 4],
}

/// What is kept: eye depths from near to far, and |x| and |y| up to `guard` times w.
#[derive(Debug, Clone, Copy)]
pub struct ClipVolume<T> {
    pub near: T,
    pub far: T,
    pub perspective: bool,
    /// 1 for the viewport itself.
    pub guard: T,
}

/// One viewport on each side: NDC from −3 to 3.
pub const GUARD_BAND: f64 = 3.0;
/// Three corners and one more for each of six planes.
pub const MAX_CORNERS: usize = 9;

/// A convex polygon without allocation.
#[derive(Debug, Clone, Copy)]
pub struct Polygon<T> {
    corners: [Vertex<T>; MAX_CORNERS],
    len: usize,
}

impl<T: Real> Polygon<T> {
    fn triangle(v: [Vertex<T>; 3]) -> Self {
        let mut corners = [v[0]; MAX_CORNERS];
        corners[1] = v[1];
        corners[2] = v[2];
        Self { corners, len: 3 }
    }

    pub fn corners(&self) -> &[Vertex<T>] {
        &self.corners[..self.len]
    }

    fn push(&mut self, v: Vertex<T>) {
        self.corners[self.len] = v;
        self.len += 1;
    }
}

#[derive(Clone, Copy)]
enum Plane {
    Near,
    Far,
    Left,
    Right,
    Bottom,
    Top,
}

const PLANES: [Plane; 6] = [Plane::Near, Plane::Far, Plane::Left, Plane::Right, Plane::Bottom, Plane::Top];

impl<T: Real> ClipVolume<T> {
    /// Signed distance to a plane, in its own unit; kept where it is not negative.
    #[inline]
    fn distance(&self, plane: Plane, v: &Vertex<T>) -> T {
        let guard = self.guard * v.w;
        match plane {
            Plane::Near => v.depth - self.near,
            Plane::Far => self.far - v.depth,
            Plane::Left => guard + v.x,
            Plane::Right => guard - v.x,
            Plane::Bottom => guard + v.y,
            Plane::Top => guard - v.y,
        }
    }

    /// No plane cuts the triangle.
    #[inline]
    pub fn contains(&self, v: &[Vertex<T>; 3]) -> bool {
        v.iter().all(|v| PLANES.iter().all(|&p| self.distance(p, v) >= T::ZERO))
    }

    /// The whole triangle is beyond one side of the viewport itself, or of the depth range.
    #[inline]
    pub fn misses(&self, v: &[Vertex<T>; 3]) -> bool {
        v.iter().all(|v| v.x > v.w)
            || v.iter().all(|v| v.x < -v.w)
            || v.iter().all(|v| v.y > v.w)
            || v.iter().all(|v| v.y < -v.w)
            || v.iter().all(|v| v.depth < self.near)
            || v.iter().all(|v| v.depth > self.far)
    }

    /// The part inside, or fewer than three corners where there is none.
    pub fn clip(&self, triangle: [Vertex<T>; 3]) -> Polygon<T> {
        let mut polygon =
            PLANES.iter().fold(Polygon::triangle(triangle), |polygon, &plane| self.cut(&polygon, plane));
        // A cut on one plane may miss another by the rounding of its ends, which next to the eye is more
        // than w itself: without this, snapped coordinates could leave their range.
        for v in &mut polygon.corners[..polygon.len] {
            let guard = self.guard * v.w;
            (v.x, v.y) = (v.x.clamped(-guard, guard), v.y.clamped(-guard, guard));
        }
        polygon
    }

    fn cut(&self, polygon: &Polygon<T>, plane: Plane) -> Polygon<T> {
        let corners = polygon.corners();
        let mut kept = Polygon { len: 0, ..*polygon };
        for (i, a) in corners.iter().enumerate() {
            let b = &corners[(i + 1) % corners.len()];
            let (da, db) = (self.distance(plane, a), self.distance(plane, b));
            if da >= T::ZERO {
                kept.push(*a);
                if db < T::ZERO {
                    kept.push(self.between(plane, a, b, da / (da - db)));
                }
            } else if db >= T::ZERO {
                kept.push(self.between(plane, b, a, db / (db - da)));
            }
        }
        kept
    }

    /// The point a part `t` of the way from the kept vertex to the dropped one, put exactly on the plane:
    /// a rounded one could lie outside it, or at w = 0.
    fn between(&self, plane: Plane, kept: &Vertex<T>, dropped: &Vertex<T>, t: T) -> Vertex<T> {
        let mix = |a: T, b: T| a + t * (b - a);
        let mut v = Vertex {
            x: mix(kept.x, dropped.x),
            y: mix(kept.y, dropped.y),
            w: mix(kept.w, dropped.w),
            depth: mix(kept.depth, dropped.depth),
            color: std::array::from_fn(|i| mix(kept.color[i], dropped.color[i])),
        };
        match plane {
            Plane::Near => v.depth = self.near,
            Plane::Far => v.depth = self.far,
            _ => v.depth = v.depth.larger(self.near).smaller(self.far),
        }
        if self.perspective {
            v.w = v.depth;
        }
        let guard = self.guard * v.w;
        match plane {
            Plane::Left => v.x = -guard,
            Plane::Right => v.x = guard,
            Plane::Bottom => v.y = -guard,
            Plane::Top => v.y = guard,
            Plane::Near | Plane::Far => {}
        }
        v
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vertex(x: f32, y: f32, w: f32) -> Vertex<f32> {
        Vertex { x, y, w, depth: w, color: [x, y, w, 1.0] }
    }

    const VOLUME: ClipVolume<f32> =
        ClipVolume { near: 1.0 / (1u64 << 60) as f32, far: f32::INFINITY, perspective: true, guard: 3.0 };

    #[test]
    fn a_cut_has_the_same_bits_from_both_sides_of_a_shared_edge() {
        let (a, b) = (vertex(0.3, 0.1, 1.0), vertex(0.7, -2.0, -0.9));
        let left = VOLUME.clip([a, b, vertex(-1.0, 0.0, 1.0)]);
        let right = VOLUME.clip([b, a, vertex(2.0, 0.0, 1.0)]);
        let on_edge =
            |p: &Polygon<f32>| p.corners().iter().map(|v| (v.x.to_bits(), v.y.to_bits())).collect::<Vec<_>>();
        let shared = on_edge(&left).iter().filter(|v| on_edge(&right).contains(v)).count();
        assert_eq!(shared, 2, "the kept end and the cut");
    }

    #[test]
    fn every_corner_lies_inside_even_for_triangles_around_the_eye() {
        let polygon = VOLUME.clip([vertex(-5.0, -4.0, 0.5), vertex(6.0, -3.0, 2.0), vertex(0.1, 9.0, -3.0)]);
        assert!(polygon.corners().len() >= 3);
        for v in polygon.corners() {
            let guard = 3.0 * v.w;
            assert!(v.w > 0.0 && v.x.abs() <= guard && v.y.abs() <= guard, "{v:?}");
        }
    }

    #[test]
    fn nothing_is_left_of_a_triangle_behind_the_eye() {
        let behind = [vertex(0.0, 0.0, -1.0), vertex(1.0, 0.0, -2.0), vertex(0.0, 1.0, -1.0)];
        assert!(VOLUME.clip(behind).corners().len() < 3);
    }
}
