// Where all fragments are blended with `over`: one f does for all channels (blend/affine.wgsl has the other modes).

struct Affine {
    a: vec4f,
    f: f32,
}

fn affine(mode: u32, c: vec4f) -> Affine {
    return Affine(vec4f(c.a * c.rgb, c.a), 1.0 - c.a);
}
