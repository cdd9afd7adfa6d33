// float32: RGBA as it is, the sort key, the order. Nothing is lost.

fn encode(f: Fragment, next: u32) -> array<u32, BASE_WORDS> {
    let c = bitcast<vec4u>(f.color);
    return array<u32, BASE_WORDS>(next, sort_key(f.value), c.r, c.g, c.b, c.a);
}

fn next_of(node: u32) -> u32 {
    return word(node, 0u);
}

fn key_of(node: u32) -> u32 {
    return word(node, 1u);
}

fn tie_of(node: u32) -> u32 {
    return 0u; // it always has an order
}

fn spare_of(node: u32) -> u32 {
    return 0u;
}

fn color_of(node: u32) -> vec4f {
    return bitcast<vec4f>(vec4u(word(node, 2u), word(node, 3u), word(node, 4u), word(node, 5u)));
}

fn value_of(node: u32) -> f32 {
    return value_of_key(key_of(node));
}
