// One sample a pixel, at its centre: what the vertex stage hands on.

// Depth and colour come from planes of the unsnapped triangle, anchored at a vertex, as on the CPU: a
// hardware rasteriser may interpolate between vertices that it has snapped to 1/256 pixel, which is off by
// that times the gradient (measured on an H100: relative depth errors of 5e-4 on 20-pixel triangles).
struct Varyings {
    @builtin(position) @invariant position: vec4f,
    // Colour (over w, under a perspective) at the anchor, per pixel right, and per pixel down.
    @location(0) @interpolate(flat) color_value: vec4f,
    @location(1) @interpolate(flat) color_dx: vec4f,
    @location(2) @interpolate(flat) color_dy: vec4f,
    // The vertices' range: planes may round past it, and flat colours must stay exact.
    @location(3) @interpolate(flat) color_low: vec4f,
    @location(4) @interpolate(flat) color_high: vec4f,
    // What the sort key is made from (1/w under a perspective, else eye depth): at the anchor, right, down.
    @location(5) @interpolate(flat) key_plane: vec3f,
    // The anchor in pixels, and the range of the key's value.
    @location(6) @interpolate(flat) anchor_range: vec4f,
    // primitive; is_opaque and above it the blend mode; bits of alpha_cutoff
    @location(7) @interpolate(flat) ids: vec3u,
}

fn set_inside(out: ptr<function, Varyings>, along_b: vec2f, along_c: vec2f, at_anchor: vec2f) {}

fn location(v: Varyings, mask: u32) -> vec2f {
    return v.position.xy;
}

fn within_depth_range(v: Varyings, mask: u32) -> u32 {
    return select(mask, 0u, beyond_depth_range(value_at(v, v.position.xy)));
}
