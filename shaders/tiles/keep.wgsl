// Translucent fragments of one band, to `keep`: counted, then scattered to their lists (build/count.wgsl,
// build/scatter.wgsl).

@group(1) @binding(0) var<uniform> band: Band;

fn visit(n: u32, pixel: vec2u, center: vec2f, mask: u32) {
    let in_band = pixel - vec2u(band.x0, band.y0);
    if in_band.x >= band.width || in_band.y >= band.height {
        return;
    }
    let opaque_here = is_opaque(n);
    if HIDES && opaque_here {
        return;
    }
    let at = place_of_fragment(mask, center);
    let coverage = mask & FULL_MASK & ~hidden(n, pixel, center, mask);
    if coverage == 0u {
        return;
    }
    var color = color_in(n, at);
    if opaque_here {
        if !passes(n, color) {
            return;
        }
        color.a = 1.0;
    }
    let mode = select((items[n].flags >> BLEND_SHIFT) & 15u, 0u, opaque_here);
    var f = Fragment(color, value_at(items[n].key, at), 0u, coverage, mode);
    if MIXED {
        f.order = ((~items[n].id << 4u) & 0x7ffffff0u) | mode;
    } else {
        f.order = ~items[n].id & 0x7fffffffu;
    }
    if opaque_here {
        f.order |= 0x80000000u;
    }
    keep(f, in_band.y * band.width + in_band.x, true);
}

@compute @workgroup_size(256)
fn cs_keep(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    walk(group.xy + vec2u(band.x0, band.y0) / 16u, group.z, local);
}
