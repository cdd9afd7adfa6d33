// Unsorted: painted colours, and what they let through beside them.

@group(1) @binding(0) var colors_painted: texture_2d<f32>;
@group(1) @binding(1) var transmittances: texture_2d<f32>;

struct First {
    @location(0) rgba: vec4f,
    @location(1) covered: vec4f,
}

fn first(s: State) -> First {
    return First(s.painted.a, vec4f(0.0, 0.0, 0.0, s.painted.a.a));
}

fn seen_all(pixel: vec2u) -> State {
    return State(Affine(textureLoad(colors_painted, pixel, 0), textureLoad(transmittances, pixel, 0).r));
}
