// A pixel's sorted fragments, kept side by side. Pixels come in any order: `list_starts` says where each one's list is.

const LISTED_WORDS = 6u;

@group(1) @binding(6) var<storage, read_write> list_starts: array<u32>;
// Keys of all fragments, then primitives, then colours; `window.list_capacity` fragments each.
@group(1) @binding(7) var<storage, read_write> listed: array<u32>;

var<workgroup> part_fragments: atomic<u32>;
var<workgroup> shared_start: u32;

var<private> list_start: u32;

// Takes room for n fragments of the own pixel. What opaque surfaces turn out to hide stays empty.
fn begin_list(n: u32, local: u32) {
    if local == 0u {
        atomicStore(&part_fragments, 0u);
    }
    workgroupBarrier(); // nothing is counted yet
    list_start = atomicAdd(&part_fragments, n);
    workgroupBarrier(); // all pixels are counted
    if local == 0u {
        shared_start = atomicAdd(&classes.listed, atomicLoad(&part_fragments));
    }
    list_start += workgroupUniformLoad(&shared_start);
}

fn end_list(pixel: u32) {
    list_starts[pixel] = list_start;
}

// The i-th nearest fragment of the own pixel.
fn keep(i: u32, id: u32, at: vec2f, color: vec4f) {
    let slot = list_start + i;
    let room = window.list_capacity;
    if slot >= room {
        return; // the host counts, and makes room
    }
    listed[slot] = sort_key(value_at(key_planes[id], at));
    listed[room + slot] = id;
    let c = bitcast<vec4u>(color);
    let first = 2u * room + 4u * slot;
    listed[first] = c.r;
    listed[first + 1u] = c.g;
    listed[first + 2u] = c.b;
    listed[first + 3u] = c.a;
}
