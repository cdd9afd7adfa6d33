//! Eight triangles at a time give the bits of one by one.

use glam::DMat4;

use super::eight::add_faces;
use super::triangle::{Faces, Part};
use super::{Record, view_of};
use crate::camera::Camera;
use crate::cpu::lanes::Instructions;
use crate::cpu::plane::Plane;
use crate::scene::{ColorValues, Colors, Cull, Mesh, Positions, Rate, Scene};

fn bits(part: &Part<f32>) -> Vec<u32> {
    let plane = |p: &Plane<f32>| [p.value, p.gx, p.gy, p.low, p.high].map(f32::to_bits);
    let record = |r: &Record<f32>| {
        let ints = r.x.iter().chain(&r.y).map(|&v| v as u32).chain([r.gradient, r.primitive, r.mesh]);
        let floats = r.anchor.iter().chain(&r.color).map(|v| v.to_bits()).chain(plane(&r.key_plane));
        ints.chain(floats).collect::<Vec<_>>()
    };
    part.records
        .iter()
        .flat_map(record)
        .chain(part.gradients.iter().flatten().flat_map(plane))
        .chain([part.rejected as u32, u32::from(part.has_pieces)])
        .collect()
}

#[test]
fn eight_at_a_time_give_the_bits_of_one_by_one() {
    let mut state = 3_u64;
    let mut unit = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 40) as f32 / (1 << 24) as f32
    };
    let mut positions: Vec<[f32; 3]> = Vec::new();
    for i in 0..3 * 1003 {
        // Small and large, near and far, some cut, some behind the eye, some beside the view, some huge.
        let size = [0.1, 1.0, 5.0, 1e3, 1e20, 1e36][i / 3 % 6];
        let mut next = || size * (2.0 * unit() - 1.0);
        positions.push([next(), next(), -next().abs() - 0.01]);
    }
    for i in (0..positions.len() - 3).step_by(15) {
        (positions[i][0], positions[i][2]) = (positions[i + 1][0], positions[i + 1][2]); // x ties
        positions[i + 4] = positions[i + 3]; // a line
    }
    positions.iter_mut().step_by(31).for_each(|p| p[2] = -p[2]);
    let colors: Vec<[f32; 4]> = positions.iter().map(|_| std::array::from_fn(|_| unit())).collect();
    let mut seen = (0, 0, 0);
    for perspective in [false, true] {
        let mut rows = DMat4::IDENTITY.to_cols_array();
        if perspective {
            (rows[14], rows[15]) = (-1.0, 0.0);
        }
        let camera = Camera::from_rows(&DMat4::IDENTITY.to_cols_array(), &rows, None, Some(50.0)).unwrap();
        for (cull, rate) in [(Cull::None, Rate::Vertex), (Cull::Back, Rate::Face), (Cull::Front, Rate::One)] {
            let n = if rate == Rate::Vertex { positions.len() } else { positions.len() / 3 };
            let values = ColorValues::F32(&colors[..if rate == Rate::One { 1 } else { n }]);
            let mesh = Mesh {
                positions: Positions::F32(&positions),
                faces: None,
                colors: Colors { rate, values },
                opaque: false,
                alpha_cutoff: 0.0,
                cull,
                blend: 0,
            };
            let scene = Scene::new(vec![mesh]).unwrap();
            let view = view_of::<f32>(&scene, &camera, (200, 100), false);
            let faces = Faces { view: &view, mesh: &scene.meshes[0], id: 0, first_primitive: 0 };
            let all = 0..scene.triangle_count();
            let mut wanted = Part::default();
            wanted.add_each(&faces, all.clone());
            for instructions in [Instructions::Any, Instructions::detected()] {
                let mut part = Part::default();
                add_faces(instructions, &mut part, &faces, all.clone());
                assert!(bits(&part) == bits(&wanted), "{perspective} {cull:?} {instructions:?}");
            }
            seen.0 += wanted.records.len();
            seen.1 += wanted.gradients.len();
            seen.2 += usize::from(wanted.has_pieces);
        }
    }
    assert!(seen.0 > 500 && seen.1 > 200 && seen.2 > 0, "{seen:?}");
}
