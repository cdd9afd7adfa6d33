// Depth peeling: a pass draws what is behind the last layer, of which the depth test leaves the nearest, and of those at
// one depth the last submitted: with the primitive in the order, none is lost.

@group(1) @binding(0) var last_orders: texture_2d<u32>;
@group(1) @binding(1) var opaque_depth: texture_depth_2d;

struct Peeled {
    // Straight.
    @location(0) color: vec4f,
    @location(1) order: vec4u,
    // What the shader compares, and no other rounding of it.
    @builtin(frag_depth) depth: f32,
}

@fragment
fn fs_peel(v: Varyings, @builtin(front_facing) is_front: bool) -> Peeled {
    var fragment = fragment_of(v, is_front);
    let pixel = vec2u(v.position.xy);
    let z = v.position.z; // reversed
    fragment.key = ~bitcast<u32>(z);
    let order = order_of(fragment);
    if !in_front(textureLoad(last_orders, pixel, 0).xy, order) {
        discard;
    }
    if HIDES && z < textureLoad(opaque_depth, pixel, 0) {
        discard;
    }
    return Peeled(fragment.color, vec4u(order, 0u, 0u), z);
}
