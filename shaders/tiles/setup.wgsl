// Triangle setup: transform, canonical order, cull, snap, and the planes that give depth and barycentric coordinates at
// any pixel. The arithmetic is that of src/cpu/setup.rs and src/cpu/plane.rs, operation by operation, so that snapped
// corners and keys have the same bits.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> eye: Eye;
@group(0) @binding(2) var<storage, read> positions: array<f32>;
// What rounding positions to floats left, where they were doubles.
@group(0) @binding(3) var<storage, read> position_rests: array<f32>;
@group(0) @binding(4) var<storage, read> faces: array<u32>;
@group(0) @binding(5) var<storage, read> mesh_ids: array<u32>;
@group(0) @binding(6) var<storage, read> meshes: array<MeshInfo>;
@group(0) @binding(7) var<storage, read_write> rasters: array<Raster>;
@group(0) @binding(8) var<storage, read_write> key_planes: array<KeyPlane>;
// Slopes of the second and third corner's barycentric coordinates over w, per pixel right and down.
@group(0) @binding(9) var<storage, read_write> slopes: array<vec4f>;
// Corners of pieces of clipped triangles.
@group(0) @binding(10) var<storage, read_write> pieces: array<array<i32, 6>>;
@group(0) @binding(11) var<storage, read_write> clip_list: array<u32>;
@group(0) @binding(12) var<storage, read_write> counters: Counters;
@group(0) @binding(13) var<storage, read_write> boxes: array<vec2u>;
// Where a triangle's colours begin.
@group(0) @binding(14) var<storage, read_write> color_starts: array<u32>;

// For cs_clear alone.
@group(0) @binding(15) var<storage, read_write> class_words: array<u32>;

struct Corner {
    x: f32,
    y: f32,
    // Eye depth under a perspective, 1 otherwise.
    w: f32,
    depth: f32,
}

struct Triangle {
    corners: array<Corner, 3>,
    // The given corner that is first, second and third, two bits each.
    order: u32,
    // Canonical order reversed the winding.
    is_flipped: bool,
}

// position − centre, with one rounding (Knuth's two-sum keeps what the first difference loses).
fn relative(high: f32, rest: f32, center: f32, center_rest: f32) -> f32 {
    let sum = opaque_bits(high - center);
    let shadow = opaque_bits(sum - high);
    let lost = (high - opaque_bits(sum - shadow)) + (-center - shadow);
    return sum + (lost + (rest - center_rest));
}

fn corner_of(vertex: u32, mesh: MeshInfo) -> Corner {
    var p: vec3f;
    for (var i = 0u; i < 3u; i++) {
        var rest = 0.0;
        if mesh.is_double == 1u {
            rest = position_rests[3u * vertex + i];
        }
        p[i] = relative(positions[3u * vertex + i], rest, eye.center_high[i], eye.center_low[i]);
    }
    let w = transformed(2u, p);
    var depth = w;
    if view.perspective == 0u {
        depth = transformed(3u, p);
    }
    return Corner(transformed(0u, p), transformed(1u, p), w, depth);
}

fn transformed(row: u32, p: vec3f) -> f32 {
    let r = eye.rows[row];
    return product(r.x, p.x) + product(r.y, p.y) + product(r.z, p.z) + r.w;
}

// By the bits of x, y, w, depth. (Corners that agree in all of them enclose no area, so that colours need not decide.)
fn comes_later(a: Corner, b: Corner) -> bool {
    if a.x != b.x { return a.x > b.x; }
    if a.y != b.y { return a.y > b.y; }
    if a.w != b.w { return a.w > b.w; }
    return a.depth > b.depth;
}

fn triangle_of(index: u32, mesh: MeshInfo) -> Triangle {
    var t: Triangle;
    for (var i = 0u; i < 3u; i++) {
        t.corners[i] = corner_of(faces[3u * index + i], mesh);
    }
    var order = array<u32, 3>(0u, 1u, 2u);
    for (var step = 0u; step < 3u; step++) {
        let i = step & 1u; // 0 and 1, 1 and 2, 0 and 1
        if comes_later(t.corners[i], t.corners[i + 1u]) {
            let corner = t.corners[i];
            t.corners[i] = t.corners[i + 1u];
            t.corners[i + 1u] = corner;
            let o = order[i];
            order[i] = order[i + 1u];
            order[i + 1u] = o;
            t.is_flipped = !t.is_flipped;
        }
    }
    t.order = order[0] | (order[1] << 2u) | (order[2] << 4u);
    return t;
}

