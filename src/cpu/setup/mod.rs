//! Triangle setup: transform, canonical vertex order, clip, snap, and the planes that give depth and
//! colour at any pixel.
//!
//! Coverage comes from vertices snapped to 1/256 pixel, so that it is integer and watertight.

mod eight;
#[cfg(test)]
mod eight_tests;
mod triangle;

use glam::DVec4;
use rayon::prelude::*;

use super::Precision;
use super::lanes::Instructions;
use super::plane::Plane;
use crate::camera::Camera;
use crate::clip::{ClipVolume, GUARD_BAND};
use crate::real::Real;
use crate::scene::Scene;
pub use eight::add_faces;
use triangle::View;
pub use triangle::{Faces, Part};

/// Snapped units per pixel.
pub const SUBPIXELS: i32 = 256;
/// `Record::gradient` of a triangle of one colour.
pub const FLAT: u32 = u32::MAX;

/// One convex piece of a triangle, ready to rasterise. An unclipped triangle is one piece.
#[derive(Debug, Clone, Copy)]
pub struct Record<T> {
    /// Snapped vertices, 1/256 pixel, in the order that makes the area positive with y down.
    pub x: [i32; 3],
    pub y: [i32; 3],
    /// Where the planes are anchored, in pixels.
    pub anchor: [T; 2],
    /// 1/w under a perspective, else the eye depth.
    pub key_plane: Plane<T>,
    /// The colour if `gradient` is `FLAT`.
    pub color: [T; 4],
    /// Index into `Setup::gradients`, or `FLAT`.
    pub gradient: u32,
    pub primitive: u32,
    pub mesh: u32,
}

/// First and last pixel whose centre snapped vertices can cover, on one axis; or one of whose samples.
pub fn pixel_range(v: [i32; 3], multisampled: bool) -> (i32, i32) {
    let (low, high) = (v[0].min(v[1]).min(v[2]), v[0].max(v[1]).max(v[2]));
    if multisampled {
        // Samples lie from 256 i to 256 i + 240.
        return ((low + 15) >> 8, high >> 8);
    }
    // Centres lie at 256 i + 128: round the low end up and the high end down to one.
    ((low + SUBPIXELS / 2 - 1) >> 8, (high - SUBPIXELS / 2) >> 8)
}

/// Pixels that the bounding box may cover: x0, y0, x1, y1, all inclusive, cut to the viewport.
pub fn pixel_box(x: [i32; 3], y: [i32; 3], (width, height): (u32, u32), multisampled: bool) -> [i32; 4] {
    let ((x0, x1), (y0, y1)) = (pixel_range(x, multisampled), pixel_range(y, multisampled));
    [x0.max(0), y0.max(0), x1.min(width as i32 - 1), y1.min(height as i32 - 1)]
}

/// What setup hands to binning and tiles.
#[derive(Debug)]
pub struct Setup<T> {
    pub records: Vec<Record<T>>,
    /// Colour planes, RGBA, of triangles whose corners differ.
    pub gradients: Vec<[Plane<T>; 4]>,
    /// Triangles with finite corners whose transformed values are not.
    pub rejected: u64,
    pub perspective: bool,
    /// Some triangle was cut into several pieces.
    pub has_pieces: bool,
    /// Pixels have samples beside their centres.
    pub multisampled: bool,
}

impl<T> Setup<T> {
    pub fn bytes(&self) -> u64 {
        (self.records.len() * size_of::<Record<T>>() + self.gradients.len() * size_of::<[Plane<T>; 4]>())
            as u64
    }
}

const CHUNK: usize = 4096;

fn view_of<T: Real>(scene: &Scene, camera: &Camera, viewport: (u32, u32), multisampled: bool) -> View<T> {
    let (width, height) = viewport;
    let center = camera.center(camera.depth_extent(scene));
    let rows = camera.clip_rows(center);
    let (near, far) = camera.depth_range();
    let row = |r: DVec4| r.to_array().map(T::from_f64);
    View {
        rows: [row(rows.x), row(rows.y), row(rows.w), row(rows.depth)],
        volume: ClipVolume {
            near: T::from_f64(near),
            far: T::from_f64(far),
            perspective: rows.perspective,
            guard: T::from_f64(GUARD_BAND),
        },
        center,
        width: T::from_i32(width as i32),
        height: T::from_i32(height as i32),
        viewport,
        multisampled,
    }
}

