//! Triangles as given: borrowed arrays, mesh after mesh. Primitive ids run over the whole scene.

use glam::DVec3;
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::real::Real;

/// Vertex positions in the precision that the user gave.
#[derive(Debug, Clone, Copy)]
pub enum Positions<'a> {
    F32(&'a [[f32; 3]]),
    F64(&'a [[f64; 3]]),
}

impl Positions<'_> {
    pub fn len(&self) -> usize {
        match self {
            Self::F32(p) => p.len(),
            Self::F64(p) => p.len(),
        }
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    #[inline]
    pub fn get(&self, i: usize) -> DVec3 {
        match self {
            Self::F32(p) => DVec3::new(p[i][0] as f64, p[i][1] as f64, p[i][2] as f64),
            Self::F64(p) => DVec3::from_array(p[i]),
        }
    }
}

/// How often a colour changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rate {
    One,
    Vertex,
    Face,
    Corner,
}

/// Straight RGBA at one of four rates, in the precision that the user gave.
#[derive(Debug, Clone, Copy)]
pub struct Colors<'a> {
    pub rate: Rate,
    pub values: ColorValues<'a>,
}

#[derive(Debug, Clone, Copy)]
pub enum ColorValues<'a> {
    F32(&'a [[f32; 4]]),
    F64(&'a [[f64; 4]]),
}

impl Colors<'_> {
    fn len(&self) -> usize {
        match self.values {
            ColorValues::F32(c) => c.len(),
            ColorValues::F64(c) => c.len(),
        }
    }

    #[inline]
    fn get<T: Real>(&self, i: usize) -> [T; 4] {
        match self.values {
            ColorValues::F32(c) => c[i].map(|v| T::from_f64(v as f64)),
            ColorValues::F64(c) => c[i].map(T::from_f64),
        }
    }
}

/// Which side is dropped. Counter-clockwise, as seen by the eye, is the front.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cull {
    None,
    Back,
    Front,
}

#[derive(Debug, Clone, Copy)]
pub struct Mesh<'a> {
    pub positions: Positions<'a>,
    /// `None`: every three positions are a triangle.
    pub faces: Option<&'a [[u32; 3]]>,
    pub colors: Colors<'a>,
    pub opaque: bool,
    /// Fragments of less alpha are discarded. 0 keeps all.
    pub alpha_cutoff: f64,
    pub cull: Cull,
    /// An id of `blend::MODES`, or past them a user's own blend.
    pub blend: u8,
}

impl Mesh<'_> {
    pub fn face_count(&self) -> usize {
        self.faces.map_or(self.positions.len() / 3, <[_]>::len)
    }

    /// Checks what indexing relies on. Python has checked it with better words; arrays may have changed since.
    fn check(&self) -> Result<()> {
        let (vertices, faces) = (self.positions.len(), self.face_count());
        if let Some(indices) = self.faces
            && indices.iter().flatten().any(|&i| i as usize >= vertices)
        {
            return Err(Error::Scene(format!("faces index past the {vertices} positions")));
        }
        let got = self.colors.len();
        let wanted = match self.colors.rate {
            Rate::One => 1,
            Rate::Vertex => vertices,
            Rate::Face => faces,
            Rate::Corner => 3 * faces,
        };
        if got != wanted {
            return Err(Error::Scene(format!("{got} colours given where {wanted} are needed")));
        }
        Ok(())
    }

    #[inline]
    pub fn vertex_ids(&self, face: usize) -> [usize; 3] {
        match self.faces {
            Some(faces) => faces[face].map(|i| i as usize),
            None => [3 * face, 3 * face + 1, 3 * face + 2],
        }
    }

    #[inline]
    pub fn corner_colors<T: Real>(&self, face: usize, ids: [usize; 3]) -> [[T; 4]; 3] {
        let at = match self.colors.rate {
            Rate::One => [0; 3],
            Rate::Vertex => ids,
            Rate::Face => [face; 3],
            Rate::Corner => [3 * face, 3 * face + 1, 3 * face + 2],
        };
        at.map(|i| self.colors.get(i))
    }
}

