// Walks of the temporary array for any length.

fn gather(pixel: u32) -> u32 {
    var n = 0u;
    for (var c = first_of(pixel); n < TEMP && !is_end(c); n++) {
        let node = node_at(c);
        order[n] = order_of(node);
        entries[n] = node;
        advance(&c);
    }
    return n;
}

fn composite(n: u32, only: u32) {
    for (var k = 0u; k < n && !all_done(); k++) {
        blend_entry(entries[select(k, n - 1u - k, BACK_TO_FRONT)], only);
    }
}
