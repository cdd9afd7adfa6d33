// Clipping of the few triangles that reach past the guard band or the depth range (Sutherland and Hodgman 1974), as in
// src/clip.rs: a cut is computed from the kept corner towards the dropped one, so that shared edges get the same bits.

const MAX_CORNERS = 9u;

struct Polygon {
    corners: array<Corner, MAX_CORNERS>,
    count: u32,
}

fn push(p: ptr<function, Polygon>, c: Corner) {
    (*p).corners[(*p).count] = c;
    (*p).count += 1u;
}

fn mixed(a: f32, b: f32, t: f32) -> f32 {
    return a + product(t, b - a);
}

// The point a part `t` of the way from the kept corner to the dropped one, put exactly on the plane.
fn between(side: u32, kept: Corner, dropped: Corner, t: f32) -> Corner {
    var c = Corner(
        mixed(kept.x, dropped.x, t),
        mixed(kept.y, dropped.y, t),
        mixed(kept.w, dropped.w, t),
        mixed(kept.depth, dropped.depth, t),
    );
    switch side {
        case 0u: { c.depth = eye.near; }
        case 1u: { c.depth = eye.far; }
        default: { c.depth = min(max(c.depth, eye.near), eye.far); }
    }
    if view.perspective == 1u {
        c.w = c.depth;
    }
    let guard = product(3.0, c.w);
    switch side {
        case 2u: { c.x = -guard; }
        case 3u: { c.x = guard; }
        case 4u: { c.y = -guard; }
        case 5u: { c.y = guard; }
        default: {}
    }
    return c;
}

fn clipped(t: Triangle) -> Polygon {
    var p: Polygon;
    for (var i = 0u; i < 3u; i++) {
        push(&p, t.corners[i]);
    }
    for (var side = 0u; side < 6u; side++) {
        var kept: Polygon;
        for (var i = 0u; i < p.count; i++) {
            let a = p.corners[i];
            let b = p.corners[select(i + 1u, 0u, i + 1u == p.count)];
            let da = distance_to(side, a);
            let db = distance_to(side, b);
            if da >= 0.0 {
                push(&kept, a);
                if db < 0.0 {
                    push(&kept, between(side, a, b, quotient(da, da - db)));
                }
            } else if db >= 0.0 {
                push(&kept, between(side, b, a, quotient(db, db - da)));
            }
        }
        p = kept;
    }
    // A cut on one plane may miss another by the rounding of its ends, which next to the eye is more than w itself.
    for (var i = 0u; i < p.count; i++) {
        let guard = product(3.0, p.corners[i].w);
        p.corners[i].x = clamped(p.corners[i].x, -guard, guard);
        p.corners[i].y = clamped(p.corners[i].y, -guard, guard);
    }
    return p;
}

fn clip(index: u32) {
    let mesh = meshes[mesh_ids[index]];
    let t = triangle_of(index, mesh);
    let polygon = clipped(t);
    if polygon.count < 3u {
        return;
    }
    var screen: array<vec2i, MAX_CORNERS>;
    var low_key = key_value(polygon.corners[0]);
    var high_key = low_key;
    for (var k = 0u; k < polygon.count; k++) {
        let at = on_screen(polygon.corners[k]);
        if !is_finite(at.x + at.y) {
            reject(index);
            return;
        }
        screen[k] = snapped(at);
        let key = key_value(polygon.corners[k]);
        low_key = min(low_key, key);
        high_key = max(high_key, key);
    }
    var found = 0u;
    var own: array<array<i32, 6>, 7>;
    var low = vec2i(0x7fffffff);
    var high = vec2i(-0x7fffffff);
    for (var k = 1u; k + 1u < polygon.count; k++) {
        let piece = visible_piece(screen[0], screen[k], screen[k + 1u], t.is_flipped, mesh.cull);
        if piece.is_visible {
            own[found] = piece.corners;
            found += 1u;
            for (var e = 0u; e < 6u; e += 2u) {
                let corner = vec2i(piece.corners[e], piece.corners[e + 1u]);
                low = min(low, corner);
                high = max(high, corner);
            }
        }
    }
    if found == 0u {
        return;
    }
    let anchor = write_planes(index, t, low_key, high_key, mesh);
    if anchor == 3u {
        reject(index);
        return;
    }
    let first = take_pieces(found);
    if first + found > eye.piece_capacity {
        return; // the host makes room, and starts again
    }
    for (var k = 0u; k < found; k++) {
        pieces[first + k] = own[k];
    }
    let raster = Raster(vec4i(i32(first), i32(found), 0, 0), vec4i(0, 0, 0, i32(PIECES)));
    write_raster(index, t, mesh, anchor, box_of(low, high), 0.5, raster);
}

// A fixed number of workgroups take turns: mostly there is nothing to clip.
@compute @workgroup_size(64)
fn cs_clip(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let count = atomicLoad(&counters.to_clip);
    for (var i = id.x; i < count; i += 64u * groups.x) {
        clip(clip_list[i]);
    }
}
