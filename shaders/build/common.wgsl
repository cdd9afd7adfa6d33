// The passes over translucent geometry: what a covered pixel does with its fragment is the stage's business
// (`keep`, in linked.wgsl, count.wgsl and scatter.wgsl).

@group(1) @binding(0) var<uniform> band: Band;

@vertex
fn vs_build(@builtin(vertex_index) index: u32) -> Varyings {
    return rasterise(index, false);
}

fn store(v: Varyings, mask: u32) {
    store_samples(v, mask, mask);
}

// `mask`: the samples that the hardware found covered, 0 in a helper invocation. `visible`: those of them that no
// opaque surface hides.
fn store_samples(v: Varyings, mask: u32, visible: u32) {
    // The hardware does not clip at far.
    let clipped = within_depth_range(v, mask);
    let shaded = shade(v, location(v, clipped));
    let coverage = clipped & visible;
    let pixel = vec2u(v.position.xy) - vec2u(band.x0, band.y0);
    // The scissor rectangle keeps pixels of other bands away; helper invocations may come from there.
    let inside = pixel.x < band.width && pixel.y < band.height;
    let kept = inside && coverage != 0u && !is_cut_out(v, shaded.color);
    let is_opaque = (v.ids.y & 1u) == 1u;
    let mode = select(v.ids.y >> 1u, 0u, is_opaque);
    var f = Fragment(shaded.color, shaded.value, 0u, coverage, mode);
    if MIXED {
        f.order = ((~v.ids.x << 4u) & 0x7ffffff0u) | mode;
    } else {
        f.order = ~v.ids.x & 0x7fffffffu;
    }
    if is_opaque {
        f.color.a = 1.0;
        f.order |= 0x80000000u;
    }
    keep(f, pixel.y * band.width + pixel.x, kept);
}
