// Blocks of a long list, sorted by a workgroup each: Batcher's bitonic network in workgroup memory (Knuth, The Art of
// Computer Programming, volume 3, 5.3.4), which leaves merges to lists of more than LONG_BLOCK entries.

const INVOCATIONS = 256u;

// The chunk that each block starts at.
@group(1) @binding(8) var<storage, read> block_starts: array<u32>;

// Of an order its first half. The second is read where the first ones are equal.
var<workgroup> block_keys: array<u32, LONG_BLOCK>;
var<workgroup> block_entries: array<u32, LONG_BLOCK>;
var<workgroup> block_count: u32;

// Puts the nearer of two entries first. What lies past the end counts as greatest.
fn exchange_in_block(i: u32, j: u32, n: u32) {
    if j >= n {
        return;
    }
    let a = vec2u(block_keys[i], block_entries[i]);
    let b = vec2u(block_keys[j], block_entries[j]);
    var swaps = b.x < a.x;
    if a.x == b.x {
        swaps = in_front(order_of_entry(b.y), order_of_entry(a.y));
    }
    if swaps {
        block_keys[i] = b.x;
        block_keys[j] = a.x;
        block_entries[i] = b.y;
        block_entries[j] = a.y;
    }
}

@compute @workgroup_size(INVOCATIONS)
fn cs_sort_blocks(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let block = group.y * groups.x + group.x;
    if block >= current.block_count {
        return;
    }
    let first = block_starts[block] * CHUNK;
    if local == 0u {
        let own = long[chunk_owner[block_starts[block]]];
        block_count = min(own.first + padded(own.count) - first, LONG_BLOCK);
    }
    let n = workgroupUniformLoad(&block_count);
    for (var i = local; i < n; i += INVOCATIONS) {
        let entry = from_entries[first + i];
        block_entries[i] = entry;
        block_keys[i] = order_of_entry(entry).x;
    }
    workgroupBarrier(); // all entries are there
    var pairs = 1u; // half of the least power of two that has room for n
    while 2u * pairs < n {
        pairs *= 2u;
    }
    for (var half = 1u; half <= pairs; half *= 2u) {
        // The second half of each run counts backwards, so that what is past the end stays there.
        for (var p = local; p < pairs; p += INVOCATIONS) {
            let run = p / half * (2u * half);
            exchange_in_block(run + p % half, run + 2u * half - 1u - p % half, n);
        }
        workgroupBarrier(); // what the next step compares is written
        for (var step = half / 2u; step > 0u; step /= 2u) {
            for (var p = local; p < pairs; p += INVOCATIONS) {
                let i = p / step * (2u * step) + p % step;
                exchange_in_block(i, i + step, n);
            }
            workgroupBarrier(); // as above
        }
    }
    for (var i = local; i < n; i += INVOCATIONS) {
        from_entries[first + i] = block_entries[i];
    }
}
