//! Where translucent geometry lands on the screen and between which depths (GPU Pro 2, section 2.9.4): lists are
//! made for that rectangle alone, and depth codes span that range.

use crate::camera::{Camera, ClipRows};
use crate::clip::{ClipVolume, Vertex};

use glam::DVec3;

use super::pool::Rect;

/// Of triangles as seen: pixels, and the values that keys are made from. Grows from nothing.
#[derive(Debug, Clone, Copy)]
pub struct Extent {
    x: (f64, f64),
    y: (f64, f64),
    value: (f64, f64),
    /// Some triangle reaches past the viewport or the depth range, so that hardware may cut it.
    pub is_cut: bool,
}

const NOTHING: (f64, f64) = (f64::INFINITY, f64::NEG_INFINITY);

impl Extent {
    pub const NOTHING: Self = Self { x: NOTHING, y: NOTHING, value: NOTHING, is_cut: false };

    pub fn join(self, other: Self) -> Self {
        let join = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
        Self {
            x: join(self.x, other.x),
            y: join(self.y, other.y),
            value: join(self.value, other.value),
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
}

impl<'a> Viewpoint<'a> {
    pub fn new(camera: &Camera, rows: &'a ClipRows, width: u32, height: u32) -> Self {
        let (near, far) = camera.depth_range();
        // A little more than the viewport: what rounding brings in is inside too.
        let volume = ClipVolume { near, far, perspective: rows.perspective, guard: 1.0 + 1e-3 };
        Self { rows, volume, size: (f64::from(width), f64::from(height)) }
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
        let of = |v: &Vertex<f64>| {
            let x = (v.x / v.w * 0.5 + 0.5) * self.size.0;
            let y = (0.5 - v.y / v.w * 0.5) * self.size.1;
            let value = if self.rows.perspective { 1.0 / v.w } else { v.depth };
            Extent { x: (x, x), y: (y, y), value: (value, value), is_cut: false }
        };
        corners.iter().map(of).fold(Extent::NOTHING, Extent::join)
    }
}
