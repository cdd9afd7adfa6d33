// Opaque and alpha-tested geometry: its colour becomes the background of its pixels, its depth hides what
// is strictly behind it.

@vertex
fn vs_opaque(@builtin(vertex_index) index: u32) -> Varyings {
    return rasterise(index, true);
}

@fragment
fn fs_opaque(v: Varyings) -> @location(0) vec4f {
    let shaded = shade(v, v.position.xy);
    if beyond_depth_range(shaded.value) || is_cut_out(v, shaded.color) {
        discard;
    }
    return vec4f(shaded.color.rgb, 1.0);
}
