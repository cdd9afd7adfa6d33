// Dual depth peeling: a pass blends what is at the two ends that the last one found, and finds the next two, by the
// greatest of z and of −z. Fragments at one depth are of one layer, composited in the order of submission.

@group(1) @binding(0) var ends: texture_2d<f32>;

struct Peeled {
    // Reversed z of the nearest, and less that of the farthest, between the last ones.
    @location(0) ends: vec4f,
    // Premultiplied.
    @location(1) front: vec4f,
    @location(2) back: vec4f,
}

// Less than any of a fragment's.
const NO_END = vec4f(-2.0, -2.0, 0.0, 0.0);

@fragment
fn fs_peel(v: Varyings, @builtin(front_facing) is_front: bool) -> Peeled {
    let color = layer_of(fragment_of(v, is_front).color).rgba;
    let last = textureLoad(ends, vec2u(v.position.xy), 0);
    let z = v.position.z;
    let near = last.x;
    let far = -last.y;
    if z > near || z < far {
        discard;
    }
    if z == near {
        return Peeled(NO_END, color, vec4f(0.0));
    }
    if z == far {
        return Peeled(NO_END, vec4f(0.0), color);
    }
    return Peeled(vec4f(z, -z, 0.0, 0.0), vec4f(0.0), vec4f(0.0));
}
