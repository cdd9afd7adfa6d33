@group(0) @binding(7) var<storage, read> opaque_colors: array<vec4f>;

fn opaque_at(at: vec2u, s: u32) -> vec4f {
    return opaque_colors[(at.y * view.width + at.x) * SAMPLES + s];
}
