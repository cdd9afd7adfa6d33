//! The camera as the pipelines see it: matrices composed in float64, near and far as eye depths.

use glam::{DMat4, DVec3, DVec4};

use crate::error::{Error, Result};
use crate::scene::Scene;

/// World to eye to clip. The eye looks along −Z (OpenGL axes); depth is −z in eye space.
#[derive(Debug, Clone, Copy)]
pub struct Camera {
    pub view: DMat4,
    pub projection: DMat4,
    /// Nothing nearer than this eye depth is drawn. `None`: nothing in front of the eye is cut.
    pub near: Option<f64>,
    pub far: Option<f64>,
}

/// Rows of the matrix that takes a position relative to a centre to clip space and eye depth.
#[derive(Debug, Clone, Copy)]
pub struct ClipRows {
    pub x: DVec4,
    pub y: DVec4,
    /// Clip w: the eye depth under a perspective, 1 otherwise.
    pub w: DVec4,
    pub depth: DVec4,
    pub perspective: bool,
}

impl ClipRows {
    /// A position relative to the centre, and what it is transformed to, stay finite in float32.
    pub fn representable(&self, p: DVec3) -> bool {
        let limit = f64::from(f32::MAX) / 4.0; // a quarter: sums of a few stay finite
        let fits = |row: &DVec4| {
            (row.x * p.x).abs() + (row.y * p.y).abs() + (row.z * p.z).abs() + row.w.abs() < limit
        };
        p.abs().max_element() < limit && [self.x, self.y, self.w, self.depth].iter().all(fits)
    }
}

/// Where a perspective without a near plane is cut, as clip w. Any positive constant serves: it only
/// keeps the divide finite, and is far below any w that float32 geometry resolves.
pub const MIN_W: f64 = 1.0 / (1u64 << 60) as f64;

impl Camera {
    /// Builds from row-major 4×4 matrices (`M @ column`), as numpy stores them.
    pub fn from_rows(
        view: &[f64; 16],
        projection: &[f64; 16],
        near: Option<f64>,
        far: Option<f64>,
    ) -> Result<Self> {
        // glam stores columns: this transpose is the only one in the project.
        let camera = Self {
            view: DMat4::from_cols_array(view).transpose(),
            projection: DMat4::from_cols_array(projection).transpose(),
            near,
            far,
        };
        let w = camera.projection.row(3);
        if w != DVec4::new(0.0, 0.0, -1.0, 0.0) && w != DVec4::new(0.0, 0.0, 0.0, 1.0) {
            return Err(Error::Parameter(format!(
                "projection's last row must be (0, 0, -1, 0) or (0, 0, 0, 1), got {w}"
            )));
        }
        Ok(camera)
    }

    pub fn is_perspective(&self) -> bool {
        self.projection.row(3).z != 0.0
    }

    /// The depths that the scene spans, of which only a parallel view needs to know: 0 under a perspective.
    pub fn depth_extent(&self, scene: &Scene) -> (f64, f64) {
        if self.is_perspective() {
            return (0.0, 0.0);
        }
        scene.extent(|p| -self.view.transform_point3(p).z).unwrap_or_default()
    }

    /// What float32 pipelines keep positions relative to: they round them once, relative to it.
    ///
    /// Under a perspective it is the eye, so that a rounding is 2⁻²⁴ of the distance from the eye, whatever
    /// else the scene holds. A parallel view has no such point; its centre lies on the view axis, amid the
    /// scene's depths, as `depth_extent` has them.
    pub fn center(&self, (low, high): (f64, f64)) -> DVec3 {
        let to_world = self.view.inverse();
        let eye = to_world.transform_point3(DVec3::ZERO);
        if self.is_perspective() {
            return eye;
        }
        to_world.transform_point3(DVec3::new(0.0, 0.0, -(low + high) / 2.0))
    }

    /// Composes view, projection and the move to `center` in float64: float32 pipelines round once, here.
    pub fn clip_rows(&self, center: DVec3) -> ClipRows {
        let to_eye = self.view * DMat4::from_translation(center);
        let to_clip = self.projection * to_eye;
        let depth = -to_eye.row(2);
        ClipRows {
            x: to_clip.row(0),
            y: to_clip.row(1),
            w: to_clip.row(3),
            depth,
            perspective: self.is_perspective(),
        }
    }

    /// The eye depths between which geometry is kept; the near one never lets w reach 0.
    pub fn depth_range(&self) -> (f64, f64) {
        let near = match (self.near, self.is_perspective()) {
            (Some(near), true) => near.max(MIN_W),
            (None, true) => MIN_W,
            (near, false) => near.unwrap_or(0.0),
        };
        (near, self.far.unwrap_or(f64::INFINITY))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const IDENTITY: [f64; 16] = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];

    #[test]
    fn the_last_row_decides_between_perspective_and_orthographic() {
        assert!(!Camera::from_rows(&IDENTITY, &IDENTITY, None, None).unwrap().is_perspective());
        let mut p = IDENTITY;
        (p[14], p[15]) = (-1.0, 0.0);
        let camera = Camera::from_rows(&IDENTITY, &p, None, None).unwrap();
        assert!(camera.is_perspective());
        let rows = camera.clip_rows(DVec3::new(0.0, 0.0, -5.0));
        assert_eq!(rows.w.dot(DVec4::W), 5.0);
        assert_eq!(rows.depth.dot(DVec4::W), 5.0);
        (p[12], p[15]) = (1.0, 0.0);
        assert!(Camera::from_rows(&IDENTITY, &p, None, None).is_err());
    }
}
