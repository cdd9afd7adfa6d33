// Without subgroups: each invocation by itself.

// The most fragments of a pixel among those that branch together.
fn widest(n: u32) -> u32 {
    return n;
}

fn count_visible() {
    if visible > 0u {
        atomicAdd(&fragments, visible);
        atomicMax(&deepest, visible);
    }
}
