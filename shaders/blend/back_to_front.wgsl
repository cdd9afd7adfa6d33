// Back to front, as the chapter blends: any mode, and any function of a user's.

struct Blend {
    destination: vec4f, // premultiplied
}

fn blend_begin(behind: vec4f) -> Blend {
    return Blend(vec4f(behind.a * behind.rgb, behind.a));
}

fn blend_add(s: ptr<function, Blend>, source: Source) {
    if USER_BLENDS && source.mode >= 5u {
        (*s).destination = user_blend(source.mode - 5u, (*s).destination, source.color, source.depth);
        return;
    }
    let m = affine(source.mode, source.color);
    (*s).destination = m.a + m.f * (*s).destination;
}

fn blend_done(s: Blend) -> bool {
    return false;
}

fn blend_end(s: Blend, behind: vec4f) -> vec4f {
    return s.destination;
}

// For walks that go on in another dispatch.
fn blend_save(s: Blend) -> array<vec4f, 2> {
    return array<vec4f, 2>(s.destination, vec4f(0.0));
}

fn blend_load(saved: array<vec4f, 2>) -> Blend {
    return Blend(saved[0]);
}