// The whole triangle is beyond one side of the viewport, or of the depth range.
fn is_outside(t: Triangle) -> bool {
    let a = t.corners[0];
    let b = t.corners[1];
    let c = t.corners[2];
    return (a.x > a.w && b.x > b.w && c.x > c.w)
        || (a.x < -a.w && b.x < -b.w && c.x < -c.w)
        || (a.y > a.w && b.y > b.w && c.y > c.w)
        || (a.y < -a.w && b.y < -b.w && c.y < -c.w)
        || (a.depth < eye.near && b.depth < eye.near && c.depth < eye.near)
        || (a.depth > eye.far && b.depth > eye.far && c.depth > eye.far);
}

// Signed distance to one of near, far, left, right, bottom and top; kept where it is not negative.
fn distance_to(side: u32, c: Corner) -> f32 {
    let guard = product(3.0, c.w);
    switch side {
        case 0u: { return c.depth - eye.near; }
        case 1u: { return eye.far - c.depth; }
        case 2u: { return guard + c.x; }
        case 3u: { return guard - c.x; }
        case 4u: { return guard + c.y; }
        default: { return guard - c.y; }
    }
}

fn needs_no_clipping(c: Corner) -> bool {
    let guard = product(3.0, c.w);
    return c.depth - eye.near >= 0.0 && eye.far - c.depth >= 0.0
        && guard + c.x >= 0.0 && guard - c.x >= 0.0 && guard + c.y >= 0.0 && guard - c.y >= 0.0;
}

fn on_screen(c: Corner) -> vec2f {
    return vec2f(
        product(quotient(c.x, c.w) * 0.5 + 0.5, f32(view.width)),
        product(0.5 - quotient(c.y, c.w) * 0.5, f32(view.height)),
    );
}

fn snapped(at: vec2f) -> vec2i {
    return vec2i(floor(at * 256.0 + 0.5));
}

struct Piece {
    corners: array<i32, 6>,
    box: vec4i,
    is_visible: bool,
}

// A piece with its corners in positive order, unless it is culled, has no area, or can cover nothing.
fn visible_piece(a: vec2i, b: vec2i, c: vec2i, is_flipped: bool, cull: u32) -> Piece {
    let ab = b - a;
    let ac = c - a;
    let area = wide_cross(ab.x, ac.y, ac.x, ab.y);
    let is_negative = wide_is_negative(area);
    // y points down here: counter-clockwise for the eye is a negative area.
    let is_front = is_negative != is_flipped;
    var p: Piece;
    p.corners = array<i32, 6>(a.x, a.y, b.x, b.y, c.x, c.y);
    if is_negative {
        p.corners = array<i32, 6>(a.x, a.y, c.x, c.y, b.x, b.y);
    }
    let low = min(a, min(b, c));
    let high = max(a, max(b, c));
    let is_culled = (cull == 1u && !is_front) || (cull == 2u && is_front);
    p.box = box_of(low, high);
    p.is_visible = (area.x | area.y) != 0u && !is_culled && !is_empty(p.box);
    return p;
}

fn key_value(c: Corner) -> f32 {
    if view.perspective == 1u {
        return quotient(1.0, c.w);
    }
    return c.depth;
}

// What is written last, once everything else of the triangle is.
fn write_raster(index: u32, t: Triangle, mesh: MeshInfo, anchor: u32, box: vec4i, share: f32, raster: Raster) {
    var r = raster;
    r.values.w |= bitcast<i32>(mesh.flags | (t.order << ORDER_SHIFT) | (anchor << ANCHOR_SHIFT));
    rasters[index] = r;
    if !COLORS_BY_TRIANGLE {
        color_starts[index] = colors_of(index, mesh);
    }
    boxes[index] = packed_box(box, share);
}

// Room for a triangle's pieces; what exceeds it is counted.
fn take_pieces(n: u32) -> u32 {
    return atomicAdd(&counters.pieces, n);
}

fn colors_of(index: u32, mesh: MeshInfo) -> u32 {
    switch mesh.rate {
        case 0u: { return mesh.first_color; }
        case 1u: { return mesh.first_color - mesh.first_vertex; }
        case 2u: { return mesh.first_color + (index - mesh.first_triangle); }
        default: { return mesh.first_color + 3u * (index - mesh.first_triangle); }
    }
}

