// Trigonometric moments as two colours.

fn low_moments(m: Moments) -> vec4f {
    return vec4f(m.b1, m.b2);
}

fn high_moments(m: Moments) -> vec4f {
    return vec4f(m.b3, m.b4);
}

fn moments_of(total: f32, low: vec4f, high: vec4f) -> Moments {
    return Moments(total, low.xy, low.zw, high.xy, high.zw);
}
