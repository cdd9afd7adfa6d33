// Where the depth test cannot be forced before the shader, the shader compares for itself.

@group(2) @binding(0) var opaque_depth: texture_depth_2d;

@fragment
fn fs_build(v: Varyings) {
    if v.position.z >= textureLoad(opaque_depth, vec2u(v.position.xy), 0) {
        store(v);
    }
}
