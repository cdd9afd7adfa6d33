// Mixed modes, front to back, with a transmittance for each channel (underblending: Bavoil and Myers 2008).

alias Blend = Affine;

fn blend_begin(behind: vec4f) -> Blend {
    return affine_identity();
}

fn blend_add(s: ptr<function, Blend>, source: Source) {
    *s = affine_onto(*s, affine(source.mode, source.color));
}

// Not at View.least_transmittance: additive adds without end, which no transmittance but 0 bounds.
fn blend_done(s: Blend) -> bool {
    return all(s.f == vec4f(0.0));
}

fn blend_end(s: Blend, behind: vec4f) -> vec4f {
    return affine_over(s, behind);
}

// For walks that go on in another dispatch.
fn blend_save(s: Blend) -> array<vec4f, 2> {
    return array<vec4f, 2>(s.a, s.f);
}

fn blend_load(saved: array<vec4f, 2>) -> Blend {
    return Blend(saved[0], saved[1]);
}
