//! The quick way gives the general way's bits, whatever the instructions.

use glam::DMat4;

use crate::camera::Camera;
use crate::cpu::lanes::Instructions;
use crate::cpu::render_with;
use crate::fragments::Background;
use crate::frame::{BlendOrder, ListOptions, Lists, MsaaResolve, Output, Request, Sort, Storage};
use crate::node_format::NodeFormat;
use crate::scene::{ColorValues, Colors, Cull, Mesh, Positions, Rate, Scene};

const WIDTH: u32 = 75;
const HEIGHT: u32 = 43;

/// A small deterministic generator: the scenes need spread, not quality.
struct Lcg(u64);
impl Lcg {
    fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }

    /// Triangles within `size` of their centre, which land in and beside the view.
    fn soup(&mut self, n: usize, size: f32, depth: f32) -> Vec<[f32; 3]> {
        let mut positions = Vec::new();
        for _ in 0..n {
            let center = [2.4 * self.unit() - 1.2, 2.4 * self.unit() - 1.2];
            for _ in 0..3 {
                let mut around = |c: f32| c + size * (2.0 * self.unit() - 1.0);
                let (x, y) = (around(center[0]), around(center[1]));
                // A few depths only, so that some tie.
                let z = -depth - (4.0 * self.unit()).round() / 4.0;
                positions.push([x * -z, y * -z, z]);
            }
        }
        positions
    }
}

fn camera(perspective: bool) -> Camera {
    let mut projection = DMat4::IDENTITY.to_cols_array();
    if perspective {
        (projection[14], projection[15]) = (-1.0, 0.0);
    }
    Camera::from_rows(&DMat4::IDENTITY.to_cols_array(), &projection, None, None).unwrap()
}

fn request(sort: Sort, memory: Option<u64>) -> Request {
    Request {
        method: crate::methods::Method::Exact,
        width: WIDTH,
        height: HEIGHT,
        lists: Lists::Count,
        memory,
        samples: 1,
        msaa_resolve: MsaaResolve::PerPixel,
        sort,
        limit: None,
        blend_order: BlendOrder::FrontToBack,
        least_transmittance: 0.0,
        half_targets: false,
        lists_on_gpu: ListOptions {
            rasteriser: crate::frame::Rasteriser::Hardware,
            storage: Storage::Linked,
            format: NodeFormat::Float32,
            classes: vec![],
            fullscreen: false,
            blends: [].into(),
        },
    }
}

/// The image's bits, the counts, and the other numbers.
type All = (Vec<[u32; 4]>, Option<Vec<i32>>, u64, Option<u32>);

fn all_of(output: Output<f32>) -> All {
    let bits = output.image.iter().map(|rgba| rgba.map(f32::to_bits)).collect();
    (bits, output.counts, output.stats.fragments, output.stats.max_depth_complexity)
}

/// Renders every way, compares, and returns the depth complexity.
fn compare(positions: &[[f32; 3]], rate: Rate, perspective: bool, memory: Option<u64>) -> u32 {
    compare_with(None, positions, rate, perspective, memory)
}

/// The same with every third triangle opaque where its alpha is not below a cutoff.
fn compare_with(
    cutoff: Option<f64>,
    positions: &[[f32; 3]],
    rate: Rate,
    perspective: bool,
    memory: Option<u64>,
) -> u32 {
    let mut random = Lcg(5);
    let n = match rate {
        Rate::One => 1,
        Rate::Face => positions.len() / 3,
        Rate::Vertex | Rate::Corner => positions.len(),
    };
    let colors: Vec<[f32; 4]> = (0..n).map(|_| std::array::from_fn(|_| random.unit())).collect();
    let behind: Vec<[f32; 4]> = (0..WIDTH * HEIGHT).map(|_| std::array::from_fn(|_| random.unit())).collect();
    let mesh = Mesh {
        positions: Positions::F32(positions),
        faces: None,
        colors: Colors { rate, values: ColorValues::F32(&colors) },
        opaque: false,
        alpha_cutoff: 0.0,
        cull: Cull::None,
        blend: 0,
    };
    let mut meshes = vec![mesh];
    let faces: Vec<[u32; 3]> = (0..positions.len() as u32).step_by(9).map(|i| [i, i + 1, i + 2]).collect();
    if let Some(alpha_cutoff) = cutoff {
        // In front of the translucent, at their depth, and behind them.
        let colors = Colors { rate: Rate::Vertex, values: ColorValues::F32(&behind[..positions.len()]) };
        meshes.insert(0, Mesh { faces: Some(&faces), colors, opaque: true, alpha_cutoff, ..mesh });
        meshes.push(Mesh { alpha_cutoff: 0.0, ..meshes[0] });
    }
    let scene = Scene::new(meshes).unwrap();
    let mut deepest = 0;
    for background in [Background::Constant([0.5, 0.25, 1.0, 0.75]), Background::Image(&behind)] {
        let of = |instructions, sort| {
            let request = request(sort, memory);
            all_of(render_with(instructions, &scene, &camera(perspective), &request, background).unwrap())
        };
        let plain = of(Instructions::Any, Sort::Auto);
        assert!(plain == of(Instructions::detected(), Sort::Auto), "instructions");
        assert!(plain == of(Instructions::Any, Sort::Heap), "the general way");
        deepest = plain.3.unwrap();
    }
    deepest
}

#[test]
fn all_ways_give_the_same_bits() {
    for perspective in [false, true] {
        for rate in [Rate::One, Rate::Face, Rate::Vertex] {
            // Few and large, many and small, more than 16 in a pixel.
            for (n, size) in [(12, 2.0), (600, 0.06), (150, 0.8)] {
                compare(&Lcg(n).soup(n as usize, size, 1.0), rate, perspective, None);
            }
        }
    }
    // More than there are layers.
    assert!(compare(&Lcg(1).soup(1500, 3.0, 1.0), Rate::Face, false, None) > 255);
}

#[test]
fn opaque_surfaces_hide_the_same() {
    for perspective in [false, true] {
        for cutoff in [0.0, 0.6] {
            for rate in [Rate::One, Rate::Face, Rate::Vertex] {
                compare_with(Some(cutoff), &Lcg(4).soup(90, 0.5, 1.0), rate, perspective, None);
            }
        }
    }
}

#[test]
fn triangles_that_are_cut_go_the_general_way() {
    for rate in [Rate::Face, Rate::Vertex] {
        compare(&Lcg(3).soup(60, 30.0, -0.5), rate, true, None);
    }
}

#[test]
fn little_memory_makes_fewer_layers_and_the_same_image() {
    for memory in [1 << 19, 1 << 16] {
        assert!(compare(&Lcg(8).soup(300, 0.8, 1.0), Rate::Face, true, Some(memory)) > 17);
    }
}