fn reject(index: u32) {
    boxes[index] = EMPTY_BOX;
    atomicAdd(&counters.rejected, 1u);
}

// What stages count: cleared at the start, never at the end, since a frame must not depend on the one before it.
@compute @workgroup_size(64)
fn cs_clear(@builtin(local_invocation_index) local: u32) {
    if local < arrayLength(&class_words) {
        class_words[local] = 0u;
    }
    if local == 0u {
        atomicStore(&counters.rejected, 0u);
        atomicStore(&counters.to_clip, 0u);
        atomicStore(&counters.pieces, 0u);
        atomicStore(&counters.bin_entries, 0u);
        atomicStore(&counters.tile_entries, 0u);
        atomicStore(&counters.longest, 0u);
    }
    if local < 4u {
        atomicStore(&counters.box[local], 0u);
    }
}

@compute @workgroup_size(256)
fn cs_setup(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u,
        @builtin(local_invocation_index) local: u32) {
    let index = (group.y * groups.x + group.x) * 256u + local;
    if index >= eye.triangles {
        return;
    }
    let mesh = meshes[mesh_ids[index]];
    let t = triangle_of(index, mesh);
    let a = t.corners[0];
    let b = t.corners[1];
    let c = t.corners[2];
    if !is_finite(a.x + a.y + a.w + a.depth) || !is_finite(b.x + b.y + b.w + b.depth)
            || !is_finite(c.x + c.y + c.w + c.depth) {
        reject(index);
        return;
    }
    if is_outside(t) {
        boxes[index] = EMPTY_BOX;
        return;
    }
    if !needs_no_clipping(a) || !needs_no_clipping(b) || !needs_no_clipping(c) {
        boxes[index] = EMPTY_BOX;
        clip_list[atomicAdd(&counters.to_clip, 1u)] = index;
        return;
    }
    let pa = on_screen(a);
    let pb = on_screen(b);
    let pc = on_screen(c);
    if !is_finite(pa.x + pa.y) || !is_finite(pb.x + pb.y) || !is_finite(pc.x + pc.y) {
        reject(index);
        return;
    }
    let piece = visible_piece(snapped(pa), snapped(pb), snapped(pc), t.is_flipped, mesh.cull);
    if !piece.is_visible {
        boxes[index] = EMPTY_BOX;
        return;
    }
    let ka = key_value(a);
    let kb = key_value(b);
    let kc = key_value(c);
    let anchor = write_planes(index, t, min(ka, min(kb, kc)), max(ka, max(kb, kc)), mesh);
    if anchor == 3u {
        reject(index);
        return;
    }
    let p = array<vec2i, 3>(
        vec2i(piece.corners[0], piece.corners[1]),
        vec2i(piece.corners[2], piece.corners[3]),
        vec2i(piece.corners[4], piece.corners[5]),
    );
    let low = min(p[0], min(p[1], p[2]));
    let high = max(p[0], max(p[1], p[2]));
    let size = high - low;
    if max(size.x, size.y) >= LARGEST {
        let first = take_pieces(1u);
        if first < eye.piece_capacity {
            pieces[first] = piece.corners;
            let raster = Raster(vec4i(i32(first), 1, 0, 0), vec4i(0, 0, 0, i32(PIECES)));
            write_raster(index, t, mesh, anchor, piece.box, 0.5, raster);
        }
        return;
    }
    let e = edges_of(piece.corners, piece.box.x, piece.box.y);
    let rests = (e.r.x << REST_SHIFT) | (e.r.y << (REST_SHIFT + 4u)) | (e.r.z << LAST_REST_SHIFT);
    let doubled_area = abs(f32(e.a.x) * f32(e.b.y) - f32(e.a.y) * f32(e.b.x));
    let pixels = vec2f(piece.box.zw - piece.box.xy + 1);
    let share = doubled_area / (131072.0 * pixels.x * pixels.y);
    let raster = Raster(vec4i(e.a.xy, e.b.xy), vec4i(e.q, rests));
    write_raster(index, t, mesh, anchor, piece.box, share, raster);
}

// 1,024 pixels in 1/256: slopes of larger triangles do not fit 32 bits with all that is done with them.
const LARGEST = 262144;
