// All fragments are blended with `over`, front to back.

alias Blend = State;

fn blend_begin(behind: vec4f) -> Blend {
    return begin();
}

fn blend_add(s: ptr<function, Blend>, source: Source) {
    insert(s, source.color);
}

fn blend_done(s: Blend) -> bool {
    return is_saturated(s, view.least_transmittance);
}

fn blend_end(s: Blend, behind: vec4f) -> vec4f {
    return end(s, behind);
}

// For walks that go on in another dispatch: colour, then transmittance.
fn blend_save(s: Blend) -> array<vec4f, 2> {
    return array<vec4f, 2>(vec4f(s.color, s.alpha), vec4f(s.transmittance));
}

fn blend_load(saved: array<vec4f, 2>) -> Blend {
    return Blend(saved[0].rgb, saved[0].a, saved[1].x);
}
