// Handing out nodes. The counter runs past the pool's capacity, so that after the pass it is the exact demand.

// Fragments so far: the low word hands out nodes, the high word counts how often it wrapped.
@group(1) @binding(3) var<storage, read_write> counter: array<atomic<u32>, 2>;
// How many fragments each pixel has: an addition that nothing waits for, where the resolve would walk each list.
@group(1) @binding(4) var<storage, read_write> pixel_counts: array<atomic<u32>>;

// Takes `n` nodes and returns the first.
fn take(n: u32) -> u32 {
    let node = atomicAdd(&counter[0], n);
    if node > 0xffffffffu - n {
        atomicAdd(&counter[1], 1u); // nodes are handed out twice from here on; the host discards the pass
    }
    return node;
}
