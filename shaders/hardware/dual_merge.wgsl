// Puts the layers of both ends where they belong: under those in front, and over those behind.

@group(1) @binding(0) var fronts: texture_2d<f32>;
@group(1) @binding(1) var backs: texture_2d<f32>;

struct Merged {
    @location(0) front_rgb: vec4f,
    @location(1) front_coverage: vec4f,
    @location(2) back: vec4f,
    @location(3) back_covered: vec4f,
}

@fragment
fn fs_merge(@builtin(position) at: vec4f) -> Merged {
    let front = textureLoad(fronts, vec2u(at.xy), 0);
    let back = textureLoad(backs, vec2u(at.xy), 0);
    return Merged(front, covers(Coverage(front.a, 0.0)), back, vec4f(0.0, 0.0, 0.0, back.a));
}
