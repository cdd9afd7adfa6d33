// rgb565_depth16: 8 bytes (section 2.8.1). Colour 5+6+5 above 16 bits of depth; alpha above 24 bits of link.

fn encode(f: Fragment, next: u32) -> array<u32, BASE_WORDS> {
    let c = vec4u(saturate(f.color) * vec4f(31.0, 63.0, 31.0, 255.0) + 0.5);
    let color = (c.r << 27u) | (c.g << 21u) | (c.b << 16u);
    return array<u32, BASE_WORDS>(color | depth_code(f.value, LAST_CODE), (c.a << 24u) | next);
}

fn next_of(node: u32) -> u32 {
    return word(node, 1u) & 0xffffffu;
}

fn key_of(node: u32) -> u32 {
    return word(node, 0u) & 0xffffu;
}

fn tie_of(node: u32) -> u32 {
    return (word(node, 0u) & 0xffff0000u) | (word(node, 1u) >> 24u);
}

fn spare_of(node: u32) -> u32 {
    return 0u;
}

fn color_of(node: u32) -> vec4f {
    let c = word(node, 0u);
    let rgba = vec4u(c >> 27u, (c >> 21u) & 63u, (c >> 16u) & 31u, word(node, 1u) >> 24u);
    return vec4f(rgba) / vec4f(31.0, 63.0, 31.0, 255.0);
}

fn value_of(node: u32) -> f32 {
    return value_of_code(key_of(node));
}
