// The stencil test runs before the shader, which writes to storage.

@fragment
@early_depth_test(force)
fn fs_resolve(@builtin(position) position: vec4f) {
    resolve_at(position);
}
