// Moments: the first pass adds up absorbance and its moments, and the second colours, weighted by the transmittance that
// those give.

@group(1) @binding(0) var totals: texture_2d<f32>;
@group(1) @binding(1) var moments_low: texture_2d<f32>;
// Those beyond the first four numbers; where there are none, the same as the others, and unread.
@group(1) @binding(2) var moments_high: texture_2d<f32>;
@group(1) @binding(3) var sums: texture_2d<f32>;

struct First {
    @location(0) total: vec4f,
    @location(1) low: vec4f,
    @location(2) high: vec4f,
}

struct Second {
    @location(0) sum: vec4f,
}

// Weights are e^(this − F): a common factor, which keeps all but the farthest of a thousand layers from being 0, and
// bright ones from overflowing; 16 bits have less room for it.
const LIFT = select(64.0, 8.0, HALF_TARGETS);
// A weight is no less than e^this, which a float holds with all its digits: where even the nearest of hundreds of opaque
// layers is behind so much absorbance, they have equal weights, and the pixel is their mean, not black.
const LEAST = select(-80.0, -8.0, HALF_TARGETS);

fn first(s: State) -> First {
    return First(vec4f(s.moments.total, 0.0, 0.0, 0.0), low_moments(s.moments), high_moments(s.moments));
}

fn seen_once(pixel: vec2u) -> State {
    let total = textureLoad(totals, pixel, 0).r;
    let low = textureLoad(moments_low, pixel, 0);
    var high = vec4f(0.0);
    if HALF > 2u {
        high = textureLoad(moments_high, pixel, 0);
    }
    return State(moments_of(total, low, high), factors_none(), shade_none());
}

fn second(s: State) -> Second {
    return Second(s.shade.sum * exp(max(LIFT - s.shade.least, LEAST)));
}

fn seen_all(pixel: vec2u) -> State {
    var s = seen_once(pixel);
    s.shade = Shade(textureLoad(sums, pixel, 0), 0.0, coverage_of(s.moments.total));
    return s;
}
