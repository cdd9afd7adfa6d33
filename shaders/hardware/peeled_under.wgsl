// Puts a peeled layer under those before it: blended by their transmittance, which lies in alpha.

@group(1) @binding(0) var layer_colors: texture_2d<f32>;
@group(1) @binding(1) var orders: texture_2d<u32>;

struct Under {
    @location(0) rgb: vec4f,
    @location(1) coverage: vec4f,
}

@fragment
fn fs_under(@builtin(position) at: vec4f) -> Under {
    let pixel = vec2u(at.xy);
    if all(textureLoad(orders, pixel, 0).xy == FOUND_NONE) {
        discard;
    }
    let color = textureLoad(layer_colors, pixel, 0);
    return Under(vec4f(color.a * color.rgb, color.a), covers(coverage_add(coverage_none(), color.a)));
}
