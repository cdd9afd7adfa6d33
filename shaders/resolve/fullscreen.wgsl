// The resolve as the chapter draws it: a full-screen pass, in which the stencil that the build incremented keeps
// empty pixels away (GPU Pro 2, section 2.8.2); with several samples there is no such stencil (section 2.8.3). One draw
// a class; it writes to the same buffers as the dispatch.

@vertex
fn vs_resolve(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    // One triangle that covers the screen.
    return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

fn resolve_at(position: vec4f) {
    let at = vec2u(position.xy) - vec2u(band.x0, band.y0);
    if at.x >= band.width || at.y >= band.height {
        return;
    }
    let pixel = at.y * band.width + at.x;
    let n = counts[pixel];
    if n > CLASS_ABOVE && n <= TEMP {
        for (var s = 0u; s < INVOCATIONS_PER_PIXEL; s++) {
            resolve_pixel(pixel, s);
        }
    }
}
