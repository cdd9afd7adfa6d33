// The last pass of count, scan, scatter: a pixel's cursor starts where its list does, and hands out its nodes.

@group(1) @binding(1) var<storage, read_write> cursors: array<atomic<u32>>;

fn keep(f: Fragment, pixel: u32, kept: bool) {
    if !kept {
        return;
    }
    let node = atomicAdd(&cursors[pixel], 1u);
    if node < band.capacity {
        write_node(node, f, 0u);
    }
}
