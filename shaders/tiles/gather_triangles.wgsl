// An invocation a triangle tests the pixels of its box: for many triangles, that cover few pixels. What is covered goes
// into a queue, which all invocations share out evenly; each pixel has a place in one array, as long as its list.
// Fragments come in any order, which their sort forgets.

var<workgroup> filled: array<atomic<u32>, THREADS>;
// The entry of the tile's list that covers, and above its 24 bits the pixel.
var<workgroup> queue: array<u32, ENTRIES>;
var<workgroup> queued: atomic<u32>;
var<workgroup> handed_out: atomic<u32>;
var<workgroup> keys: array<u32, ENTRIES>;
var<workgroup> ids: array<u32, ENTRIES>;

var<private> first_entry: u32;

fn entry(i: u32) -> u32 {
    return first_entry + i;
}

fn gather(span: Span, corner: vec2i, place: vec2i, is_inside: bool, local: u32) -> u32 {
    atomicStore(&filled[local], 0u);
    if local == 0u {
        atomicStore(&queued, 0u);
        atomicStore(&handed_out, 0u);
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
    workgroupBarrier(); // the queue is whole
    let all = atomicLoad(&queued);
    let n = atomicLoad(&filled[local]);
    first_entry = atomicAdd(&handed_out, n);
    atomicStore(&filled[local], first_entry);
    workgroupBarrier(); // every pixel has its place
    if all > ENTRIES {
        return DEPTH + 1u;
    }
    for (var i = local; i < all; i += THREADS) {
        let p = queue[i] >> 24u;
        let id = tile_entries[span.first + (queue[i] & 0xffffffu)];
        let pixel = vec2u(corner + vec2i(i32(p % 16u), i32(p / 16u)));
        let slot = atomicAdd(&filled[p], 1u);
        keys[slot] = visible_key(value_at(key_planes[id], vec2f(pixel) + 0.5), pixel);
        ids[slot] = id;
    }
    workgroupBarrier(); // all pixels have all theirs
    return n;
}

// Queues the pixels of a block, and counts them.
fn cover(t: u32, block: vec2u, first: vec2i) {
    let counts = countOneBits(block);
    var i = 0u;
    if counts.x + counts.y > 0u {
        i = atomicAdd(&queued, counts.x + counts.y);
    }
    var rest = block;
    while (rest.x | rest.y) != 0u && i < ENTRIES {
        let pixel = next_pixel(&rest, first);
        queue[i] = t | (pixel << 24u);
        atomicAdd(&filled[pixel], 1u);
        i++;
    }
}
