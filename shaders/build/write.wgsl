// Writing a node, for the stages that keep fragments.

@group(1) @binding(2) var<storage, read_write> nodes: array<u32>;

fn write_node(node: u32, f: Fragment, next: u32) {
    let words = encode(f, next);
    let first = node * NODE_WORDS;
    for (var i = 0u; i < BASE_WORDS; i++) {
        nodes[first + i] = words[i];
    }
    if HAS_ORDER {
        nodes[first + ORDER_WORD] = f.order;
    }
    if HAS_COVERAGE {
        nodes[first + COVERAGE_WORD] = f.coverage;
    }
}
