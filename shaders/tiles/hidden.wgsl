// Opaque surfaces hide samples, not pixels. What lies at their depth is kept.

fn hidden(n: u32, pixel: vec2u, center: vec2f, mask: u32) -> u32 {
    var bits = 0u;
    for (var s = 0u; s < SAMPLES; s++) {
        var at = center;
        if SAMPLES > 1u {
            at = sample_at(center, s);
        }
        let slot = (pixel.y * view.width + pixel.x) * SAMPLES + s;
        if sort_key(value_at(items[n].key, at)) > opaque_keys[slot] {
            bits |= 1u << s;
        }
    }
    return bits;
}
