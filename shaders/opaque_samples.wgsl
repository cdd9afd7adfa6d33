// The same with several samples a pixel: a depth for each, from the plane that translucent fragments are compared
// with, and the one colour of the fragment.

@vertex
fn vs_opaque(@builtin(vertex_index) index: u32) -> Varyings {
    return rasterise(index, true);
}

struct Opaque {
    @location(0) color: vec4f,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn fs_opaque(v: Varyings, @builtin(sample_index) sample: u32) -> Opaque {
    // Shading samples apart, the hardware's mask has one bit; `location` finds the others.
    let shaded = shade(v, location(v, 1u << sample));
    let value = value_at(v, sample_position(v, sample));
    if beyond_depth_range(value) || is_cut_out(v, shaded.color) {
        discard;
    }
    return Opaque(vec4f(shaded.color.rgb, 1.0), window_depth(value));
}
