// Brings appended nodes into contiguous lists, once the lengths of those before each are summed: count, scan, scatter
// without a second pass over the geometry.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> band: Band;
@group(0) @binding(2) var<storage, read> counter: array<u32, 2>;
@group(0) @binding(3) var<storage, read> nodes: array<u32>;
@group(0) @binding(4) var<storage, read_write> cursors: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> gathered: array<u32>;

@compute @workgroup_size(256)
fn cs_gather(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let node = id.y * groups.x * 256u + id.x;
    if counter[1] > 0u || node >= min(counter[0], band.capacity) {
        return;
    }
    let pixel = next_of(node);
    if pixel >= band.width * band.height {
        return; // a node that was handed out and not written is no more than missing
    }
    let place = atomicAdd(&cursors[pixel], 1u);
    // Where nodes are missing, lists are longer than what there is; the host discards them.
    if place < band.capacity {
        for (var i = 0u; i < NODE_WORDS; i++) {
            gathered[place * NODE_WORDS + i] = word(node, i);
        }
    }
}