/// Meshes in submission order.
#[derive(Debug)]
pub struct Scene<'a> {
    pub meshes: Vec<Mesh<'a>>,
    /// First primitive of each mesh, then the total.
    pub first_primitive: Vec<usize>,
}

impl<'a> Scene<'a> {
    pub fn new(meshes: Vec<Mesh<'a>>) -> Result<Self> {
        let mut first_primitive = vec![0];
        for mesh in &meshes {
            mesh.check()?;
            first_primitive.push(first_primitive[first_primitive.len() - 1] + mesh.face_count());
        }
        let total = first_primitive[first_primitive.len() - 1];
        // Primitive ids travel as int32, and one bit of their complement orders opaque behind translucent.
        if total > i32::MAX as usize {
            return Err(Error::Scene(format!("{total} triangles given; the limit is {}", i32::MAX)));
        }
        Ok(Self { meshes, first_primitive })
    }

    /// Lowest and highest of the positions that faces use, as `along` sees them. Unused vertices, which files
    /// have, must not count. `None` for a scene without triangles.
    pub fn extent(&self, along: impl Fn(DVec3) -> f64 + Sync) -> Option<(f64, f64)> {
        let join = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
        let of_face = |mesh: &Mesh, face: usize| {
            let corners = mesh.vertex_ids(face).map(|id| along(mesh.positions.get(id)));
            // Nor do triangles that float32 rejects count.
            let counts = corners.iter().all(|v| v.abs() <= f64::from(f32::MAX));
            counts.then(|| corners.map(|v| (v, v)).into_iter().reduce(join)).flatten()
        };
        let of_mesh = |mesh: &Mesh| {
            (0..mesh.face_count()).into_par_iter().filter_map(|face| of_face(mesh, face)).reduce_with(join)
        };
        self.meshes.iter().filter_map(of_mesh).reduce(join)
    }

    pub fn triangle_count(&self) -> usize {
        self.first_primitive[self.meshes.len()]
    }

    /// The mesh that a primitive belongs to, and its face there.
    pub fn locate(&self, primitive: usize) -> (usize, usize) {
        let mesh = self.first_primitive.partition_point(|&first| first <= primitive) - 1;
        (mesh, primitive - self.first_primitive[mesh])
    }

    pub fn has_opaque(&self) -> bool {
        self.meshes.iter().any(|m| m.opaque && m.face_count() > 0)
    }

    /// Some translucent mesh is blended otherwise than `over`.
    pub fn mixes_modes(&self) -> bool {
        self.meshes.iter().any(|m| !m.opaque && m.blend != 0 && m.face_count() > 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(positions: &[[f32; 3]]) -> Mesh<'_> {
        Mesh {
            positions: Positions::F32(positions),
            faces: None,
            colors: Colors { rate: Rate::One, values: ColorValues::F32(&[[1.0; 4]]) },
            opaque: false,
            alpha_cutoff: 0.0,
            cull: Cull::None,
            blend: 0,
        }
    }

    #[test]
    fn primitives_are_located_across_meshes_even_empty_ones() {
        let p = [[0.0; 3]; 6];
        let scene = Scene::new(vec![mesh(&p[..3]), mesh(&p[..0]), mesh(&p)]).unwrap();
        assert_eq!(scene.triangle_count(), 3);
        assert_eq!(scene.locate(0), (0, 0));
        assert_eq!(scene.locate(1), (2, 0));
        assert_eq!(scene.locate(2), (2, 1));
    }

    #[test]
    fn vertices_that_no_face_uses_have_no_extent() {
        let p = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1e9, 0.0, 0.0]];
        let used = Mesh { faces: Some(&[[0, 1, 2]]), ..mesh(&p) };
        assert_eq!(Scene::new(vec![used]).unwrap().extent(|p| p.x), Some((0.0, 2.0)));
    }

    #[test]
    fn faces_past_the_positions_are_an_error_not_a_panic() {
        let p = [[0.0; 3]; 3];
        let bad = Mesh { faces: Some(&[[0, 1, 3]]), ..mesh(&p) };
        assert!(matches!(Scene::new(vec![bad]), Err(Error::Scene(_))));
    }
}
