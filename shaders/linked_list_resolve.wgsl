// Resolve (GPU Pro 2, section 2.6): walk a pixel's list into a temporary array that is kept sorted by
// insertion, then composite it. The array is a fast path and no limit: pixels with more fragments are
// handed on to the stages in linked_list_long.wgsl.

struct LongPixels {
    count: atomic<u32>,
    pixels: array<u32>,
}

@group(1) @binding(0) var<storage, read_write> long_pixels: LongPixels;

@compute @workgroup_size(8, 8)
fn cs_resolve(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= band.width || id.y >= band.height {
        return;
    }
    let pixel = id.y * band.width + id.x;
    var order: array<vec2u, TEMP_FRAGMENTS>;
    var nodes: array<u32, TEMP_FRAGMENTS>;
    var n = 0u;
    var link = heads[pixel];
    while link != 0u {
        if n == TEMP_FRAGMENTS {
            long_pixels.pixels[atomicAdd(&long_pixels.count, 1u)] = pixel;
            return;
        }
        let node = link - 1u;
        let own = node_order[node];
        var i = n;
        while i > 0u && in_front(own, order[i - 1u]) {
            order[i] = order[i - 1u];
            nodes[i] = nodes[i - 1u];
            i--;
        }
        order[i] = own;
        nodes[i] = node;
        n++;
        link = node_next[node];
    }
    var state = begin();
    for (var i = 0u; i < n; i++) {
        insert(&state, node_color[nodes[i]]);
        if is_saturated(state) {
            break;
        }
    }
    image[pixel] = end(state, background_of(pixel));
    counts[pixel] = n;
}
