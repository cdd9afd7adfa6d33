// Coverage of layers that are put under each other: alpha in red and transmittance in alpha, so that one target has A + T α
// and T (1 − α).

// What one fragment's coverage adds.
fn covers(c: Coverage) -> vec4f {
    return vec4f(c.alpha, 0.0, 0.0, c.alpha);
}

fn coverage_at(coverages: texture_2d<f32>, pixel: vec2u) -> Coverage {
    let c = textureLoad(coverages, pixel, 0);
    return Coverage(c.r, c.a);
}
