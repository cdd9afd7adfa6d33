// What a pixel's draws come to.

@group(1) @binding(0) var sums: texture_2d<f32>;
@group(1) @binding(1) var coverages: texture_2d<f32>;

@fragment
fn fs_composite(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let pixel = vec2u(at.xy);
    return estimated(coverage_at(coverages, pixel), textureLoad(sums, pixel, 0), behind(pixel));
}
