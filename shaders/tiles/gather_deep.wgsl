// An invocation a triangle tests the pixels of its box that are in the part, and leaves its place in the tile's list to
// each that it covers: for many small triangles in deep pixels. A place is half a word; keys are made when they are sorted,
// from planes that a cache holds.

var<workgroup> filled: array<atomic<u32>, THREADS>;
// Of pixel p, two places to a word, a word of all pixels after the other.
var<workgroup> places: array<atomic<u32>, ENTRIES / 2u>;

var<private> own_pixel: u32;

const ROWS = i32(THREADS) / TILE;

fn gather(span: Span, corner: vec2i, place: vec2i, is_inside: bool, local: u32) -> u32 {
    tile_first = span.first;
    own_pixel = local;
    if span.count > 0xffffu {
        return DEPTH + 1u;
    }
    atomicStore(&filled[local], 0u);
    for (var i = 0u; i < DEPTH / 2u; i++) {
        atomicStore(&places[i * THREADS + local], 0u);
    }
    workgroupBarrier(); // nothing is covered yet
    let top = place.y - i32(local) / TILE; // of the part
    for (var t = local; t < span.count; t += THREADS) {
        let id = tile_entries[span.first + t];
        let box = unpacked_box(boxes[id]) - vec4i(corner, corner);
        let first = max(box.xy, vec2i(0, top));
        let last = min(box.zw, vec2i(TILE - 1, top + ROWS - 1));
        if any(first > last) {
            continue;
        }
        let item = item_of(id, corner.x, corner.y);
        if HIDES && (item.flags & OPAQUE) != 0u {
            continue;
        }
        for (var x = first.x; x <= last.x; x += 8) {
            let at = vec2i(x, first.y);
            leave(t, covered_block(item, corner, at, last), at - vec2i(0, top));
        }
    }
    workgroupBarrier(); // all have left their places
    return atomicLoad(&filled[local]);
}

// Leaves a place to the pixels of a block, whose first is `first` in the part.
fn leave(t: u32, block: vec2u, first: vec2i) {
    var rest = block;
    while (rest.x | rest.y) != 0u {
        let pixel = next_pixel(&rest, first);
        let i = atomicAdd(&filled[pixel], 1u);
        if i < DEPTH {
            atomicAdd(&places[(i / 2u) * THREADS + pixel], t << (16u * (i % 2u)));
        }
    }
}

fn take(i: u32) -> u32 {
    return (atomicLoad(&places[(i / 2u) * THREADS + own_pixel]) >> (16u * (i % 2u))) & 0xffffu;
}
