// Every fragment that arrives is visible: there is no opaque geometry, or the depth test against it runs before the
// shader, which writes to storage (GPU Pro 2, section 2.3.4).

fn enter(v: Varyings, mask: u32) {
    store(v, mask);
}
