//! One triangle at a time: whatever clipping leaves of it, in either precision.

use std::ops::Range;

use glam::DVec3;

use super::{FLAT, Record, SUBPIXELS, pixel_box};
use crate::clip::{ClipVolume, MAX_CORNERS, Vertex};
use crate::cpu::Precision;
use crate::cpu::lanes::Instructions;
use crate::cpu::plane::{Frame, Plane, on_screen};
use crate::real::Real;
use crate::scene::{Cull, Mesh, Scene};

/// Everything about the view that a triangle needs, in the pipeline's precision.
pub struct View<T> {
    pub rows: [[T; 4]; 4],
    pub volume: ClipVolume<T>,
    pub center: DVec3,
    pub width: T,
    pub height: T,
    pub viewport: (u32, u32),
    pub multisampled: bool,
}

/// A mesh of the scene, as it is seen.
pub struct Faces<'a, T> {
    pub view: &'a View<T>,
    pub mesh: &'a Mesh<'a>,
    pub id: usize,
    pub first_primitive: usize,
}

/// The records of a chunk of triangles.
#[derive(Default)]
pub struct Part<T> {
    pub records: Vec<Record<T>>,
    pub gradients: Vec<[Plane<T>; 4]>,
    pub rejected: u64,
    pub has_pieces: bool,
}

impl<T: Precision> Part<T> {
    pub fn of(instructions: Instructions, scene: &Scene, view: &View<T>, first: usize, end: usize) -> Self {
        let mut part = Self::default();
        part.records.reserve(end - first);
        let (mut mesh, mut face) = scene.locate(first);
        let mut primitive = first;
        while primitive < end {
            let source = &scene.meshes[mesh];
            let faces = face..source.face_count().min(face + end - primitive);
            primitive += faces.len();
            let first_primitive = scene.first_primitive[mesh];
            T::add_faces(
                instructions,
                &mut part,
                &Faces { view, mesh: source, id: mesh, first_primitive },
                faces,
            );
            (mesh, face) = (mesh + 1, 0);
        }
        part
    }

    /// Adds what is visible of some faces.
    pub fn add_each(&mut self, of: &Faces<T>, faces: Range<usize>) {
        for face in faces {
            if self.add(of, face).is_none() {
                self.rejected += 1;
            }
        }
    }

    /// Adds what is visible of one triangle. `None` if its values overflow.
    fn add(&mut self, of: &Faces<T>, face: usize) -> Option<()> {
        let Faces { view, mesh: source, .. } = of;
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
            primitive: (of.first_primitive + face) as u32,
            mesh: of.id as u32,
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
    pub fn visible_piece(
        &self,
        c: [(i32, i32); 3],
        flipped: bool,
        cull: Cull,
    ) -> Option<([i32; 3], [i32; 3])> {
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
