//! Triangle setup: transform, canonical vertex order, clip, snap, and the planes that give depth and
//! colour at any pixel.
//!
//! Coverage comes from vertices snapped to 1/256 pixel, so that it is integer and watertight.

use glam::{DVec3, DVec4};
use rayon::prelude::*;

use super::plane::{Frame, Plane, on_screen};
use crate::camera::Camera;
use crate::clip::{ClipVolume, GUARD_BAND, MAX_CORNERS, Vertex};
use crate::real::Real;
use crate::scene::{Cull, Scene};

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
    /// The pixels that records may cover, for people.
    pub fn describe_box(&self, width: u32, height: u32) -> String {
        let of = |r: &Record<T>| pixel_box(r.x, r.y, (width, height), self.multisampled);
        let join =
            |a: [i32; 4], b: [i32; 4]| [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])];
        match self.records.iter().map(of).reduce(join) {
            Some([x0, y0, x1, y1]) => format!("{x0}..{} × {y0}..{}", x1 + 1, y1 + 1),
            None => "none".into(),
        }
    }

    pub fn bytes(&self) -> u64 {
        (self.records.len() * size_of::<Record<T>>() + self.gradients.len() * size_of::<[Plane<T>; 4]>())
            as u64
    }
}

/// Everything about the view that a triangle needs, in the pipeline's precision.
struct View<T> {
    rows: [[T; 4]; 4],
    volume: ClipVolume<T>,
    center: DVec3,
    width: T,
    height: T,
    viewport: (u32, u32),
    multisampled: bool,
}

const CHUNK: usize = 4096;

/// Sets up all triangles, in submission order.
pub fn set_up<T: Real>(scene: &Scene, camera: &Camera, viewport: (u32, u32), multisampled: bool) -> Setup<T> {
    let (width, height) = viewport;
    let center = camera.center(camera.depth_extent(scene));
    let rows = camera.clip_rows(center);
    let (near, far) = camera.depth_range();
    let row = |r: DVec4| r.to_array().map(T::from_f64);
    let view = View {
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
    };
    let triangles = scene.triangle_count();
    let mut setup = Setup {
        records: Vec::with_capacity(triangles), // address space: pages are touched as records come
        gradients: Vec::new(),
        rejected: 0,
        perspective: rows.perspective,
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
            .map(|first| Part::of(scene, &view, first, (first + CHUNK).min(end)))
            .collect();
        for part in parts {
            let shift = setup.gradients.len() as u32;
            setup.records.extend(part.records.iter().map(|r| {
                let gradient = if r.gradient == FLAT { FLAT } else { r.gradient + shift };
                Record { gradient, ..*r }
            }));
            setup.gradients.extend_from_slice(&part.gradients);
            setup.rejected += part.rejected;
            setup.has_pieces |= part.has_pieces;
        }
    }
    setup
}

/// The records of a chunk of triangles.
struct Part<T> {
    records: Vec<Record<T>>,
    gradients: Vec<[Plane<T>; 4]>,
    rejected: u64,
    has_pieces: bool,
}

impl<T: Real> Part<T> {
    fn of(scene: &Scene, view: &View<T>, first: usize, end: usize) -> Self {
        let mut part = Self { records: Vec::new(), gradients: Vec::new(), rejected: 0, has_pieces: false };
        let (mut mesh, mut face) = scene.locate(first);
        for primitive in first..end {
            while face == scene.meshes[mesh].face_count() {
                (mesh, face) = (mesh + 1, 0);
            }
            if part.add(scene, view, mesh, face, primitive as u32).is_none() {
                part.rejected += 1;
            }
            face += 1;
        }
        part
    }

