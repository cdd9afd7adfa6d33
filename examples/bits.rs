//! Writes the fragment lists of a few scenes as bytes, what is promised to the bit on every machine apart from what is
//! not: `cargo run --example bits -- DIRECTORY` makes the files `fragments`, `colors` and `image` there.

use std::error::Error;
use std::fs::write;
use std::path::PathBuf;

use abuffer::camera::Camera;
use abuffer::fragments::Background;
use abuffer::frame::{BlendOrder, ListOptions, Lists, MsaaResolve, Request, Sort, Storage};
use abuffer::node_format::NodeFormat;
use abuffer::render::on_cpu;
use abuffer::scene::{ColorValues, Colors, Cull, Mesh, Positions, Rate, Scene};
use bytemuck::cast_slice;

const SIZE: u32 = 96;
/// In NDC, around a centre in the view: small triangles, and ones that are cut.
const SIZES: [f32; 3] = [0.1, 0.6, 4.0];

fn main() -> Result<(), Box<dyn Error>> {
    let directory = PathBuf::from(std::env::args().nth(1).ok_or("usage: bits DIRECTORY")?);
    let (mut fragments, mut colors, mut image) = (Vec::new(), Vec::new(), Vec::new());
    for (perspective, samples) in [(false, 1), (true, 1), (true, 4)] {
        for size in SIZES {
            let (positions, rgba) = soup(size);
            let mesh = Mesh {
                positions: Positions::F32(&positions),
                faces: None,
                colors: Colors { rate: Rate::Vertex, values: ColorValues::F32(&rgba) },
                opaque: false,
                alpha_cutoff: 0.0,
                cull: Cull::None,
                blend: 0,
            };
            let background = Background::Constant([0.1, 0.2, 0.3, 1.0]);
            let output = on_cpu::<f32>(
                &Scene::new(vec![mesh])?,
                &camera(perspective)?,
                &request(samples),
                background,
            )?;
            let lists = output.fragments.ok_or("no lists")?;
            fragments.extend_from_slice(cast_slice(&lists.offsets));
            fragments.extend_from_slice(cast_slice(&lists.key));
            fragments.extend_from_slice(cast_slice(&lists.primitive));
            fragments.extend_from_slice(cast_slice(lists.coverage.as_deref().unwrap_or_default()));
            colors.extend_from_slice(cast_slice(&lists.color));
            image.extend_from_slice(cast_slice(&output.image));
        }
    }
    write(directory.join("fragments"), fragments)?;
    write(directory.join("colors"), colors)?;
    write(directory.join("image"), image)?;
    Ok(())
}

fn camera(perspective: bool) -> abuffer::error::Result<Camera> {
    let mut identity = [0.0; 16];
    (0..4).for_each(|i| identity[5 * i] = 1.0);
    let mut projection = identity;
    if perspective {
        (projection[14], projection[15]) = (-1.0, 0.0);
    }
    Camera::from_rows(&identity, &projection, Some(0.5), None)
}

/// Positions and colours of triangles, from a small deterministic generator.
fn soup(size: f32) -> (Vec<[f32; 3]>, Vec<[f32; 4]>) {
    let mut state = 7_u64;
    let mut unit = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 40) as f32 / (1 << 24) as f32
    };
    let (mut positions, mut colors) = (Vec::new(), Vec::new());
    for _ in 0..400 {
        let center = [2.0 * unit() - 1.0, 2.0 * unit() - 1.0];
        for _ in 0..3 {
            let depth = 0.4 + 2.0 * unit();
            let mut around = |c: f32| (c + size * (2.0 * unit() - 1.0)) * depth;
            positions.push([around(center[0]), around(center[1]), -depth]);
            colors.push(std::array::from_fn(|_| unit()));
        }
    }
    (positions, colors)
}

fn request(samples: u32) -> Request {
    Request {
        method: abuffer::methods::Method::Exact,
        width: SIZE,
        height: SIZE,
        lists: Lists::Translucent,
        memory: None,
        samples,
        msaa_resolve: MsaaResolve::PerPixel,
        sort: Sort::Auto,
        limit: None,
        blend_order: BlendOrder::FrontToBack,
        least_transmittance: 0.0,
        half_targets: false,
        lists_on_gpu: ListOptions {
            rasteriser: abuffer::frame::Rasteriser::Hardware,
            storage: Storage::Linked,
            format: NodeFormat::Float32,
            classes: vec![],
            fullscreen: false,
            blends: [].into(),
        },
    }
}
