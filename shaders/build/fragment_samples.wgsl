// Opaque surfaces hide samples, not pixels: no API tells a shader which samples passed the depth test, so the
// shader compares them for itself.

@group(2) @binding(0) var opaque_depth: texture_depth_multisampled_2d;

// The opaque pass computes its depths by the same expressions, which a compiler may contract otherwise: what is
// this much behind counts as equal, and a fragment at the opaque depth is kept.
const SLACK = 1.0 / 4194304.0; // 2⁻²²

fn enter(v: Varyings, mask: u32) {
    var visible = mask;
    for (var s = 0u; s < SAMPLES; s++) {
        let own = window_depth(value_at(v, sample_position(v, s)));
        let opaque_z = textureLoad(opaque_depth, vec2u(v.position.xy), s);
        let slack = SLACK * select(1.0, opaque_z, view.perspective == 1u);
        if own < opaque_z - slack {
            visible &= ~(1u << s);
        }
    }
    store_samples(v, mask, visible);
}
