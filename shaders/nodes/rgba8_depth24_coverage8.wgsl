// rgba8_depth24_coverage8: a 24-bit depth code, and eight bits of coverage or blend mode (section 2.7.1).

fn encode(f: Fragment, next: u32) -> array<u32, BASE_WORDS> {
    let depth = depth_code(f.value, LAST_CODE) << 8u;
    return array<u32, BASE_WORDS>(next, depth | spare_bits(f), pack4x8unorm(f.color));
}

fn next_of(node: u32) -> u32 {
    return word(node, 0u);
}

// The spare bits decide only between equal depths, like the colour after them.
fn key_of(node: u32) -> u32 {
    return select(word(node, 1u), word(node, 1u) >> 8u, HAS_ORDER);
}

fn tie_of(node: u32) -> u32 {
    return word(node, 2u);
}

fn spare_of(node: u32) -> u32 {
    return word(node, 1u) & 255u;
}

fn color_of(node: u32) -> vec4f {
    return unpack4x8unorm(word(node, 2u));
}

fn value_of(node: u32) -> f32 {
    return value_of_code(word(node, 1u) >> 8u);
}
