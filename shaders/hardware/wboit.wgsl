// Weighted blended: sums, added to, and the absorbance beside them.

@group(1) @binding(0) var sums: texture_2d<f32>;
@group(1) @binding(1) var absorbances: texture_2d<f32>;

struct First {
    @location(0) sum: vec4f,
    @location(1) absorbance: vec4f,
}

// Weights as published, where sums are of 16 bits, in which smaller ones would be 0: a factor that cancels.
const SUM_SCALE = select(1.0, 1.0 / WEIGHT_SCALE, HALF_TARGETS);

fn first(s: State) -> First {
    return First(s.sum * SUM_SCALE, vec4f(absorbance(s.coverage.alpha), 0.0, 0.0, 0.0));
}

fn seen_all(pixel: vec2u) -> State {
    return State(textureLoad(sums, pixel, 0), coverage_of(textureLoad(absorbances, pixel, 0).r));
}
