// What the stages after the build see: lists to read, and where results go.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> band: Band;
@group(0) @binding(2) var<storage, read> heads: array<u32>;
@group(0) @binding(3) var<storage, read> node_color: array<vec4f>;
@group(0) @binding(4) var<storage, read> node_order: array<vec2u>;
@group(0) @binding(5) var<storage, read> node_next: array<u32>;
@group(0) @binding(6) var<storage, read_write> image: array<vec4f>;
@group(0) @binding(7) var<storage, read_write> counts: array<u32>;
@group(0) @binding(8) var background_texture: texture_2d<f32>;

// pixel: of the band.
fn background_of(pixel: u32) -> vec4f {
    if band.background_texture == 0u {
        return view.background;
    }
    let at = vec2u(pixel % band.width + band.x0, pixel / band.width + band.y0);
    return textureLoad(background_texture, at, 0);
}
