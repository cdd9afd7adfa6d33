// Both ends over what is behind them.

@group(1) @binding(0) var front_rgbs: texture_2d<f32>;
@group(1) @binding(1) var front_coverages: texture_2d<f32>;
@group(1) @binding(2) var back_colors: texture_2d<f32>;
@group(1) @binding(3) var back_transmittances: texture_2d<f32>;

@fragment
fn fs_composite(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let pixel = vec2u(at.xy);
    let c = coverage_at(front_coverages, pixel);
    let front = Layer(vec4f(textureLoad(front_rgbs, pixel, 0).rgb, c.alpha), c.transmittance);
    let back = Layer(textureLoad(back_colors, pixel, 0), textureLoad(back_transmittances, pixel, 0).r);
    return layer_over(layer_onto(front, back), behind(pixel));
}
