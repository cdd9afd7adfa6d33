// Exclusive prefix sums (Blelloch 1990): each workgroup sums SCAN_BLOCK values and leaves its total for the level
// above, which is scanned in the same way; then totals are added back.

@group(0) @binding(0) var<storage, read_write> values: array<u32>;
@group(0) @binding(1) var<storage, read_write> totals: array<u32>;
// x: how many values there are.
@group(0) @binding(2) var<uniform> size: vec4u;
// The sum of everything, in 64 bits: low word and carries. Of the first level alone, where size.y is 1.
@group(0) @binding(3) var<storage, read_write> grand_total: array<atomic<u32>, 2>;

const THREADS = 256u;
const EACH = SCAN_BLOCK / THREADS;

fn block_of(group: vec3u, groups: vec3u) -> u32 {
    return group.y * groups.x + group.x;
}

@compute @workgroup_size(256)
fn cs_scan(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let block = block_of(group, groups);
    let first = block * SCAN_BLOCK + local * EACH;
    var own: array<u32, EACH>;
    var sum = 0u;
    for (var i = 0u; i < EACH; i++) {
        own[i] = sum;
        if first + i < size.x {
            sum += values[first + i];
        }
    }
    let before = sum_before(sum, local);
    for (var i = 0u; i < EACH; i++) {
        if first + i < size.x {
            values[first + i] = own[i] + before;
        }
    }
    if local == THREADS - 1u && block * SCAN_BLOCK < size.x {
        totals[block] = sums[local];
        if size.y == 1u {
            let before_all = atomicAdd(&grand_total[0], sums[local]);
            if before_all > 0xffffffffu - sums[local] {
                atomicAdd(&grand_total[1], 1u);
            }
        }
    }
}

@compute @workgroup_size(256)
fn cs_add(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let block = block_of(group, groups);
    for (var i = 0u; i < EACH; i++) {
        let at = block * SCAN_BLOCK + local * EACH + i;
        if at < size.x {
            values[at] += totals[block];
        }
    }
}
