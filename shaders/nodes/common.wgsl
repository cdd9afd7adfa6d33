// Nodes (GPU Pro 2, sections 2.4.3 and 2.8.1): NODE_WORDS words each, laid out by the variant's format. A format
// gives its own words, `encode`, and what is read back; the words after them are there only if the scene needs
// them: ORDER_WORD (the primitive, for ties and lists, and the blend mode) and COVERAGE_WORD (a sample mask).

struct Fragment {
    color: vec4f, // straight
    // 1/w under a perspective, else eye depth.
    value: f32,
    // The complement of the primitive, so that later triangles win ties; its top bit puts a listed opaque surface
    // behind translucent ones at its depth. Where a scene mixes blend modes the low four bits are the mode.
    order: u32,
    // Bit s: sample s is covered.
    coverage: u32,
    mode: u32,
}

fn word(node: u32, i: u32) -> u32 {
    return nodes[node * NODE_WORDS + i];
}

// (key, order), smaller in front: ties of formats without an order go by what else a node holds, so that the
// result does not depend on which fragment came first.
fn order_of(node: u32) -> vec2u {
    let key = key_of(node);
    if HAS_ORDER {
        return vec2u(key, word(node, ORDER_WORD));
    }
    return vec2u(key, tie_of(node));
}

// Whether two neighbours of a sorted list are pieces of one triangle, which hardware may cut where they meet inside a
// pixel: they have one key and order, and are one fragment.
fn are_pieces(a: vec2u, b: vec2u) -> bool {
    return SAMPLES > 1u && HAS_ORDER && all(a == b);
}

// For the last submitted first: by primitive, whether opaque or not.
fn by_primitive(own: vec2u) -> vec2u {
    return vec2u(own.y & 0x7fffffffu, own.x);
}

fn coverage_of(node: u32) -> u32 {
    if SAMPLES == 1u {
        return 1u;
    }
    if HAS_COVERAGE {
        return word(node, COVERAGE_WORD);
    }
    return spare_of(node) & FULL_MASK;
}

fn mode_of(node: u32) -> u32 {
    if !MIXED {
        return 0u;
    }
    if HAS_ORDER {
        return word(node, ORDER_WORD) & 15u;
    }
    return spare_of(node) >> 4u;
}

fn depth_of(node: u32) -> f32 {
    let value = value_of(node);
    return select(value, 1.0 / value, view.perspective == 1u);
}

// Codes span the frame's own range of values, 0 at the nearest. Subtraction, product and rounding are monotone, and
// so are codes. (Not + 0.5 and truncated: from 2²³ on that sum is rounded to even.)
fn depth_code(value: f32, last: u32) -> u32 {
    let from_nearest = select(value - view.code_origin, view.code_origin - value, view.perspective == 1u);
    return min(u32(round(max(from_nearest * view.code_scale, 0.0))), last);
}

fn value_of_code(code: u32) -> f32 {
    let from_nearest = f32(code) * view.code_step;
    return select(view.code_origin + from_nearest, view.code_origin - from_nearest, view.perspective == 1u);
}

// What formats with eight spare bits keep there: coverage below, and the mode above four samples.
fn spare_bits(f: Fragment) -> u32 {
    var bits = 0u;
    if SAMPLES > 1u && !HAS_COVERAGE {
        bits = f.coverage;
    }
    if MIXED && !HAS_ORDER {
        bits |= f.mode << 4u;
    }
    return bits;
}
