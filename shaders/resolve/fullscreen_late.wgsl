// Where the test cannot be forced before the shader, empty pixels run it and return.

@fragment
fn fs_resolve(@builtin(position) position: vec4f) {
    resolve_at(position);
}
