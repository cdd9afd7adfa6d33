// Stochastic transparency: draws are samples of the hardware's, some of them a pass, and `sample_mask` says which a
// fragment covers; its depth test keeps each one's nearest. With edges those of triangles at the samples.

struct Draws {
    // The first of a pass.
    first: u32,
    // Samples of a pixel, of which a last pass leaves some.
    count: u32,
    pad0: u32,
    pad1: u32,
}

@group(1) @binding(0) var<uniform> draws: Draws;
@group(1) @binding(1) var samples: texture_multisampled_2d<f32>;

struct Drawn {
    @location(0) color: vec4f,
    @builtin(sample_mask) mask: u32,
}

var<private> state: State;

@fragment
fn fs_draw(v: Varyings, @builtin(front_facing) is_front: bool) -> Drawn {
    let fragment = fragment_of(v, is_front);
    state = begin(Place(vec2u(v.position.xy), 0u));
    insert(&state, fragment, 0u);
    var mask = 0u;
    for (var i = 0u; i < draws.count; i++) {
        if in_front(draw_orders[draws.first + i], UNCOVERED) {
            mask |= 1u << i;
        }
    }
    return Drawn(vec4f(fragment.color.rgb, 1.0), mask);
}

// Of estimator c, where no draw is nearer: α c, and last α.
@fragment
fn fs_shade(v: Varyings, @builtin(front_facing) is_front: bool) -> Drawn {
    let color = fragment_of(v, is_front).color;
    return Drawn(vec4f(color.a * color.rgb, color.a), (1u << draws.count) - 1u);
}

@fragment
fn fs_absorb(v: Varyings, @builtin(front_facing) is_front: bool) -> @location(0) vec4f {
    return vec4f(absorbance(fragment_of(v, is_front).color.a), 0.0, 0.0, 0.0);
}

// Adds up a pixel's samples.
@fragment
fn fs_gather(@builtin(position) at: vec4f) -> @location(0) vec4f {
    var sum = vec4f(0.0);
    for (var i = 0u; i < draws.count; i++) {
        sum += textureLoad(samples, vec2u(at.xy), i);
    }
    return sum;
}
