// Affine maps of several fragments (`Affine` in src/blend.rs): f is a number, or one for each channel.

// Of no fragment: of one that is transparent.
fn affine_identity() -> Affine {
    return affine(0u, vec4f(0.0));
}

// These fragments in front of others.
fn affine_onto(front: Affine, back: Affine) -> Affine {
    return Affine(front.a + front.f * back.a, front.f * back.f);
}

// Premultiplied, over a straight background.
fn affine_over(m: Affine, behind: vec4f) -> vec4f {
    return m.a + m.f * vec4f(behind.a * behind.rgb, behind.a);
}
