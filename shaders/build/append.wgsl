// Appending: nodes as they come, each with its pixel in place of a link; gather.wgsl brings them into lists.

fn keep(f: Fragment, pixel: u32, kept: bool) {
    let node = hand_out(kept);
    if !kept || node >= band.capacity {
        return;
    }
    atomicAdd(&pixel_counts[pixel], 1u);
    write_node(node, f, pixel);
}
