// Opaque and alpha-tested geometry: the nearest of each sample hides what is strictly behind it, and becomes its
// background.

@group(1) @binding(0) var<storage, read_write> opaque_keys: array<u32>;
@group(1) @binding(1) var<storage, read_write> opaque_colors: array<vec4f>;

fn visit(n: u32, pixel: vec2u, center: vec2f, mask: u32) {
    if !is_opaque(n) {
        return;
    }
    let color = color_in(n, place_of_fragment(mask, center));
    if !passes(n, color) {
        return;
    }
    for (var s = 0u; s < SAMPLES; s++) {
        if (mask >> s & 1u) == 1u {
            var at = center;
            if SAMPLES > 1u {
                at = sample_at(center, s);
            }
            let key = sort_key(value_at(items[n].key, at));
            let slot = (pixel.y * view.width + pixel.x) * SAMPLES + s;
            // Of equal ones the later wins, and triangles come in order.
            if key <= opaque_keys[slot] {
                opaque_keys[slot] = key;
                opaque_colors[slot] = vec4f(color.rgb, 1.0);
            }
        }
    }
}

@compute @workgroup_size(256)
fn cs_opaque(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let tile = group.xy + vec2u(0u, window.first_row);
    if window.first == 0u {
        let pixel = tile * 16u + vec2u(local % 16u, local / 16u);
        if pixel.x < view.width && pixel.y < view.height {
            for (var s = 0u; s < SAMPLES; s++) {
                let slot = (pixel.y * view.width + pixel.x) * SAMPLES + s;
                opaque_keys[slot] = 0xffffffffu;
                // Alpha 0 marks what no opaque surface covers.
                opaque_colors[slot] = vec4f(0.0);
            }
        }
    }
    walk(tile, 0u, local);
}
