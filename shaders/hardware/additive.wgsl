// Additive: one target, added to.

@group(1) @binding(0) var sums: texture_2d<f32>;

struct First {
    @location(0) sum: vec4f,
}

fn first(s: State) -> First {
    return First(vec4f(s.sum, 0.0));
}

fn seen_all(pixel: vec2u) -> State {
    return State(textureLoad(sums, pixel, 0).rgb);
}