/// Sets up all triangles, in submission order.
pub fn set_up<T: Precision>(
    instructions: Instructions,
    scene: &Scene,
    camera: &Camera,
    viewport: (u32, u32),
    multisampled: bool,
) -> Setup<T> {
    let view = view_of(scene, camera, viewport, multisampled);
    let triangles = scene.triangle_count();
    let mut setup = Setup {
        records: Vec::with_capacity(triangles), // address space: pages are touched as records come
        gradients: Vec::new(),
        rejected: 0,
        perspective: view.volume.perspective,
        has_pieces: false,
        multisampled,
    };
    // A few chunks a thread at a time, so that what is copied together stays small beside the whole.
    let batch = CHUNK * 4 * rayon::current_num_threads();
    for start in (0..triangles).step_by(batch) {
        let end = (start + batch).min(triangles);
        let parts: Vec<Part<T>> = (start..end)
            .step_by(CHUNK)
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|first| Part::of(instructions, scene, &view, first, (first + CHUNK).min(end)))
            .collect();
        let mut shifts = Vec::with_capacity(parts.len());
        let mut gradients = setup.gradients.len();
        for part in &parts {
            shifts.push(gradients as u32);
            gradients += part.gradients.len();
            setup.rejected += part.rejected;
            setup.has_pieces |= part.has_pieces;
        }
        let records: Vec<&[Record<T>]> = parts.iter().map(|part| part.records.as_slice()).collect();
        append(&mut setup.records, &records, |part, r| {
            let gradient = if r.gradient == FLAT { FLAT } else { r.gradient + shifts[part] };
            Record { gradient, ..r }
        });
        let gradients: Vec<&[[Plane<T>; 4]]> = parts.iter().map(|part| part.gradients.as_slice()).collect();
        append(&mut setup.gradients, &gradients, |_, planes| planes);
    }
    setup
}

/// Appends parts, each value as `moved(part, value)` makes it, all threads at a time.
fn append<V: Copy + Send + Sync>(all: &mut Vec<V>, parts: &[&[V]], moved: impl Fn(usize, V) -> V + Sync) {
    let total = parts.iter().map(|part| part.len()).sum();
    all.reserve(total);
    let mut rest = &mut all.spare_capacity_mut()[..total];
    let mut pieces = Vec::with_capacity(parts.len());
    for part in parts {
        let (piece, tail) = rest.split_at_mut(part.len());
        pieces.push(piece);
        rest = tail;
    }
    pieces.into_par_iter().zip(parts).enumerate().for_each(|(i, (piece, part))| {
        for (slot, &value) in piece.iter_mut().zip(*part) {
            slot.write(moved(i, value));
        }
    });
    // SAFETY: there is room for them, and the pieces, all of which were written, are that many.
    unsafe { all.set_len(all.len() + total) };
}

#[cfg(test)]
mod tests {
    use glam::DMat4;

    use super::*;
    use crate::scene::{ColorValues, Colors, Cull, Mesh, Positions, Rate};

    /// A view in which world x and y from −1 to 1 fill a `size` × `size` image, and depth is −z.
    fn set_up_orthographic(positions: &[[f32; 3]], faces: &[[u32; 3]], size: u32) -> Setup<f32> {
        let camera = Camera { view: DMat4::IDENTITY, projection: DMat4::IDENTITY, near: None, far: None };
        set_up_with(positions, faces, size, &camera)
    }

    fn set_up_with(positions: &[[f32; 3]], faces: &[[u32; 3]], size: u32, camera: &Camera) -> Setup<f32> {
        let scene = Scene::new(vec![Mesh {
            positions: Positions::F32(positions),
            faces: Some(faces),
            colors: Colors { rate: Rate::One, values: ColorValues::F32(&[[1.0; 4]]) },
            opaque: false,
            alpha_cutoff: 0.0,
            cull: Cull::None,
            blend: 0,
        }]);
        set_up(Instructions::detected(), &scene.unwrap(), camera, (size, size), false)
    }

