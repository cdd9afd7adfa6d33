//! Geometry on the device: batches of triangles, three corners each, in submission order.

use glam::DVec3;
use rayon::prelude::*;
use wgpu::BufferUsages;

use super::buffers::{bind, with_contents};
use super::device::Gpu;
use super::extent::{Extent, Viewpoint};
use super::uniforms::{Batch, MeshState};
use crate::camera::ClipRows;
use crate::error::Result;
use crate::scene::{Cull, Mesh, Rate, Scene};
use crate::threads::threads;

/// Triangles of a batch, at most; less where the device's bindings are small.
const MAX_BATCH: u64 = 1 << 20;
/// Bytes of three RGBA float32 colours, the largest array of a batch.
const COLOR_BYTES: u64 = 48;

pub struct Geometry {
    pub batches: Vec<Drawn>,
    pub bytes: u64,
    pub found: Found,
}

/// A batch, ready to draw.
pub struct Drawn {
    pub group: wgpu::BindGroup,
    pub vertices: u32,
}

/// Where the camera's matrices put triangles, which are kept relative to a centre.
pub struct Eye<'a> {
    pub rows: &'a ClipRows,
    pub center: DVec3,
    pub viewpoint: Viewpoint<'a>,
    /// Opaque surfaces are listed, and hide nothing.
    pub list_opaque: bool,
}

/// What is known of triangles once they are transformed.
#[derive(Debug, Clone, Copy)]
pub struct Found {
    /// Finite triangles whose transformed values are not.
    pub rejected: u64,
    /// Of those that are listed.
    pub listed: Extent,
}

impl Found {
    const NOTHING: Self = Self { rejected: 0, listed: Extent::NOTHING };

    fn join(self, other: Self) -> Self {
        Self { rejected: self.rejected + other.rejected, listed: self.listed.join(other.listed) }
    }
}

impl Geometry {
    pub fn upload(
        gpu: &Gpu,
        layout: &wgpu::BindGroupLayout,
        scene: &Scene,
        eye: &Eye,
        view: &wgpu::Buffer,
    ) -> Result<Self> {
        let states: Vec<_> = scene.meshes.iter().map(mesh_state).collect();
        let meshes = with_contents(gpu, "meshes", BufferUsages::STORAGE, &states);
        let triangles = scene.triangle_count();
        let size = MAX_BATCH.min(gpu.adapter.max_binding / COLOR_BYTES) as usize;
        let mut geometry = Self { batches: Vec::new(), bytes: 0, found: Found::NOTHING };
        for first in (0..triangles).step_by(size) {
            let end = (first + size).min(triangles);
            let arrays = threads()?.install(|| Arrays::of(scene, eye, first, end));
            geometry.found = geometry.found.join(arrays.found);
            geometry.bytes += arrays.bytes();
            let batch = Batch {
                first_primitive: first as u32,
                colors_per_triangle: (arrays.colors.len() / (end - first)) as u32,
                pad: [0; 2],
            };
            let group = bind(
                gpu,
                "geometry",
                layout,
                &[
                    view.into(),
                    (&with_contents(gpu, "batch", BufferUsages::UNIFORM, &[batch])).into(),
                    (&with_contents(gpu, "positions", BufferUsages::STORAGE, &arrays.positions)).into(),
                    (&with_contents(gpu, "colors", BufferUsages::STORAGE, &arrays.colors)).into(),
                    (&with_contents(gpu, "mesh ids", BufferUsages::STORAGE, &arrays.mesh_ids)).into(),
                    (&meshes).into(),
                ],
            );
            geometry.batches.push(Drawn { group, vertices: 3 * (end - first) as u32 });
        }
        Ok(geometry)
    }

    pub fn draw(&self, pass: &mut wgpu::RenderPass) {
        for batch in &self.batches {
            pass.set_bind_group(0, &batch.group, &[]);
            pass.draw(0..batch.vertices, 0..1);
        }
    }
}

fn mesh_state(mesh: &Mesh) -> MeshState {
    MeshState {
        alpha_cutoff: mesh.alpha_cutoff as f32,
        is_opaque: u32::from(mesh.opaque),
        cull: match mesh.cull {
            Cull::None => 0,
            Cull::Back => 1,
            Cull::Front => 2,
        },
        blend: u32::from(mesh.blend),
    }
}

/// A batch as the shaders read it.
struct Arrays {
    positions: Vec<[[f32; 3]; 3]>,
    /// One a triangle, or three.
    colors: Vec<[f32; 4]>,
    mesh_ids: Vec<u32>,
    found: Found,
}

impl Arrays {
    fn of(scene: &Scene, eye: &Eye, first: usize, end: usize) -> Self {
        let located = |primitive: usize| {
            let (mesh, face) = scene.locate(primitive);
            let ids = scene.meshes[mesh].vertex_ids(face);
            (mesh, face, ids)
        };
        let (first_mesh, last_mesh) = (scene.locate(first).0, scene.locate(end - 1).0);
        let flat = scene.meshes[first_mesh..=last_mesh]
            .iter()
            .all(|m| matches!(m.colors.rate, Rate::One | Rate::Face) || m.face_count() == 0);
        let corners = if flat { 1 } else { 3 };
        let mut arrays = Self {
            positions: vec![[[0.0; 3]; 3]; end - first],
            colors: vec![[0.0; 4]; corners * (end - first)],
            mesh_ids: vec![0; end - first],
            found: Found::NOTHING,
        };
        arrays.found = (arrays.positions.par_iter_mut())
            .zip(arrays.colors.par_chunks_mut(corners))
            .zip(arrays.mesh_ids.par_iter_mut())
            .enumerate()
            .map(|(i, ((positions, colors), mesh_id))| {
                let (mesh, face, ids) = located(first + i);
                let source = &scene.meshes[mesh];
                *mesh_id = mesh as u32;
                colors.copy_from_slice(&source.corner_colors::<f32>(face, ids)[..corners]);
                let relative = ids.map(|id| source.positions.get(id) - eye.center);
                if !relative.iter().all(|&p| eye.rows.representable(p)) {
                    // All corners stay in one point, which covers nothing.
                    return Found { rejected: 1, ..Found::NOTHING };
                }
                *positions = relative.map(|p| p.as_vec3().to_array());
                if source.opaque && !eye.list_opaque {
                    return Found::NOTHING;
                }
                Found { listed: eye.viewpoint.extent(relative), ..Found::NOTHING }
            })
            .reduce(|| Found::NOTHING, Found::join);
        arrays
    }

    fn bytes(&self) -> u64 {
        (size_of_val(&*self.positions) + size_of_val(&*self.colors) + size_of_val(&*self.mesh_ids)) as u64
    }
}
