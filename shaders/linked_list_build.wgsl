// Per-pixel linked lists (Yang, Hensley, Grün and Thibieroz 2010; GPU Pro 2, listing 2.1): a counter hands
// out nodes, an exchange on the pixel's head links them. The counter runs past the pool's capacity, so
// that after the pass it is the exact demand.
//
// Heads and links hold a node's index plus one, and 0 for none: buffers are cleared to zero.

@group(1) @binding(0) var<uniform> band: Band;
@group(1) @binding(1) var<storage, read_write> heads: array<atomic<u32>>;
// Fragments so far: the low word hands out nodes, the high word counts how often it wrapped.
@group(1) @binding(2) var<storage, read_write> counter: array<atomic<u32>, 2>;
@group(1) @binding(3) var<storage, read_write> node_color: array<vec4f>;
// (key, order): order is the complement of the primitive, so that later triangles win ties; its top bit
// puts a listed opaque surface behind translucent ones at its depth.
@group(1) @binding(4) var<storage, read_write> node_order: array<vec2u>;
@group(1) @binding(5) var<storage, read_write> node_next: array<u32>;

@vertex
fn vs_build(@builtin(vertex_index) index: u32) -> Varyings {
    return rasterise(index, false);
}

fn store(v: Varyings) {
    let shaded = shade(v);
    if beyond_depth_range(shaded.value) || is_cut_out(v, shaded.color) {
        return;
    }
    var color = shaded.color;
    let pixel = vec2u(v.position.xy) - vec2u(band.x0, band.y0);
    if pixel.x >= band.width || pixel.y >= band.height {
        return; // the scissor rectangle keeps these away
    }
    let node = atomicAdd(&counter[0], 1u);
    if node == 0xffffffffu {
        atomicAdd(&counter[1], 1u); // nodes are handed out twice from here on; the host discards the pass
    }
    // Before the exchange: linking a node that does not exist would lose the rest of the list.
    if node >= band.capacity {
        return;
    }
    var order = ~v.ids.x & 0x7fffffffu;
    if v.ids.y == 1u {
        color.a = 1.0;
        order |= 0x80000000u;
    }
    let head = pixel.y * band.width + pixel.x;
    node_next[node] = atomicExchange(&heads[head], node + 1u);
    node_color[node] = color;
    node_order[node] = vec2u(sort_key(shaded.value, view.perspective == 1u), order);
}
