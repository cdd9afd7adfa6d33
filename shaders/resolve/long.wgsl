// Lists longer than the temporary array of any class: exact at any length, in O(n log n).
//
// The list is copied to contiguous scratch, runs of it are sorted (blocks by a workgroup each, long_blocks.wgsl, or
// chunks of CHUNK entries by an invocation each), and then merged in rounds of doubling width. In a round each
// invocation writes CHUNK outputs, which it finds by a binary search along its diagonal of the two runs (merge path:
// Odeh, Green, Mwassi, Shmueli and Birk 2012). Walks along a list and the final composite take one invocation a pixel;
// after `band.trip_budget` steps it stores its state, raises `unfinished` and goes on in the next dispatch.

struct LongPixel {
    pixel: u32,
    // Where the pixel's entries start in scratch, a multiple of CHUNK.
    first: u32,
    // Fragments, and how many of them are composited.
    count: u32,
    kept: u32,
    // State of a walk: the next link, and how many entries are written.
    link: u32,
    written: u32,
    // State of a limit: entries looked at, and fragments among them.
    scanned: u32,
    fragments: u32,
}

// State of the composite of one sample: how many entries are in it, and what blending keeps.
struct LongSample {
    composited: u32,
    saved: array<vec4f, 2>,
}

const NONE = 0xffffffffu;

// Entries of a list with what fills its last chunk.
fn padded(count: u32) -> u32 {
    return (count + CHUNK - 1u) / CHUNK * CHUNK;
}

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
    // Of `class_pixels`.
    first_pixel: u32,
    // 1: sort by primitive first, to find the last submitted.
    by_order: u32,
    block_count: u32,
    pad0: u32,
    pad1: u32,
}
@group(1) @binding(5) var<uniform> current: Round;
// Those that the classes left over start at current.first_pixel.
@group(1) @binding(6) var<storage, read> class_pixels: array<u32>;
@group(1) @binding(7) var<storage, read_write> long_samples: array<LongSample>;

// Workgroups per row of a dispatch: one dimension ends at 65,535 of them.
fn flat_index(id: vec3u, groups: vec3u) -> u32 {
    return id.y * groups.x * 64u + id.x;
}

@compute @workgroup_size(64)
fn cs_begin(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = flat_index(id, groups);
    if i >= current.long_count {
        return;
    }
    let pixel = class_pixels[current.first_pixel + i];
    long[i] = LongPixel(pixel, 0u, counts[pixel], 0u, 0u, 0u, 0u, 0u);
}

// Copies a list's nodes to scratch, and fills its last chunk with NONE.
@compute @workgroup_size(64)
fn cs_gather(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = flat_index(id, groups);
    if i >= current.long_count {
        return;
    }
    let first = long[i].first;
    let count = long[i].count;
    var c = first_of(long[i].pixel);
    var written = long[i].written;
    if written > 0u {
        c.link = long[i].link;
    }
    for (var trips = band.trip_budget - CHUNK; trips > 0u && !is_end(c); trips--) {
        from_entries[first + written] = node_at(c);
        advance(&c);
        written++;
    }
    long[i].link = c.link;
    long[i].written = written;
    if !is_end(c) {
        atomicStore(&unfinished, 1u);
        return;
    }
    for (var k = count; k < padded(count); k++) {
        from_entries[first + k] = NONE;
    }
}

fn order_of_entry(entry: u32) -> vec2u {
    if entry == NONE {
        return vec2u(NONE);
    }
    let own = order_of(entry);
    return select(own, by_primitive(own), current.by_order == 1u);
}

// How many entries the first LIMIT fragments of a sorted list are.
@compute @workgroup_size(64)
fn cs_limit(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = flat_index(id, groups);
    if i >= current.long_count {
        return;
    }
    let first = long[i].first;
    let count = long[i].count;
    var k = long[i].scanned;
    var fragments = long[i].fragments;
    var kept = select(long[i].kept, count, k == 0u);
    for (var trips = band.trip_budget; trips > 0u && k < count; trips--) {
        var is_piece = false;
        if k > 0u {
            is_piece = are_pieces(order_of(from_entries[first + k]), order_of(from_entries[first + k - 1u]));
        }
        fragments += u32(!is_piece);
        if fragments > LIMIT {
            kept = min(kept, k);
        }
        k++;
    }
    long[i].scanned = k;
    long[i].fragments = fragments;
    long[i].kept = kept;
    if k < count {
        atomicStore(&unfinished, 1u);
    }
}