    /// Adds what is visible of one triangle. `None` if its values overflow.
    fn add(&mut self, scene: &Scene, view: &View<T>, mesh: usize, face: usize, primitive: u32) -> Option<()> {
        let source = &scene.meshes[mesh];
        let ids = source.vertex_ids(face);
        let colors = source.corner_colors::<T>(face, ids);
        let given: [Vertex<T>; 3] =
            std::array::from_fn(|i| view.transform(source.positions.get(ids[i]), colors[i]));
        if !given.iter().all(|v| (v.x + v.y + v.w + v.depth).is_finite()) {
            return None;
        }
        if view.volume.misses(&given) {
            return Some(());
        }
        let (vertices, flipped) = canonical(given);
        let clipped;
        let corners = if view.volume.contains(&vertices) {
            &vertices[..]
        } else {
            clipped = view.volume.clip(vertices);
            clipped.corners()
        };
        if corners.len() < 3 {
            return Some(());
        }
        let mut screen = [(0, 0); MAX_CORNERS];
        for (corner, v) in screen.iter_mut().zip(corners) {
            *corner = view.snapped(v)?;
        }
        let screen = &screen[..corners.len()];

        let corners_of = |i: usize| [screen[0], screen[i], screen[i + 1]];
        let mut pieces = (1..screen.len() - 1)
            .filter_map(|i| view.visible_piece(corners_of(i), flipped, source.cull))
            .peekable();
        if pieces.peek().is_none() {
            return Some(());
        }
        // The planes are the parent's: all its pieces share them.
        let frame = Frame::of(&vertices, corners, view.volume.perspective, [view.width, view.height])?;
        let gradient = frame.colors.map_or(FLAT, |planes| {
            self.gradients.push(planes);
            self.gradients.len() as u32 - 1
        });
        let first_piece = self.records.len();
        self.records.extend(pieces.map(|(x, y)| Record {
            x,
            y,
            anchor: frame.anchor,
            key_plane: frame.key,
            color: vertices[0].color,
            gradient,
            primitive,
            mesh: mesh as u32,
        }));
        self.has_pieces |= self.records.len() > first_piece + 1;
        Some(())
    }
}

impl<T: Real> View<T> {
    fn transform(&self, position: DVec3, color: [T; 4]) -> Vertex<T> {
        let p: [T; 3] = std::array::from_fn(|i| T::relative(position[i], self.center[i]));
        let dot = |r: &[T; 4]| r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3];
        let [x, y, w, depth] = std::array::from_fn(|i| dot(&self.rows[i]));
        Vertex { x, y, w, depth: if self.volume.perspective { w } else { depth }, color }
    }

    /// A vertex on the screen, in 1/256 pixel.
    fn snapped(&self, v: &Vertex<T>) -> Option<(i32, i32)> {
        let [x, y] = on_screen(v, [self.width, self.height]);
        let snap = |v: T| (v * T::from_i32(SUBPIXELS) + T::from_f64(0.5)).floor_to_i32();
        (x + y).is_finite().then(|| (snap(x), snap(y)))
    }

    /// Snapped vertices in positive order, unless the piece is culled, has no area, or can cover nothing.
    fn visible_piece(&self, c: [(i32, i32); 3], flipped: bool, cull: Cull) -> Option<([i32; 3], [i32; 3])> {
        let mut x = c.map(|c| c.0);
        let mut y = c.map(|c| c.1);
        let side = |a: usize, b: usize| (i64::from(x[a] - x[0])) * i64::from(y[b] - y[0]);
        let area = side(1, 2) - side(2, 1);
        if area == 0 {
            return None;
        }
        // y points down here: counter-clockwise for the eye is a negative area.
        let front = (area < 0) != flipped;
        if (cull == Cull::Back && !front) || (cull == Cull::Front && front) {
            return None;
        }
        if area < 0 {
            x.swap(1, 2);
            y.swap(1, 2);
        }
        let [x0, y0, x1, y1] = pixel_box(x, y, self.viewport, self.multisampled);
        (x0 <= x1 && y0 <= y1).then_some((x, y))
    }
}

/// Puts the vertices in an order that depends on their values alone, so that coincident faces tie
/// whatever their rotation or winding. Also tells whether that reversed the winding.
fn canonical<T: Real>(v: [Vertex<T>; 3]) -> ([Vertex<T>; 3], bool) {
    let rest =
        |v: &Vertex<T>| (v.y.orderable(), v.w.orderable(), v.depth.orderable(), v.color.map(T::orderable));
    // Nearly always x decides.
    let compare = |&a: &usize, &b: &usize| {
        let (a, b) = (&v[a], &v[b]);
        a.x.orderable().cmp(&b.x.orderable()).then_with(|| rest(a).cmp(&rest(b)))
    };
    let mut order = [0, 1, 2];
    order.sort_by(compare);
    let flipped = matches!(order, [0, 2, 1] | [1, 0, 2] | [2, 1, 0]);
    (order.map(|i| v[i]), flipped)
}

#[cfg(test)]
mod tests {
    use glam::DMat4;

    use super::*;
    use crate::scene::{ColorValues, Colors, Mesh, Positions, Rate};

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
        set_up(&scene.unwrap(), camera, (size, size), false)
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
