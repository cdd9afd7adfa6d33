// No opaque geometry: every fragment is visible.

@fragment
fn fs_build(v: Varyings, @builtin(sample_mask) mask: u32) {
    store(v, mask);
}