    fn perspective() -> Camera {
        let mut rows = [0.0; 16];
        (rows[0], rows[5], rows[14]) = (1.0, 1.0, -1.0);
        let identity = DMat4::IDENTITY.to_cols_array();
        Camera::from_rows(&identity, &rows, None, None).unwrap()
    }

    #[test]
    fn vertices_snap_to_the_nearest_256th_of_a_pixel_with_y_down() {
        // 4 pixels: x = (ndc·½ + ½)·4, so that 1/1024 in ndc is half of 1/256 pixel, which rounds up.
        let p = [[-1.0 + 1.0 / 1024.0, 1.0, -1.0], [1.0, 1.0, -1.0], [0.0, -1.0, -1.0]];
        let setup = set_up_orthographic(&p, &[[0, 1, 2]], 4);
        let record = setup.records[0];
        let mut snapped: Vec<_> = record.x.into_iter().zip(record.y).collect();
        snapped.sort_unstable();
        assert_eq!(snapped, [(1, 0), (512, 1024), (1024, 0)]);
    }

    #[test]
    fn rotations_and_reversals_of_a_face_give_the_same_planes() {
        let p = [[-0.7, -0.6, -1.0], [0.8, -0.5, -2.0], [0.1, 0.7, -3.0]];
        let faces = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
        let setup = set_up_with(&p, &faces, 64, &perspective());
        let bits = |r: &Record<f32>| {
            let k = r.key_plane;
            [r.anchor[0], r.anchor[1], k.value, k.gx, k.gy, k.low, k.high].map(f32::to_bits)
        };
        assert_eq!(setup.records.len(), 6);
        assert!(setup.records.iter().all(|r| bits(r) == bits(&setup.records[0])));
    }

    #[test]
    fn snapped_coordinates_stay_in_range_whatever_the_triangle() {
        // Through the eye, far outside, and huge: the guard band keeps them within 2^23.6 units.
        let p =
            [[0.1, 0.2, 1.0], [1e6, -1e6, -1e-3], [-1e30, 1e30, -1.0], [0.3, 0.1, -1e-20], [5.0, 5.0, -0.1]];
        let mut faces = Vec::new();
        for a in 0..5 {
            for b in 0..5 {
                faces.extend((0..5).filter(|&c| a != b && b != c && a != c).map(|c| [a, b, c]));
            }
        }
        let setup = set_up_with(&p, &faces, 16384, &perspective());
        assert!(setup.records.len() > 10);
        let limit = 2f64.powf(23.6) as i32;
        for r in &setup.records {
            assert!(r.x.iter().chain(&r.y).all(|v| v.abs() <= limit), "{:?} {:?}", r.x, r.y);
        }
    }

    #[test]
    fn triangles_that_hold_no_pixel_centre_are_dropped_in_setup() {
        let inside_a_pixel = [[0.02, 0.02, -1.0], [0.2, 0.02, -1.0], [0.02, 0.2, -1.0]];
        assert!(set_up_orthographic(&inside_a_pixel, &[[0, 1, 2]], 4).records.is_empty());
        let line = [[-1.0, -1.0, -1.0], [1.0, 1.0, -1.0], [0.0, 0.0, -1.0]];
        assert!(set_up_orthographic(&line, &[[0, 1, 2]], 4).records.is_empty());
    }

    #[test]
    fn pieces_of_a_clipped_triangle_share_its_planes() {
        let p = [[-0.5, -0.5, -1.0], [0.5, -0.5, -1.0], [0.0, 0.5, 1.0]]; // one corner behind the eye
        let setup = set_up_with(&p, &[[0, 1, 2]], 64, &perspective());
        assert!(setup.has_pieces && setup.records.len() >= 2);
        let first = setup.records[0];
        for r in &setup.records {
            assert_eq!((r.primitive, r.anchor), (first.primitive, first.anchor));
            assert_eq!(r.key_plane.gx.to_bits(), first.key_plane.gx.to_bits());
        }
    }
}
