// The depth test against opaque geometry runs before the shader, which writes to storage (GPU Pro 2,
// section 2.3.4).

@fragment
@early_depth_test(force)
fn fs_build(v: Varyings, @builtin(sample_mask) mask: u32) {
    store(v, mask);
}
