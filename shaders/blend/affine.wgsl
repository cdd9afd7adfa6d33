// Blend modes as affine maps of what lies behind (GPU Pro 2, section 2.6.4): a + f·d in each channel.

struct Affine {
    a: vec4f,
    f: vec4f,
}

// The modes of src/blend.rs, of a straight colour.
fn affine(mode: u32, c: vec4f) -> Affine {
    let through = 1.0 - c.a;
    let p = c.a * c.rgb;
    switch mode {
        case 1u: { return Affine(vec4f(p, 0.0), vec4f(1.0)); } // additive
        case 2u: { return Affine(vec4f(0.0), vec4f(through + p, 1.0)); } // multiply
        case 3u: { return Affine(vec4f(p, 0.0), vec4f(1.0 - p, 1.0)); } // screen
        case 4u: { return Affine(c, vec4f(through)); } // premultiplied
        default: { return Affine(vec4f(p, c.a), vec4f(through)); } // over
    }
}
