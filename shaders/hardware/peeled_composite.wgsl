// All layers over what is behind them.

@group(1) @binding(0) var rgbs: texture_2d<f32>;
@group(1) @binding(1) var coverages: texture_2d<f32>;

@fragment
fn fs_composite(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let pixel = vec2u(at.xy);
    let c = coverage_at(coverages, pixel);
    return layer_over(Layer(vec4f(textureLoad(rgbs, pixel, 0).rgb, c.alpha), c.transmittance), behind(pixel));
}
