// Lists longer than the temporary array of the resolve: exact at any length, in O(n log n).
//
// The list is copied to contiguous scratch, blocks of CHUNK entries are sorted by insertion, and then
// merged in rounds of doubling width. In a round each invocation writes CHUNK outputs, which it finds by a
// binary search along its diagonal of the two runs (merge path: Odeh, Green, Mwassi, Shmueli and Birk 2012).
// Walks along a list and the final composite take one invocation a pixel; after `band.trip_budget` steps it
// stores its state, raises `unfinished` and goes on in the next dispatch.

struct LongPixel {
    pixel: u32,
    // The list's first link.
    head: u32,
    // Where the pixel's entries start in scratch, a multiple of CHUNK.
    first: u32,
    count: u32,
    // State of a walk: the next link, and how many entries are written.
    link: u32,
    written: u32,
    // State of the composite: how many entries are in it.
    composited: u32,
    transmittance: f32,
    color: vec4f, // premultiplied
}

const NONE = 0xffffffffu;

@group(1) @binding(0) var<storage, read_write> long: array<LongPixel>;
@group(1) @binding(1) var<storage, read_write> unfinished: atomic<u32>;
// Node indices, ping and pong.
@group(1) @binding(2) var<storage, read_write> from_entries: array<u32>;
@group(1) @binding(3) var<storage, read_write> to_entries: array<u32>;
// For each chunk of scratch, its element of `long`.
@group(1) @binding(4) var<storage, read> chunk_owner: array<u32>;

struct Round {
    // Width of the sorted runs, a multiple of CHUNK.
    width: u32,
    long_count: u32,
    chunk_count: u32,
    pad: u32,
}
@group(1) @binding(5) var<uniform> round: Round;
// As the resolve left them: a count, then pixels.
@group(1) @binding(6) var<storage, read> long_pixels: array<u32>;

// Workgroups per row of a dispatch: one dimension ends at 65,535 of them.
fn flat_index(id: vec3u, groups: vec3u) -> u32 {
    return id.y * groups.x * 64u + id.x;
}

@compute @workgroup_size(64)
fn cs_begin(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = flat_index(id, groups);
    if i >= round.long_count {
        return;
    }
    let pixel = long_pixels[i + 1u];
    let head = heads[pixel];
    long[i] = LongPixel(pixel, head, 0u, 0u, head, 0u, 0u, 1.0, vec4f(0.0));
}

// Counts a list's nodes.
@compute @workgroup_size(64)
fn cs_count(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = flat_index(id, groups);
    if i >= round.long_count {
        return;
    }
    var link = long[i].link;
    var count = long[i].count;
    for (var trips = band.trip_budget; trips > 0u && link != 0u; trips--) {
        link = node_next[link - 1u];
        count++;
    }
    long[i].link = link;
    long[i].count = count;
    if link != 0u {
        atomicStore(&unfinished, 1u);
    }
}

// Copies a list's nodes to scratch, and fills its last chunk with NONE.
@compute @workgroup_size(64)
fn cs_gather(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = flat_index(id, groups);
    if i >= round.long_count {
        return;
    }
    let first = long[i].first;
    let count = long[i].count;
    var link = long[i].link;
    var written = long[i].written;
    for (var trips = band.trip_budget - CHUNK; trips > 0u && link != 0u; trips--) {
        from_entries[first + written] = link - 1u;
        link = node_next[link - 1u];
        written++;
    }
    long[i].link = link;
    long[i].written = written;
    if link != 0u {
        atomicStore(&unfinished, 1u);
        return;
    }
    let padded = (count + CHUNK - 1u) / CHUNK * CHUNK;
    for (var k = count; k < padded; k++) {
        from_entries[first + k] = NONE;
    }
}

fn order_of(entry: u32) -> vec2u {
    if entry == NONE {
        return vec2u(NONE);
    }
    return node_order[entry];
}

@compute @workgroup_size(64)
fn cs_sort_chunks(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let chunk = flat_index(id, groups);
    if chunk >= round.chunk_count {
        return;
    }
    var order: array<vec2u, CHUNK>;
    var entries: array<u32, CHUNK>;
    for (var n = 0u; n < CHUNK; n++) {
        let entry = from_entries[chunk * CHUNK + n];
        let own = order_of(entry);
        var i = n;
        while i > 0u && in_front(own, order[i - 1u]) {
            order[i] = order[i - 1u];
            entries[i] = entries[i - 1u];
            i--;
        }
        order[i] = own;
        entries[i] = entry;
    }
    for (var n = 0u; n < CHUNK; n++) {
        from_entries[chunk * CHUNK + n] = entries[n];
    }
}

@compute @workgroup_size(64)
fn cs_merge(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let chunk = flat_index(id, groups);
    if chunk >= round.chunk_count {
        return;
    }
    let owner = chunk_owner[chunk];
    let first = long[owner].first;
    let padded = (long[owner].count + CHUNK - 1u) / CHUNK * CHUNK;
    let output = chunk * CHUNK - first;
    let base = output / (2u * round.width) * (2u * round.width);
    let left = first + base;
    let left_count = min(round.width, padded - base);
    let right = left + left_count;
    let right_count = min(round.width, padded - base - left_count);
    // How many of the outputs before this chunk come from the left run.
    let diagonal = output - base;
    var low = diagonal - min(diagonal, right_count);
    var high = min(diagonal, left_count);
    while low < high {
        let middle = (low + high) / 2u;
        let l = order_of(from_entries[left + middle]);
        let r = order_of(from_entries[right + diagonal - 1u - middle]);
        if in_front(r, l) {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    var a = low;
    var b = diagonal - low;
    for (var n = 0u; n < CHUNK; n++) {
        var take_left = b >= right_count;
        if !take_left && a < left_count {
            take_left = !in_front(order_of(from_entries[right + b]), order_of(from_entries[left + a]));
        }
        let source = select(right + b, left + a, take_left);
        to_entries[chunk * CHUNK + n] = from_entries[source];
        a += u32(take_left);
        b += u32(!take_left);
    }
}

@compute @workgroup_size(64)
fn cs_composite(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = flat_index(id, groups);
    if i >= round.long_count {
        return;
    }
    let first = long[i].first;
    let count = long[i].count;
    var state = State(long[i].color.rgb, long[i].color.a, long[i].transmittance);
    var k = long[i].composited;
    for (var trips = band.trip_budget; trips > 0u && k < count; trips--) {
        insert(&state, node_color[from_entries[first + k]]);
        k++;
        if is_saturated(state) {
            k = count;
        }
    }
    if k < count {
        long[i].color = vec4f(state.color, state.alpha);
        long[i].transmittance = state.transmittance;
        long[i].composited = k;
        atomicStore(&unfinished, 1u);
        return;
    }
    let pixel = long[i].pixel;
    image[pixel] = end(state, background_of(pixel));
    counts[pixel] = count;
}
