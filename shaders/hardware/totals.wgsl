// What the pass that counts found: fragments in all, of the deepest pixel, and beyond a limit.

struct Totals {
    fragments: atomic<u32>,
    deepest: atomic<u32>,
    beyond: atomic<u32>,
    pad: u32,
}

@group(0) @binding(0) var counts: texture_2d<f32>;
@group(0) @binding(1) var<storage, read_write> totals: Totals;
@group(0) @binding(2) var<uniform> limit: vec4u;

var<workgroup> fragments: atomic<u32>;
var<workgroup> deepest: atomic<u32>;
var<workgroup> beyond: atomic<u32>;

@compute @workgroup_size(16, 16)
fn cs_totals(@builtin(global_invocation_id) pixel: vec3u, @builtin(local_invocation_index) local: u32) {
    if local == 0u {
        atomicStore(&fragments, 0u);
        atomicStore(&deepest, 0u);
        atomicStore(&beyond, 0u);
    }
    workgroupBarrier(); // they are 0
    if all(pixel.xy < textureDimensions(counts)) {
        let count = u32(textureLoad(counts, pixel.xy, 0).r);
        atomicAdd(&fragments, count);
        atomicMax(&deepest, count);
        atomicAdd(&beyond, count - min(count, limit.x));
    }
    workgroupBarrier(); // all are counted
    if local == 0u {
        atomicAdd(&totals.fragments, atomicLoad(&fragments));
        atomicMax(&totals.deepest, atomicLoad(&deepest));
        atomicAdd(&totals.beyond, atomicLoad(&beyond));
    }
}
