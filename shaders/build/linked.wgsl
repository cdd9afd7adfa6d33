// Per-pixel linked lists (Yang, Hensley, Grün and Thibieroz 2010; GPU Pro 2, listing 2.1): a counter hands
// out nodes, an exchange on the pixel's head links them. The counter runs past the pool's capacity, so
// that after the pass it is the exact demand.

@group(1) @binding(1) var<storage, read_write> heads: array<atomic<u32>>;
// Fragments so far: the low word hands out nodes, the high word counts how often it wrapped.
@group(1) @binding(3) var<storage, read_write> counter: array<atomic<u32>, 2>;

// How many fragments each pixel has: an addition that nothing waits for, where the resolve would walk each list.
@group(1) @binding(4) var<storage, read_write> pixel_counts: array<atomic<u32>>;

fn keep(f: Fragment, pixel: u32, kept: bool) {
    let node = hand_out(kept);
    // Before the exchange: linking a node that does not exist would lose the rest of the list.
    if !kept || node >= band.capacity {
        return;
    }
    atomicAdd(&pixel_counts[pixel], 1u);
    write_node(node, f, atomicExchange(&heads[pixel], node + 1u));
}

// Takes `n` nodes and returns the first.
fn take(n: u32) -> u32 {
    let node = atomicAdd(&counter[0], n);
    if node > 0xffffffffu - n {
        atomicAdd(&counter[1], 1u); // nodes are handed out twice from here on; the host discards the pass
    }
    return node;
}
