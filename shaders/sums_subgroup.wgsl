// With subgroups: each sums its own, and adds those before it, for 4 barriers where steps have 17.

var<workgroup> is_out_of_order: u32;

fn sum_before(value: u32, local: u32) -> u32 {
    let size = subgroupAdd(1u);
    let lane = subgroupExclusiveAdd(1u);
    let in_subgroup = subgroupExclusiveAdd(value);
    let sum = subgroupAdd(value);
    let first = subgroupMin(local);
    // Vulkan does not promise that invocations come to subgroups in their order, though all drivers seem to do it.
    let in_order = subgroupAll((local == first + lane) & (first % size == 0u));
    if local == 0u {
        is_out_of_order = 0u;
    }
    workgroupBarrier(); // it is 0
    if !in_order {
        is_out_of_order = 1u;
    }
    if lane == 0u {
        sums[first / size] = sum;
    }
    if workgroupUniformLoad(&is_out_of_order) == 1u {
        return sum_in_steps(value, local);
    }
    var before = in_subgroup;
    for (var i = 0u; i < first / size; i++) {
        before += sums[i];
    }
    workgroupBarrier(); // the sums of subgroups are read
    if local == 255u {
        sums[255] = before + value;
    }
    workgroupBarrier(); // the sum of all is written
    return before;
}
