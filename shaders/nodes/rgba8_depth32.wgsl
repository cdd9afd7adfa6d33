// rgba8_depth32: the chapter's 12 bytes (section 2.4.3). Straight colour, so that alpha does not eat its bits.

fn encode(f: Fragment, next: u32) -> array<u32, BASE_WORDS> {
    return array<u32, BASE_WORDS>(next, sort_key(f.value), pack4x8unorm(f.color));
}

fn next_of(node: u32) -> u32 {
    return word(node, 0u);
}

fn key_of(node: u32) -> u32 {
    return word(node, 1u);
}

fn tie_of(node: u32) -> u32 {
    return word(node, 2u);
}

fn spare_of(node: u32) -> u32 {
    return 0u;
}

fn color_of(node: u32) -> vec4f {
    return unpack4x8unorm(word(node, 2u));
}

fn value_of(node: u32) -> f32 {
    return value_of_key(key_of(node));
}
