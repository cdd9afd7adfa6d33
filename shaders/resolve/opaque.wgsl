@group(0) @binding(7) var opaque_color: texture_2d<f32>;

fn opaque_at(at: vec2u, s: u32) -> vec4f {
    return textureLoad(opaque_color, at, 0);
}
