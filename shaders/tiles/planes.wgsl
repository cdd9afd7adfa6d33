// Depth and barycentric coordinates at any pixel, from the unsnapped, unclipped triangle (src/cpu/plane.rs).

// The power of two that brings a positive value into [1, 2).
fn inverse_binade(value: f32) -> f32 {
    let exponent = (bitcast<u32>(value) & 0x7fffffffu) >> 23u;
    return bitcast<f32>((254u - min(exponent, 253u)) << 23u);
}

fn crossed(a: vec3f, b: vec3f) -> vec3f {
    return vec3f(
        product(a.y, b.z) - product(a.z, b.y),
        product(a.z, b.x) - product(a.x, b.z),
        product(a.x, b.y) - product(a.y, b.x),
    );
}

// An attribute c over w is m · (X, Y, 1) in NDC, where m solves (x, y, w)ᵢ · m = cᵢ at the three corners (Olano and
// Greer 1997). `low` and `high` are the key's range over what is visible. Also returns which corner the planes are
// anchored at, or 3 if a value is not finite.
fn write_planes(index: u32, t: Triangle, low: f32, high: f32, mesh: MeshInfo) -> u32 {
    let a = t.corners[0];
    let b = t.corners[1];
    let c = t.corners[2];
    let largest = max(max(max(abs(a.x), abs(a.y)), max(abs(b.x), abs(b.y))),
        max(max(abs(c.x), abs(c.y)), max(abs(a.w), max(abs(b.w), abs(c.w)))));
    let scale = inverse_binade(largest);
    let origin = vec3f(a.x, a.y, a.w) * scale; // exact, as are the next two
    let ab = vec3f(b.x, b.y, b.w) * scale - origin;
    let ac = vec3f(c.x, c.y, c.w) * scale - origin;
    let normal = crossed(ab, ac);
    let determinant = product(origin.x, normal.x) + product(origin.y, normal.y) + product(origin.z, normal.z);
    // Seen edge-on: any corner's value is as good as another.
    var inverse = 0.0;
    if determinant != 0.0 {
        inverse = quotient(scale, determinant);
    }
    let to_pixels = vec2f(product(eye.to_pixels.x, inverse), product(eye.to_pixels.y, inverse));
    let constant = slope_of(normal, to_pixels);
    let along_b = slope_of(crossed(ac, origin), to_pixels);
    let along_c = slope_of(crossed(origin, ab), to_pixels);

    // The corner in front of the eye that lands nearest the middle of the screen.
    var anchor = 3u;
    var least = 0.0;
    var at = a;
    for (var i = 0u; i < 3u; i++) {
        let corner = t.corners[i];
        if corner.w > 0.0 {
            let off = quotient(max(abs(corner.x), abs(corner.y)), corner.w);
            if anchor == 3u || off < least {
                anchor = i;
                least = off;
                at = corner;
            }
        }
    }
    var g = constant;
    var value = 0.0;
    if view.perspective == 1u {
        value = quotient(1.0, at.w);
    } else {
        value = at.depth;
        let db = b.depth - a.depth;
        let dc = c.depth - a.depth;
        g.x = product(a.depth, constant.x) + product(db, along_b.x) + product(dc, along_c.x);
        g.y = product(a.depth, constant.y) + product(db, along_b.y) + product(dc, along_c.y);
    }
    if !is_finite(value + g.x + g.y) || !is_finite(along_b.x + along_b.y + along_c.x + along_c.y) {
        return 3u;
    }
    let place = on_screen(at);
    key_planes[index] = KeyPlane(vec4f(value, g, low), vec4f(high, place, mesh.alpha_cutoff));
    if (mesh.flags & GRADIENT) != 0u {
        slopes[index] = vec4f(along_b, along_c);
    }
    return anchor;
}

fn slope_of(v: vec3f, to_pixels: vec2f) -> vec2f {
    return vec2f(product(v.x, to_pixels.x), product(v.y, to_pixels.y));
}
