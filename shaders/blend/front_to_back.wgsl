// Mixed modes, front to back, with a transmittance for each channel (underblending: Bavoil and Myers 2008).

struct Blend {
    color: vec4f, // premultiplied
    transmittance: vec4f,
}

fn blend_begin(behind: vec4f) -> Blend {
    return Blend(vec4f(0.0), vec4f(1.0));
}

fn blend_add(s: ptr<function, Blend>, source: Source) {
    let m = affine(source.mode, source.color);
    (*s).color += (*s).transmittance * m.a;
    (*s).transmittance *= m.f;
}

// Not at View.least_transmittance: additive adds without end, which no transmittance but 0 bounds.
fn blend_done(s: Blend) -> bool {
    return all(s.transmittance == vec4f(0.0));
}

fn blend_end(s: Blend, behind: vec4f) -> vec4f {
    return s.color + s.transmittance * vec4f(behind.a * behind.rgb, behind.a);
}

// For walks that go on in another dispatch.
fn blend_save(s: Blend) -> array<vec4f, 2> {
    return array<vec4f, 2>(s.color, s.transmittance);
}

fn blend_load(saved: array<vec4f, 2>) -> Blend {
    return Blend(saved[0], saved[1]);
}
