// Which pixel centres a snapped triangle covers: integer edge functions and the top-left rule (Pineda 1988), with the
// bits of src/cpu/coverage.rs.

// Relative to the centre of the first pixel of a region of at most 16×16: pixel (i, j) is inside where
// q + a·i + b·j ≥ 0 for all three edges.
struct Edges {
    a: vec3i,
    b: vec3i,
    q: vec3i,
    // What flooring q left, in 1/16 pixel: samples lie on that grid.
    r: vec3i,
}

fn edges_of(corners: array<i32, 6>, x0: i32, y0: i32) -> Edges {
    // The centre of pixel i lies at 256 i + 128.
    let center = vec2i(256 * x0 + 128, 256 * y0 + 128);
    let p = array<vec2i, 3>(
        vec2i(corners[0], corners[1]),
        vec2i(corners[2], corners[3]),
        vec2i(corners[4], corners[5]),
    );
    // Within 64 pixels of the region everything fits 32 bits: 2^14.5 each way, and 2^29 a product.
    let far = max(max(abs(p[0] - center), abs(p[1] - center)), abs(p[2] - center));
    let is_near = max(far.x, far.y) < 20000;
    var e: Edges;
    for (var i = 0; i < 3; i++) {
        let start = p[i];
        let d = p[(i + 1) % 3] - start;
        let to = center - start;
        let top_or_left = d.y < 0 || (d.y == 0 && d.x > 0);
        let bias = select(1, 0, top_or_left);
        // Whole pixels move an edge function by multiples of 256, so flooring by it changes no sign.
        // The clamp cannot either: |a|, |b| < 2^24.6, so 15 steps of each add less than 2^30.
        if is_near {
            let value = d.x * to.y - d.y * to.x - bias;
            e.q[i] = value >> 8u;
            e.r[i] = (value & 255) >> 4u;
        } else {
            let exact = wide_cross(d.x, to.y, d.y, to.x);
            let value = wide_add(exact, select(vec2u(0xffffffffu), vec2u(0u), top_or_left));
            let high = bitcast<i32>(value.y);
            // value >> 8, clamped to ±2^30: that is value in ±2^38, or its upper word in ±2^6.
            let shifted = bitcast<i32>((value.x >> 8u) | (value.y << 24u));
            e.q[i] = select(select(shifted, 1 << 30u, high >= 64), -(1 << 30u), high < -64);
            e.r[i] = i32((value.x & 255u) >> 4u);
        }
        e.a[i] = -d.y;
        e.b[i] = d.x;
    }
    return e;
}

fn flags_of(r: Raster) -> u32 {
    return bitcast<u32>(r.values.w);
}

// The edges of a triangle without pieces, relative to the pixel (x0, y0). Within its box, grown by less than a bin,
// everything fits 32 bits: slopes are below 2^18, and distances below 2^11.
fn edges_at_pixel(r: Raster, box: vec4i, x0: i32, y0: i32) -> Edges {
    var e: Edges;
    e.a = vec3i(r.slopes.xy, -r.slopes.x - r.slopes.y);
    e.b = vec3i(r.slopes.zw, -r.slopes.z - r.slopes.w);
    e.q = r.values.xyz + e.a * (x0 - box.x) + e.b * (y0 - box.y);
    if SAMPLES > 1u {
        let flags = flags_of(r);
        e.r = vec3i(
            i32((flags >> REST_SHIFT) & 15u),
            i32((flags >> (REST_SHIFT + 4u)) & 15u),
            i32(flags >> LAST_REST_SHIFT),
        );
    }
    return e;
}

// No pixel of the first w × h can be inside.
fn misses(e: Edges, w: i32, h: i32) -> bool {
    var most = e.q + max(e.a * (w - 1), vec3i(0)) + max(e.b * (h - 1), vec3i(0));
    if SAMPLES > 1u {
        most += (15 + 8 * abs(e.a) + 8 * abs(e.b)) >> vec3u(4u);
    }
    return min(most.x, min(most.y, most.z)) < 0;
}

// The edge functions of the sample at (kx, ky)/16 pixel from each centre.
fn edges_at(e: Edges, kx: i32, ky: i32) -> vec3i {
    return e.q + ((e.r + e.a * kx + e.b * ky) >> vec3u(4u));
}
