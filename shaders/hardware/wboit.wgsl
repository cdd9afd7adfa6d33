// Weighted blended: sums, added to, and coverage beside them.

@group(1) @binding(0) var sums: texture_2d<f32>;
@group(1) @binding(1) var coverages: texture_2d<f32>;

struct First {
    @location(0) sum: vec4f,
    @location(1) coverage: vec4f,
}

fn first(s: State) -> First {
    return First(s.sum, covers(s.coverage));
}

fn seen_all(pixel: vec2u) -> State {
    return State(textureLoad(sums, pixel, 0), coverage_at(coverages, pixel));
}
