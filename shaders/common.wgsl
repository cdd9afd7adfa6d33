// What every stage shares: the view, the band, and the sort key. Constants in capitals are the variant's: they
// come from the prelude that Rust writes before these files.

struct View {
    // Rows of the matrix from positions relative to a centre to clip x, y, w and eye depth.
    rows: array<vec4f, 4>,
    // Straight, where no background texture is bound.
    background: vec4f,
    width: u32,
    height: u32,
    perspective: u32,
    // 1: opaque surfaces are listed like any other, and hide nothing.
    list_opaque: u32,
    near: f32,
    // The least 1/w under a perspective, else the greatest depth.
    far: f32,
    // Window z of an orthographic view: z_offset − depth · z_scale, 1 at the scene's nearest, 0 at its farthest.
    z_offset: f32,
    z_scale: f32,
    // Depth codes of the formats that have some: 0 at the frame's nearest value, code_scale codes a unit.
    code_origin: f32,
    code_scale: f32,
    code_step: f32,
    // 1: the background is a texture, else View.background.
    background_texture: u32,
    // 0, which no compiler can know (see exact.wgsl).
    zero: u32,
    // Front to back, a sample's list is left where no more than this is let through. At 0 that changes no bit.
    least_transmittance: f32,
    pad0: u32,
    pad1: u32,
}

// The rectangle of pixels that one pass over the geometry fills lists for.
struct Band {
    x0: u32,
    y0: u32,
    width: u32,
    height: u32,
    // Nodes that fit the pool.
    capacity: u32,
    // Loop iterations that one invocation may take before it stores its state and is dispatched again:
    // Mesa's llvmpipe silently ends every loop after 65,535 in total.
    trip_budget: u32,
    pad: vec2u,
}

// Unsigned bits in the order of the values; −0 counts as +0.
fn orderable(value: f32) -> u32 {
    let bits = bitcast<u32>(value + 0.0);
    return select(bits | 0x80000000u, ~bits, (bits & 0x80000000u) != 0u);
}

// The sort key, smaller in front: made from 1/w under a perspective, else from the eye depth.
fn sort_key(plane_value: f32) -> u32 {
    let key = orderable(plane_value);
    return select(key, ~key, view.perspective == 1u);
}

fn value_of_key(key: u32) -> f32 {
    let bits = select(key, ~key, view.perspective == 1u);
    return bitcast<f32>(select(~bits, bits & 0x7fffffffu, (bits & 0x80000000u) != 0u));
}

// Of what the sort key is made from. The hardware clips neither the far plane of a perspective nor an orthographic view's
// two.
fn beyond_depth_range(value: f32) -> bool {
    if view.perspective == 1u {
        return value < view.far;
    }
    return value < view.near || value > view.far;
}

// Whether fragment a = (key, order) is in front of b.
fn in_front(a: vec2u, b: vec2u) -> bool {
    return a.x < b.x || (a.x == b.x && a.y < b.y);
}
