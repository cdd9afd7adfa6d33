// Where the depth test cannot be forced before the shader, the shader compares for itself.

@group(2) @binding(0) var opaque_depth: texture_depth_2d;

fn enter(v: Varyings, mask: u32) {
    let visible = v.position.z >= textureLoad(opaque_depth, vec2u(v.position.xy), 0);
    store(v, select(0u, mask, visible));
}
