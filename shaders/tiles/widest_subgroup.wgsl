// With subgroups, whose invocations branch as one.

// The most fragments of a pixel among those that branch together.
fn widest(n: u32) -> u32 {
    return subgroupMax(n);
}

fn count_visible() {
    let sum = subgroupAdd(visible);
    let most = subgroupMax(visible);
    if subgroupExclusiveAdd(1u) == 0u && sum > 0u { // the first of them
        atomicAdd(&fragments, sum);
        atomicMax(&deepest, most);
    }
}
