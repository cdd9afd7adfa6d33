//! The scene on the device, as it was given: vertices, faces and colours, which no camera changes.

use std::borrow::Cow;

use rayon::prelude::*;
use wgpu::BufferUsages;

use super::buffers::{storage, with_contents};
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
        let biggest = [arrays.positions.bytes(), arrays.faces.bytes(), arrays.colors.bytes()];
        if let Some(&bytes) = biggest.iter().find(|&&bytes| bytes > largest) {
            return Err(Error::Capacity {
                what: "the scene's vertices, faces or colours".into(),
                needed: bytes,
                limit: largest,
                advice: "that is what this device binds at once: device=\"cpu\" has no such limit, and \
                         pipeline=\"linked_list\" takes geometry in parts"
                    .into(),
            });
        }
        gpu.checked("uploading the scene", || {
            let made = Self {
                positions: arrays.positions.upload(gpu, "positions"),
                position_rests: arrays.rests.upload(gpu, "position rests"),
                faces: arrays.faces.upload(gpu, "faces"),
                colors: arrays.colors.upload(gpu, "colors"),
                mesh_ids: arrays.mesh_ids.upload(gpu, "mesh ids"),
                meshes: with_contents(gpu, "meshes", BufferUsages::STORAGE, &arrays.meshes),
                triangles: arrays.mesh_ids.len as u32,
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

/// One array of the device from those of the meshes, which are the user's own where they can be: such go to the device
/// without another copy.
struct Joined<'a, T: Clone> {
    parts: Vec<Cow<'a, [T]>>,
    len: usize,
}

impl<T: Clone> Default for Joined<'_, T> {
    fn default() -> Self {
        Self { parts: Vec::new(), len: 0 }
    }
}

impl<'a, T: bytemuck::Pod> Joined<'a, T> {
    fn push(&mut self, part: impl Into<Cow<'a, [T]>>) {
        let part = part.into();
        self.len += part.len();
        self.parts.push(part);
    }

    fn bytes(&self) -> u64 {
        (self.len * size_of::<T>()) as u64
    }

    fn upload(&self, gpu: &Gpu, label: &str) -> wgpu::Buffer {
        let buffer = storage(gpu, label, self.bytes());
        let mut offset = 0;
        for part in &self.parts {
            let bytes: &[u8] = bytemuck::cast_slice(part);
            gpu.queue.write_buffer(&buffer, offset, bytes);
            offset += bytes.len() as u64;
        }
        buffer
    }
}

#[derive(Default)]
struct Arrays<'a> {
    positions: Joined<'a, [f32; 3]>,
    rests: Joined<'a, [f32; 3]>,
    faces: Joined<'a, [u32; 3]>,
    colors: Joined<'a, [f32; 4]>,
    mesh_ids: Joined<'a, u32>,
    meshes: Vec<MeshInfo>,
}

impl<'a> Arrays<'a> {
    fn of(scene: &Scene<'a>) -> Self {
        let mut arrays = Self::default();
        for (id, mesh) in scene.meshes.iter().enumerate() {
            let faces = mesh.face_count();
            let first_vertex = arrays.positions.len as u32;
            let mut info = mesh_info(mesh);
            (info.first_triangle, info.first_vertex, info.first_color) =
                (arrays.faces.len as u32, first_vertex, arrays.colors.len as u32);
            if faces == 0 {
                arrays.meshes.push(info); // its colours would shift those of triangles
                continue;
            }
            match mesh.positions {
                Positions::F32(given) => arrays.positions.push(given),
                Positions::F64(given) => {
                    info.is_double = u32::from(given.par_iter().flatten().any(|&v| split(v).1 != 0.0));
                    let part = |of: fn((f32, f32)) -> f32| -> Vec<[f32; 3]> {
                        given.par_iter().map(|p| p.map(|v| of(split(v)))).collect()
                    };
                    arrays.positions.push(part(|(high, _)| high));
                    if info.is_double == 1 {
                        // Vertices before these were floats.
                        arrays.rests.push(vec![[0.0; 3]; first_vertex as usize - arrays.rests.len]);
                        arrays.rests.push(part(|(_, rest)| rest));
                    }
                }
            }
            match mesh.faces {
                Some(given) if first_vertex == 0 => arrays.faces.push(given),
                Some(given) => {
                    let moved: Vec<_> = given.par_iter().map(|f| f.map(|v| v + first_vertex)).collect();
                    arrays.faces.push(moved);
                }
                None => {
                    let corners = |f| [0, 1, 2].map(|i| first_vertex + 3 * f + i);
                    arrays.faces.push((0..faces as u32).into_par_iter().map(corners).collect::<Vec<_>>());
                }
            }
            match mesh.colors.values {
                ColorValues::F32(given) => arrays.colors.push(given),
                ColorValues::F64(given) => {
                    let rounded: Vec<_> = given.par_iter().map(|c| c.map(|v| v as f32)).collect();
                    arrays.colors.push(rounded);
                }
            }
            arrays.mesh_ids.push(vec![id as u32; faces]);
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
