// Per-pixel linked lists (Yang, Hensley, Grün and Thibieroz 2010; GPU Pro 2, listing 2.1): a counter hands
// out nodes, an exchange on the pixel's head links them.

@group(1) @binding(1) var<storage, read_write> heads: array<atomic<u32>>;

fn keep(f: Fragment, pixel: u32, kept: bool) {
    let node = hand_out(kept);
    // Before the exchange: linking a node that does not exist would lose the rest of the list.
    if !kept || node >= band.capacity {
        return;
    }
    atomicAdd(&pixel_counts[pixel], 1u);
    write_node(node, f, atomicExchange(&heads[pixel], node + 1u));
}
