//! The camera as shaders see it.

use glam::DVec3;

use super::uniforms::{Eye, View};
use crate::camera::{Camera, ClipRows};
use crate::fragments::Background;
use crate::frame::{Lists, Request};
use crate::real::split;

/// The view as the tile rasteriser sets triangles up, in the CPU's precision and roundings.
pub fn eye_uniform(camera: &Camera, rows: &ClipRows, center: DVec3, (width, height): (u32, u32)) -> Eye {
    let (near, far) = camera.depth_range();
    let [x, y, z] = center.to_array().map(split);
    Eye {
        rows: [rows.x, rows.y, rows.w, rows.depth].map(|r| r.to_array().map(|v| v as f32)),
        center_high: [x.0, y.0, z.0, 0.0],
        center_low: [x.1, y.1, z.1, 0.0],
        to_pixels: [2.0 / width as f32, -2.0 / height as f32],
        near: near as f32,
        far: (far as f32).min(f32::MAX),
        triangles: 0,
        piece_capacity: 0,
        pad0: 0,
        pad1: 0,
    }
}

pub fn view_uniform(
    camera: &Camera,
    rows: &ClipRows,
    (low, high): (f64, f64),
    request: &Request,
    background: &Background<f32>,
) -> View {
    let (near, far) = camera.depth_range();
    let perspective = camera.is_perspective();
    // Window z of a parallel view spans the scene, with room for rounding.
    let (low, high) = (low.max(near), high.min(far).max(low.max(near)));
    let room = 1e-5 * (high - low).max(low.abs()).max(high.abs()).max(f64::MIN_POSITIVE);
    let scale = 1.0 / (high - low + 2.0 * room);
    // The shader compares rounded depths: what lies exactly at near or far is kept.
    let slack = 2f64.powi(-21);
    let beside = |depth: f64, sign: f64| depth + sign * slack * depth.abs();
    let (near, far) = if perspective {
        (near, (1.0 - slack) / far) // the least 1/w; the hardware clips at near
    } else {
        (beside(near, -1.0), beside(far, 1.0))
    };
    View {
        rows: [rows.x, rows.y, rows.w, rows.depth].map(|r| r.as_vec4().to_array()),
        background: match background {
            Background::Constant(c) => *c,
            Background::Image(_) => [0.0; 4],
        },
        width: request.width,
        height: request.height,
        perspective: u32::from(perspective),
        list_opaque: u32::from(request.lists == Lists::All),
        near: near as f32,
        far: far.min(f64::from(f32::MAX)) as f32, // 0 or largest where there is none
        z_offset: ((high + room) * scale) as f32,
        z_scale: scale as f32,
        code_origin: 0.0,
        code_scale: 0.0,
        code_step: 0.0,
        background_texture: u32::from(matches!(background, Background::Image(_))),
        zero: 0,
        least_transmittance: request.least_transmittance as f32,
        pad0: 0,
        pad1: 0,
    }
}
