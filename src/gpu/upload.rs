//! The scene on the device, as it was given: vertices, faces and colours, which no camera changes.

use rayon::prelude::*;
use wgpu::BufferUsages;

use super::buffers::with_contents;
use super::device::Gpu;
use super::uniforms::MeshInfo;
use crate::error::{Error, Result};
use crate::real::split;
use crate::scene::{ColorValues, Cull, Mesh, Positions, Rate, Scene};
use crate::threads::threads;

/// Bits of a triangle's flags that its mesh decides (shaders/tiles/triangle.wgsl).
const GRADIENT: u32 = 4;
const BY_CORNER: u32 = 8;
const OPAQUE: u32 = 16;
const CUT_OUT: u32 = 32;
const BLEND_SHIFT: u32 = 24;

pub struct Uploaded {
    pub positions: wgpu::Buffer,
    /// What rounding double positions to floats left.
    pub position_rests: wgpu::Buffer,
    /// Three vertices a triangle, numbered over all meshes.
    pub faces: wgpu::Buffer,
    pub colors: wgpu::Buffer,
    pub mesh_ids: wgpu::Buffer,
    pub meshes: wgpu::Buffer,
    pub triangles: u32,
    pub bytes: u64,
}

impl Uploaded {
    pub fn new(gpu: &Gpu, scene: &Scene) -> Result<Self> {
        let arrays = threads()?.install(|| Arrays::of(scene));
        let largest = gpu.adapter.max_binding;
        let biggest =
            [size_of_val(&*arrays.positions), size_of_val(&*arrays.faces), size_of_val(&*arrays.colors)];
        if let Some(&bytes) = biggest.iter().find(|&&bytes| bytes as u64 > largest) {
            return Err(Error::Capacity {
                what: "the scene's vertices, faces or colours".into(),
                needed: bytes as u64,
                limit: largest,
                advice: "that is what this device binds at once: device=\"cpu\" has no such limit, and \
                         pipeline=\"linked_list\" takes geometry in parts"
                    .into(),
            });
        }
        gpu.checked("uploading the scene", || {
            let storage = BufferUsages::STORAGE;
            let made = Self {
                positions: with_contents(gpu, "positions", storage, &arrays.positions),
                position_rests: with_contents(gpu, "position rests", storage, &arrays.rests),
                faces: with_contents(gpu, "faces", storage, &arrays.faces),
                colors: with_contents(gpu, "colors", storage, &arrays.colors),
                mesh_ids: with_contents(gpu, "mesh ids", storage, &arrays.mesh_ids),
                meshes: with_contents(gpu, "meshes", storage, &arrays.meshes),
                triangles: arrays.mesh_ids.len() as u32,
                bytes: 0,
            };
            let all = [
                &made.positions,
                &made.position_rests,
                &made.faces,
                &made.colors,
                &made.mesh_ids,
                &made.meshes,
            ];
            let bytes = all.iter().map(|b| b.size()).sum();
            Ok(Self { bytes, ..made })
        })
    }
}

#[derive(Default)]
struct Arrays {
    positions: Vec<[f32; 3]>,
    rests: Vec<[f32; 3]>,
    faces: Vec<[u32; 3]>,
    colors: Vec<[f32; 4]>,
    mesh_ids: Vec<u32>,
    meshes: Vec<MeshInfo>,
}

impl Arrays {
    fn of(scene: &Scene) -> Self {
        let mut arrays = Self::default();
        for (id, mesh) in scene.meshes.iter().enumerate() {
            let faces = mesh.face_count();
            let first_vertex = arrays.positions.len() as u32;
            let mut info = mesh_info(mesh);
            (info.first_triangle, info.first_vertex, info.first_color) =
                (arrays.faces.len() as u32, first_vertex, arrays.colors.len() as u32);
            if faces == 0 {
                arrays.meshes.push(info); // its colours would shift those of triangles
                continue;
            }
            match mesh.positions {
                Positions::F32(given) => arrays.positions.extend_from_slice(given),
                Positions::F64(given) => {
                    info.is_double = u32::from(given.par_iter().flatten().any(|&v| split(v).1 != 0.0));
                    arrays.positions.par_extend(given.par_iter().map(|p| p.map(|v| split(v).0)));
                    if info.is_double == 1 {
                        // Vertices before these were floats.
                        arrays.rests.resize(first_vertex as usize, [0.0; 3]);
                        arrays.rests.par_extend(given.par_iter().map(|p| p.map(|v| split(v).1)));
                    }
                }
            }
            match mesh.faces {
                Some(given) => {
                    arrays.faces.par_extend(given.par_iter().map(|face| face.map(|v| v + first_vertex)));
                }
                None => arrays.faces.par_extend(
                    (0..faces as u32).into_par_iter().map(|f| [0, 1, 2].map(|i| first_vertex + 3 * f + i)),
                ),
            }
            match mesh.colors.values {
                ColorValues::F32(given) => arrays.colors.extend_from_slice(given),
                ColorValues::F64(given) => {
                    arrays.colors.par_extend(given.par_iter().map(|c| c.map(|v| v as f32)));
                }
            }
            arrays.mesh_ids.resize(arrays.faces.len(), id as u32);
            arrays.meshes.push(info);
        }
        arrays
    }
}

fn mesh_info(mesh: &Mesh) -> MeshInfo {
    let when = |condition: bool, flag: u32| if condition { flag } else { 0 };
    let rate = mesh.colors.rate;
    MeshInfo {
        first_triangle: 0,
        first_vertex: 0,
        first_color: 0,
        rate: match rate {
            Rate::One => 0,
            Rate::Vertex => 1,
            Rate::Face => 2,
            Rate::Corner => 3,
        },
        cull: match mesh.cull {
            Cull::None => 0,
            Cull::Back => 1,
            Cull::Front => 2,
        },
        flags: when(matches!(rate, Rate::Vertex | Rate::Corner), GRADIENT)
            | when(rate == Rate::Corner, BY_CORNER)
            | when(mesh.opaque, OPAQUE)
            | when(mesh.alpha_cutoff > 0.0, CUT_OUT)
            | u32::from(mesh.blend) << BLEND_SHIFT,
        alpha_cutoff: mesh.alpha_cutoff as f32,
        is_double: 0,
    }
}
