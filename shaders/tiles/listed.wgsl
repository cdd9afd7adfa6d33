// A pixel's sorted fragments, kept side by side. Pixels come in any order: `list_starts` says where each one's list is.

@group(1) @binding(6) var<storage, read_write> list_starts: array<u32>;
// Keys and primitives.
@group(1) @binding(7) var<storage, read_write> listed: array<vec2u>;
@group(1) @binding(8) var<storage, read_write> listed_colors: array<vec4f>;

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
    if slot < window.list_capacity { // else the host counts, and makes room
        listed[slot] = vec2u(sort_key(value_at(key_planes[id], at)), id);
        listed_colors[slot] = color;
    }
}
