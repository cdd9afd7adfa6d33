//! Structs that shaders see too. They are written twice; a test holds the two together.

use bytemuck::{Pod, Zeroable};

use crate::methods::{Method, Values};

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct View {
    pub rows: [[f32; 4]; 4],
    pub background: [f32; 4],
    pub width: u32,
    pub height: u32,
    pub perspective: u32,
    pub list_opaque: u32,
    pub near: f32,
    pub far: f32,
    pub z_offset: f32,
    pub z_scale: f32,
    pub code_origin: f32,
    pub code_scale: f32,
    pub code_step: f32,
    pub background_texture: u32,
    /// 0, which shaders cannot know when they are compiled.
    pub zero: u32,
    /// As in `Request`.
    pub least_transmittance: f32,
    pub pad0: u32,
    pub pad1: u32,
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct Band {
    pub x0: u32,
    pub y0: u32,
    pub width: u32,
    pub height: u32,
    pub capacity: u32,
    pub trip_budget: u32,
    pub pad: [u32; 2],
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct Batch {
    pub first_primitive: u32,
    pub colors_per_triangle: u32,
    pub pad: [u32; 2],
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct MeshState {
    pub alpha_cutoff: f32,
    pub is_opaque: u32,
    pub cull: u32,
    pub blend: u32,
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct LongPixel {
    pub pixel: u32,
    pub first: u32,
    pub count: u32,
    pub kept: u32,
    pub link: u32,
    pub written: u32,
    pub scanned: u32,
    pub fragments: u32,
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct LongSample {
    pub composited: u32,
    pub pad: [u32; 3],
    pub saved: [[f32; 4]; 2],
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct Round {
    pub width: u32,
    pub long_count: u32,
    pub chunk_count: u32,
    pub first_pixel: u32,
    pub by_order: u32,
    pub block_count: u32,
    pub pad0: u32,
    pub pad1: u32,
}

/// The view as triangle setup needs it.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct Eye {
    pub rows: [[f32; 4]; 4],
    pub center_high: [f32; 4],
    pub center_low: [f32; 4],
    pub to_pixels: [f32; 2],
    pub near: f32,
    pub far: f32,
    pub triangles: u32,
    pub piece_capacity: u32,
    pub pad0: u32,
    pub pad1: u32,
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct MeshInfo {
    pub first_triangle: u32,
    pub first_vertex: u32,
    pub first_color: u32,
    pub rate: u32,
    pub cull: u32,
    pub flags: u32,
    pub alpha_cutoff: f32,
    pub is_double: u32,
}

/// How an image is cut into tiles and bins of them.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct Grid {
    pub tiles_x: u32,
    pub tiles_y: u32,
    pub bins_x: u32,
    pub bins_y: u32,
    pub bin_shift: u32,
    pub triangles: u32,
    pub chunks: u32,
    pub blocks: u32,
    pub bin_capacity: u32,
    pub tile_capacity: u32,
    pub trips: u32,
    pub parts: u32,
    pub block: u32,
    pub first_row: u32,
    pub pad0: u32,
    pub pad1: u32,
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct Window {
    pub first: u32,
    pub count: u32,
    pub tiles_x: u32,
    pub parts: u32,
    pub first_row: u32,
    pub list_capacity: u32,
    pub pad0: u32,
    pub pad1: u32,
}

/// Parameters of a method that change without its shader, and the first row of pixels that it has.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct MethodUniform {
    pub nearest: f32,
    pub farthest: f32,
    pub beta: f32,
    pub seed: u32,
    pub first_row: u32,
    pub passes: u32,
    pub pad1: u32,
    pub pad2: u32,
}

impl MethodUniform {
    pub fn new(method: &Method, first_row: u32, passes: u32) -> Self {
        let Values { range: (nearest, farthest), beta, seed } = method.values();
        let (nearest, farthest, beta) = (nearest as f32, farthest as f32, beta as f32);
        Self { nearest, farthest, beta, seed, first_row, passes, pad1: 0, pad2: 0 }
    }
}

#[cfg(test)]
mod tests {
    use std::mem::{offset_of, size_of};

    use super::*;
    use crate::gpu::variant::Variant;
    use crate::gpu::variant::tests::plain;
    use crate::shader::Composed;

    /// Size, and offset of each member, of a struct in a shader module.
    fn wgsl(composed: &Composed, name: &str) -> (usize, Vec<(String, usize)>) {
        let parsed = naga::front::wgsl::parse_str(&composed.text).unwrap();
        let found = parsed.types.iter().find(|(_, t)| t.name.as_deref() == Some(name));
        match &found.unwrap().1.inner {
            naga::TypeInner::Struct { members, span } => (
                *span as usize,
                members.iter().map(|m| (m.name.clone().unwrap(), m.offset as usize)).collect(),
            ),
            other => panic!("{name} is {other:?}"),
        }
    }

    macro_rules! same {
        ($module:expr, $name:ident { $($member:ident),* }) => {
            same!($module, stringify!($name), $name { $($member),* })
        };
        ($module:expr, $wgsl_name:expr, $name:ident { $($member:ident),* }) => {
            let members = vec![$((stringify!($member).to_string(), offset_of!($name, $member))),*];
            assert_eq!(wgsl($module, $wgsl_name), (size_of::<$name>(), members));
        };
    }

    #[test]
    fn structs_have_the_layout_that_the_shaders_expect() {
        let (opaque, long) = (plain().opaque().unwrap(), plain().long().unwrap());
        same!(
            &long,
            View {
                rows,
                background,
                width,
                height,
                perspective,
                list_opaque,
                near,
                far,
                z_offset,
                z_scale,
                code_origin,
                code_scale,
                code_step,
                background_texture,
                zero,
                least_transmittance,
                pad0,
                pad1
            }
        );
        same!(&long, Band { x0, y0, width, height, capacity, trip_budget, pad });
        same!(&opaque, Batch { first_primitive, colors_per_triangle, pad });
        same!(&opaque, MeshState { alpha_cutoff, is_opaque, cull, blend });
        same!(&long, LongPixel { pixel, first, count, kept, link, written, scanned, fragments });
        same!(
            &long,
            Round { width, long_count, chunk_count, first_pixel, by_order, block_count, pad0, pad1 }
        );
        let tiles = crate::gpu::tiles::modules(&Variant { tiles: true, ..plain() });
        let [setup, bin, _, walk, .., stream] = tiles.as_slice() else { panic!("the modules of tiles") };
        same!(
            setup,
            Eye {
                rows,
                center_high,
                center_low,
                to_pixels,
                near,
                far,
                triangles,
                piece_capacity,
                pad0,
                pad1
            }
        );
        same!(
            setup,
            MeshInfo {
                first_triangle,
                first_vertex,
                first_color,
                rate,
                cull,
                flags,
                alpha_cutoff,
                is_double
            }
        );
        same!(
            bin,
            Grid {
                tiles_x,
                tiles_y,
                bins_x,
                bins_y,
                bin_shift,
                triangles,
                chunks,
                blocks,
                bin_capacity,
                tile_capacity,
                trips,
                parts,
                block,
                first_row,
                pad0,
                pad1
            }
        );
        same!(walk, Window { first, count, tiles_x, parts, first_row, list_capacity, pad0, pad1 });
        same!(
            stream,
            "Method",
            MethodUniform { nearest, farthest, beta, seed, first_row, passes, pad1, pad2 }
        );
        let (size, members) = wgsl(&long, "LongSample");
        assert_eq!(size, size_of::<LongSample>());
        assert_eq!(members[1], ("saved".to_string(), offset_of!(LongSample, saved)));
    }
}
