// Sums over a workgroup of 256. `sum_before` (sums_steps.wgsl, sums_subgroup.wgsl) returns the sum of `value` over the
// invocations before this one, and leaves the sum of all in sums[255].

var<workgroup> sums: array<u32, 256>;

// In eight steps (Hillis and Steele 1986).
fn sum_in_steps(value: u32, local: u32) -> u32 {
    sums[local] = value;
    for (var step = 1u; step < 256u; step *= 2u) {
        workgroupBarrier(); // sums of the step before are written
        var left = 0u;
        if local >= step {
            left = sums[local - step];
        }
        workgroupBarrier(); // and read by all
        sums[local] += left;
    }
    workgroupBarrier(); // the last step's sums are written
    return sums[local] - value;
}
