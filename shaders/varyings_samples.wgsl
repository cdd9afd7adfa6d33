// Several samples a pixel (GPU Pro 2, section 2.7): what the vertex stage hands on, and where a fragment's one depth
// and one colour are taken.

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
    // Barycentric b and c over w: per pixel right and down, and at the anchor.
    @location(8) @interpolate(flat) inside_slopes: vec4f,
    @location(9) @interpolate(flat) inside_anchor: vec2f,
}

fn set_inside(out: ptr<function, Varyings>, along_b: vec2f, along_c: vec2f, at_anchor: vec2f) {
    (*out).inside_slopes = vec4f(along_b, along_c);
    (*out).inside_anchor = at_anchor;
}

// Under sample shading the position is the sample's.
fn center(v: Varyings) -> vec2f {
    return floor(v.position.xy) + 0.5;
}

fn sample_position(v: Varyings, s: u32) -> vec2f {
    var offsets = PATTERN;
    return center(v) + offsets[s];
}

// Whether the triangle covers a point: no barycentric coordinate (over w) is negative, and the point lies between
// near and far.
fn covers(v: Varyings, at: vec2f) -> bool {
    let d = at - v.anchor_range.xy;
    let b = v.inside_anchor.x + dot(v.inside_slopes.xy, d);
    let c = v.inside_anchor.y + dot(v.inside_slopes.zw, d);
    let value = v.key_plane.x + dot(v.key_plane.yz, d);
    let perspective = view.perspective == 1u;
    let all = select(1.0, value, perspective);
    // The hardware clips at near under a perspective.
    let behind_near = perspective && value * view.near > 1.0;
    return min(min(b, c), all - b - c) >= 0.0 && !behind_near && !beyond_depth_range(value);
}

// The centre if the triangle covers it, else the lowest covered sample. The pieces that clipping cuts a triangle
// into may meet inside a pixel: what the whole triangle covers decides, so that they get the same depth and colour.
fn location(v: Varyings, mask: u32) -> vec2f {
    if mask == FULL_MASK || covers(v, center(v)) {
        return center(v);
    }
    return sample_position(v, min(firstTrailingBit(whole_mask(v) | mask), SAMPLES - 1u));
}

fn whole_mask(v: Varyings) -> u32 {
    var mask = 0u;
    for (var s = 0u; s < SAMPLES; s++) {
        mask |= u32(covers(v, sample_position(v, s))) << s;
    }
    return mask;
}

fn within_depth_range(v: Varyings, mask: u32) -> u32 {
    var kept = mask;
    for (var s = 0u; s < SAMPLES; s++) {
        if beyond_depth_range(value_at(v, sample_position(v, s))) {
            kept &= ~(1u << s);
        }
    }
    return kept;
}
