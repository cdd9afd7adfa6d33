// What a pixel's draws come to.

@group(1) @binding(0) var sums: texture_2d<f32>;
@group(1) @binding(1) var absorbances: texture_2d<f32>;

@fragment
fn fs_composite(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let pixel = vec2u(at.xy);
    let coverage = coverage_of(textureLoad(absorbances, pixel, 0).r);
    return estimated(coverage, textureLoad(sums, pixel, 0), behind(pixel));
}
