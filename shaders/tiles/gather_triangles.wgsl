// An invocation a triangle tests the pixels of its box, and prepends its place in the tile's list to the list of each that it
// covers (Yang et al. 2010, in workgroup memory): for many triangles, that cover few pixels. A node is a word; keys are
// made when they are sorted, from planes that a cache holds. Fragments come in any order, which their sort forgets.

const END = 0xffffu;

var<workgroup> heads: array<atomic<u32>, THREADS>;
// The triangle's place, and above its 16 bits the next node.
var<workgroup> nodes: array<u32, ENTRIES>;
var<workgroup> used: atomic<u32>;

// The node that is taken next.
var<private> next_node: u32;

fn gather(span: Span, corner: vec2i, place: vec2i, is_inside: bool, local: u32) -> u32 {
    tile_first = span.first;
    atomicStore(&heads[local], END);
    if local == 0u {
        atomicStore(&used, 0u);
    }
    workgroupBarrier(); // nothing is covered yet
    for (var t = local; t < span.count; t += THREADS) {
        let id = tile_entries[span.first + t];
        let item = item_of(id, corner.x, corner.y);
        if HIDES && (item.flags & OPAQUE) != 0u {
            continue;
        }
        let box = unpacked_box(boxes[id]) - vec4i(corner, corner);
        let first = max(box.xy, vec2i(0));
        let last = min(box.zw, vec2i(TILE - 1));
        // 8×8 pixels at a time, a bit for each that is covered.
        for (var y = first.y; y <= last.y; y += 8) {
            for (var x = first.x; x <= last.x; x += 8) {
                cover(t, covered_block(item, corner, vec2i(x, y), last), vec2i(x, y));
            }
        }
    }
    workgroupBarrier(); // all lists are whole
    if atomicLoad(&used) > ENTRIES {
        return DEPTH + 1u;
    }
    next_node = atomicLoad(&heads[local]);
    var n = 0u;
    for (var node = next_node; node != END && n <= DEPTH; node = nodes[node] >> 16u) {
        n++;
    }
    return n;
}

// Prepends a triangle to the lists of the pixels of a block.
fn cover(t: u32, block: vec2u, first: vec2i) {
    let counts = countOneBits(block);
    var node = ENTRIES;
    if counts.x + counts.y > 0u {
        node = atomicAdd(&used, counts.x + counts.y);
    }
    var rest = block;
    while (rest.x | rest.y) != 0u && node < ENTRIES {
        let pixel = next_pixel(&rest, first);
        nodes[node] = t | (atomicExchange(&heads[pixel], node) << 16u);
        node++;
    }
}

// The place of the next fragment; any of them, if there is none.
fn take(i: u32) -> u32 {
    let node = nodes[min(next_node, ENTRIES - 1u)];
    next_node = node >> 16u;
    return node & 0xffffu;
}
