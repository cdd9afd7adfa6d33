// Power moments as two colours.

fn low_moments(m: Moments) -> vec4f {
    return m.low;
}

fn high_moments(m: Moments) -> vec4f {
    return m.high;
}

fn moments_of(total: f32, low: vec4f, high: vec4f) -> Moments {
    return Moments(total, low, high);
}