// Drops what is beyond the limit, now that the last submitted come first; the rest is sorted anew.
@compute @workgroup_size(64)
fn cs_truncate(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let chunk = flat_index(id, groups);
    if chunk >= current.chunk_count {
        return;
    }
    let owner = chunk_owner[chunk];
    for (var n = 0u; n < CHUNK; n++) {
        if chunk * CHUNK + n - long[owner].first >= long[owner].kept {
            from_entries[chunk * CHUNK + n] = NONE;
        }
    }
}

@compute @workgroup_size(64)
fn cs_sort_chunks(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let chunk = flat_index(id, groups);
    if chunk >= current.chunk_count {
        return;
    }
    for (var n = 0u; n < CHUNK; n++) {
        entries[n] = from_entries[chunk * CHUNK + n];
        order[n] = order_of_entry(entries[n]);
    }
    sort_entries(CHUNK);
    for (var n = 0u; n < CHUNK; n++) {
        from_entries[chunk * CHUNK + n] = entries[n];
    }
}

@compute @workgroup_size(64)
fn cs_merge(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let chunk = flat_index(id, groups);
    if chunk >= current.chunk_count {
        return;
    }
    let owner = chunk_owner[chunk];
    let first = long[owner].first;
    let all = padded(long[owner].count);
    let output = chunk * CHUNK - first;
    let base = output / (2u * current.width) * (2u * current.width);
    let left = first + base;
    let left_count = min(current.width, all - base);
    let right = left + left_count;
    let right_count = min(current.width, all - base - left_count);
    // How many of the outputs before this chunk come from the left run.
    let diagonal = output - base;
    var low = diagonal - min(diagonal, right_count);
    var high = min(diagonal, left_count);
    while low < high {
        let middle = (low + high) / 2u;
        let l = order_of_entry(from_entries[left + middle]);
        let r = order_of_entry(from_entries[right + diagonal - 1u - middle]);
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
            take_left = !in_front(order_of_entry(from_entries[right + b]), order_of_entry(from_entries[left + a]));
        }
        let source = select(right + b, left + a, take_left);
        to_entries[chunk * CHUNK + n] = from_entries[source];
        a += u32(take_left);
        b += u32(!take_left);
    }
}

// One invocation a sample of each pixel.
@compute @workgroup_size(64)
fn cs_composite(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let at = flat_index(id, groups);
    if at >= current.long_count * SAMPLES {
        return;
    }
    let own = long[at / SAMPLES];
    let s = at % SAMPLES;
    let color = behind(own.pixel, s);
    var k = long_samples[at].composited;
    var state = blend_begin(color);
    if k > 0u {
        state = blend_load(long_samples[at].saved);
    }
    for (var trips = band.trip_budget; trips > 0u && k < own.kept; trips--) {
        let entry = from_entries[own.first + select(k, own.kept - 1u - k, BACK_TO_FRONT)];
        k++;
        if (coverage_of(entry) >> s & 1u) == 1u {
            blend_add(&state, source_of(entry));
            if blend_done(state) {
                k = own.kept;
            }
        }
    }
    long_samples[at].composited = k;
    long_samples[at].saved = blend_save(state);
    if k < own.kept {
        atomicStore(&unfinished, 1u);
    }
}

@compute @workgroup_size(64)
fn cs_finish(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = flat_index(id, groups);
    if i >= current.long_count {
        return;
    }
    let pixel = long[i].pixel;
    var colors: array<vec4f, SAMPLES>;
    for (var s = 0u; s < SAMPLES; s++) {
        colors[s] = blend_end(blend_load(long_samples[i * SAMPLES + s].saved), behind(pixel, s));
    }
    finish(pixel, &colors);
}
