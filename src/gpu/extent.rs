//! Where translucent geometry lands on the screen and between which depths (GPU Pro 2, section 2.9.4): lists are
//! made for that rectangle alone, and depth codes span that range.

use crate::camera::{Camera, ClipRows};
use crate::clip::{ClipVolume, Vertex};

use glam::DVec3;

use super::rect::Rect;

/// Of triangles as seen: pixels, and the values that keys are made from. Grows from nothing.
#[derive(Debug, Clone, Copy)]
pub struct Extent {
    x: (f64, f64),
    y: (f64, f64),
    value: (f64, f64),
    /// Fragments to expect: as many as pixels in the area, for pixels lie anywhere.
    fragments: f64,
    /// Some triangle reaches past the viewport or the depth range, so that hardware may cut it.
    pub is_cut: bool,
}

const NOTHING: (f64, f64) = (f64::INFINITY, f64::NEG_INFINITY);

impl Extent {
    pub const NOTHING: Self = Self { x: NOTHING, y: NOTHING, value: NOTHING, fragments: 0.0, is_cut: false };

    pub fn join(self, other: Self) -> Self {
        let join = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
        Self {
            x: join(self.x, other.x),
            y: join(self.y, other.y),
            value: join(self.value, other.value),
            fragments: self.fragments + other.fragments,
            is_cut: self.is_cut || other.is_cut,
        }
    }

    /// The pixels that may be covered, `None` if there are none.
    pub fn rect(&self, width: u32, height: u32) -> Option<Rect> {
        // Rasterisers round vertices to fractions of a pixel: one more on each side.
        let range = |(low, high): (f64, f64), size: u32| {
            let first = (low.floor() - 1.0).clamp(0.0, f64::from(size));
            let end = (high.ceil() + 1.0).clamp(0.0, f64::from(size));
            (first < end).then_some((first as u32, end as u32))
        };
        let ((x0, x1), (y0, y1)) = (range(self.x, width)?, range(self.y, height)?);
        Some(Rect { x0, y0, w: x1 - x0, h: y1 - y0 })
    }

    /// Nodes to begin with: a little more than are to be expected. Too few, and a pass is done again with the exact
    /// number; too many is only memory.
    pub fn nodes(&self) -> u64 {
        (self.fragments * 1.05) as u64 + 4096
    }

    /// Least and greatest 1/w under a perspective, else eye depth; with room for what float32 rounds.
    pub fn values(&self) -> (f64, f64) {
        if self.value.0 > self.value.1 {
            return (0.0, 0.0);
        }
        let room = 1e-6 * self.value.0.abs().max(self.value.1.abs());
        (self.value.0 - room, self.value.1 + room)
    }
}

/// What a triangle is seen by.
pub struct Viewpoint<'a> {
    rows: &'a ClipRows,
    volume: ClipVolume<f64>,
    size: (f64, f64),
    multisampled: bool,
}

impl<'a> Viewpoint<'a> {
    pub fn new(camera: &Camera, rows: &'a ClipRows, (width, height): (u32, u32), multisampled: bool) -> Self {
        let (near, far) = camera.depth_range();
        // A little more than the viewport: what rounding brings in is inside too.
        let volume = ClipVolume { near, far, perspective: rows.perspective, guard: 1.0 + 1e-3 };
        Self { rows, volume, size: (f64::from(width), f64::from(height)), multisampled }
    }

    /// Of a triangle, relative to the rows' centre.
    pub fn extent(&self, triangle: [DVec3; 3]) -> Extent {
        let vertices = triangle.map(|p| {
            let p = p.extend(1.0);
            let w = self.rows.w.dot(p);
            let depth = if self.rows.perspective { w } else { self.rows.depth.dot(p) };
            Vertex { x: self.rows.x.dot(p), y: self.rows.y.dot(p), w, depth, color: [0.0; 4] }
        });
        if self.volume.contains(&vertices) {
            return self.of(&vertices);
        }
        Extent { is_cut: true, ..self.of(self.volume.clip(vertices).corners()) }
    }

    fn of(&self, corners: &[Vertex<f64>]) -> Extent {
        let screen =
            |v: &Vertex<f64>| ((v.x / v.w * 0.5 + 0.5) * self.size.0, (0.5 - v.y / v.w * 0.5) * self.size.1);
        let of = |v: &Vertex<f64>| {
            let (x, y) = screen(v);
            let value = if self.rows.perspective { 1.0 / v.w } else { v.depth };
            Extent { x: (x, x), y: (y, y), value: (value, value), ..Extent::NOTHING }
        };
        let mut extent = corners.iter().map(of).fold(Extent::NOTHING, Extent::join);
        if let [first, rest @ ..] = corners {
            let (x0, y0) = screen(first);
            let side = |v: &Vertex<f64>| (screen(v).0 - x0, screen(v).1 - y0);
            let twice: f64 = rest
                .windows(2)
                .map(|pair| (side(&pair[0]), side(&pair[1])))
                .map(|(a, b)| a.0 * b.1 - a.1 * b.0)
                .sum();
            extent.fragments = twice.abs() / 2.0;
            if self.multisampled {
                // Pixels that a convex shape touches: the area of its sum with a pixel's square (Minkowski).
                extent.fragments += (extent.x.1 - extent.x.0) + (extent.y.1 - extent.y.0) + 1.0;
            }
        }
        extent
    }
}

#[cfg(test)]
mod tests {
    use glam::DMat4;

    use super::*;

    fn extent(triangle: [[f64; 3]; 3]) -> Extent {
        let camera = Camera { view: DMat4::IDENTITY, projection: DMat4::IDENTITY, near: None, far: None };
        let rows = camera.clip_rows(DVec3::ZERO);
        Viewpoint::new(&camera, &rows, (100, 50), false).extent(triangle.map(DVec3::from_array))
    }

    #[test]
    fn a_triangle_has_its_box_depths_and_area() {
        let found = extent([[0.0, 0.0, -1.0], [0.5, 0.0, -2.0], [0.0, 0.4, -3.0]]);
        assert_eq!(found.rect(100, 50), Some(Rect { x0: 49, y0: 14, w: 27, h: 12 }));
        assert!((found.fragments - 0.5 * 25.0 * 10.0).abs() < 1e-9);
        let (near, far) = found.values();
        assert!(near < 1.0 && near > 0.999 && far > 3.0 && far < 3.001);
        assert!(!found.is_cut);
    }

    #[test]
    fn what_reaches_past_the_view_counts_as_far_as_it_is_seen() {
        let found = extent([[-50.0, -50.0, -1.0], [50.0, -50.0, -1.0], [0.0, 50.0, -1.0]]);
        assert!(found.is_cut);
        assert!((found.fragments / 5000.0 - 1.0).abs() < 0.01, "{}", found.fragments);
        assert_eq!(extent([[2.0, 2.0, -1.0], [3.0, 2.0, -1.0], [2.0, 3.0, -1.0]]).rect(100, 50), None);
    }
}
