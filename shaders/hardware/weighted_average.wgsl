// Weighted average: sums, and the number of fragments beside them, added to.

@group(1) @binding(0) var sums: texture_2d<f32>;
@group(1) @binding(1) var counts: texture_2d<f32>;

struct First {
    @location(0) sum: vec4f,
    @location(1) count: vec4f,
}

fn first(s: State) -> First {
    return First(s.sum, vec4f(f32(s.count), 0.0, 0.0, 0.0));
}

fn seen_all(pixel: vec2u) -> State {
    return State(textureLoad(sums, pixel, 0), u32(textureLoad(counts, pixel, 0).r));
}
