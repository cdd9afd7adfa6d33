// There is no opaque geometry, or it hides nothing.

fn hidden(n: u32, pixel: vec2u, center: vec2f, mask: u32) -> u32 {
    return 0u;
}
