// The vertex stage: each invocation fetches all three corners of its triangle, puts them into an order
// that depends on their values alone (so that coincident faces get the same bits whatever their rotation
// or winding), and returns one of them.

struct Batch {
    first_primitive: u32,
    // 1 where every triangle of the batch has one colour, else 3.
    colors_per_triangle: u32,
    pad: vec2u,
}

struct MeshState {
    alpha_cutoff: f32,
    is_opaque: u32,
    // 0 none, 1 back, 2 front.
    cull: u32,
    blend: u32,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> batch: Batch;
// Nine floats a triangle, relative to the camera's centre; scalars, since a vec3 would stride 16 bytes.
@group(0) @binding(2) var<storage, read> positions: array<f32>;
@group(0) @binding(3) var<storage, read> colors: array<vec4f>;
@group(0) @binding(4) var<storage, read> mesh_ids: array<u32>;
@group(0) @binding(5) var<storage, read> meshes: array<MeshState>;

struct Corner {
    clip: vec3f, // x, y, w
    depth: f32,
    color: vec4f,
}

fn corner_of(triangle: u32, i: u32) -> Corner {
    let at = 9u * triangle + 3u * i;
    let p = vec3f(positions[at], positions[at + 1u], positions[at + 2u]);
    var c: Corner;
    for (var row = 0u; row < 3u; row++) {
        let r = view.rows[row];
        c.clip[row] = r.x * p.x + r.y * p.y + r.z * p.z + r.w;
    }
    let d = view.rows[3];
    c.depth = select(d.x * p.x + d.y * p.y + d.z * p.z + d.w, c.clip.z, view.perspective == 1u);
    let each = batch.colors_per_triangle;
    c.color = colors[select(triangle, 3u * triangle + i, each == 3u)];
    return c;
}

// Lexicographic, by the bits of x, y, w, depth, then colour.
fn comes_later(a: Corner, b: Corner) -> bool {
    var x = array<f32, 8>(a.clip.x, a.clip.y, a.clip.z, a.depth, a.color.r, a.color.g, a.color.b, a.color.a);
    var y = array<f32, 8>(b.clip.x, b.clip.y, b.clip.z, b.depth, b.color.r, b.color.g, b.color.b, b.color.a);
    for (var i = 0u; i < 8u; i++) {
        let p = orderable(x[i]);
        let q = orderable(y[i]);
        if p != q {
            return p > q;
        }
    }
    return false;
}

fn rasterise(index: u32, wants_opaque: bool) -> Varyings {
    let triangle = index / 3u;
    let mesh = meshes[mesh_ids[triangle]];
    var a = corner_of(triangle, 0u);
    var b = corner_of(triangle, 1u);
    var c = corner_of(triangle, 2u);
    // The sign of the original winding, positive for counter-clockwise; homogeneous, so that it holds for
    // triangles around the eye. front_facing would tell that of the canonical order instead.
    let facing_scale = inverse_binade(a, b, c);
    let facing = dot(a.clip * facing_scale, cross(b.clip * facing_scale, c.clip * facing_scale));
    let culled = (mesh.cull == 1u && facing < 0.0) || (mesh.cull == 2u && facing > 0.0);
    let is_opaque = mesh.is_opaque == 1u && view.list_opaque == 0u;

    if comes_later(a, b) { let t = a; a = b; b = t; }
    if comes_later(b, c) { let t = b; b = c; c = t; }
    if comes_later(a, b) { let t = a; a = b; b = t; }

    var out: Varyings;
    if culled || is_opaque != wants_opaque {
        out.position = vec4f(0.0, 0.0, 0.0, 1.0); // all three corners in one point: nothing to rasterise
        return out;
    }
    var corner = a;
    if index % 3u == 1u { corner = b; }
    if index % 3u == 2u { corner = c; }
    var range: vec2f;
    if view.perspective == 1u {
        // z is constant: 0 ≤ z holds, z ≤ w clips at the near depth, and z/w is a reversed depth with the
        // same relative precision at every distance.
        out.position = vec4f(corner.clip.xy, view.near, corner.clip.z);
        let high = max(a.clip.z, max(b.clip.z, c.clip.z));
        let low = min(a.clip.z, min(b.clip.z, c.clip.z));
        // A triangle that reaches behind the eye has no largest 1/w.
        range = vec2f(1.0 / high, select(1.0 / view.near, 1.0 / low, low > view.near));
    } else {
        out.position = vec4f(corner.clip.xy, view.z_offset - corner.depth * view.z_scale, 1.0);
        range = vec2f(min(a.depth, min(b.depth, c.depth)), max(a.depth, max(b.depth, c.depth)));
    }
    out.color_low = min(a.color, min(b.color, c.color));
    out.color_high = max(a.color, max(b.color, c.color));
    out.ids = vec3u(
        batch.first_primitive + triangle,
        mesh.is_opaque | (mesh.blend << 1u),
        bitcast<u32>(mesh.alpha_cutoff),
    );
    set_planes(&out, a, b, c, range);
    return out;
}

fn to_screen(v: Corner) -> vec2f {
    let ndc = v.clip.xy / v.clip.z;
    return vec2f((ndc.x * 0.5 + 0.5) * f32(view.width), (0.5 - ndc.y * 0.5) * f32(view.height));
}

// The power of two that makes a triangle's largest coordinate about 1: products of three coordinates then
// neither over- nor underflow.
fn inverse_binade(a: Corner, b: Corner, c: Corner) -> f32 {
    let m = max(abs(a.clip), max(abs(b.clip), abs(c.clip)));
    return ldexp(1.0, -frexp(max(m.x, max(m.y, m.z))).exp);
}

// How far off the screen's middle a vertex lands; one behind the eye lands nowhere.
fn offset_on_screen(v: Corner) -> f32 {
    return select(3.0e38, max(abs(v.clip.x), abs(v.clip.y)) / v.clip.z, v.clip.z > 0.0);
}

// An attribute c over w is m · (X, Y, 1) in NDC, where m solves (x, y, w)ᵢ · m = cᵢ at the three vertices
// (Olano and Greer 1997): right for triangles around the eye too. Written in differences from one vertex, so
// that small triangles do not cancel; the constant comes from the anchor, which is exact.
fn set_planes(out: ptr<function, Varyings>, a: Corner, b: Corner, c: Corner, range: vec2f) {
    var at = a;
    if offset_on_screen(b) < offset_on_screen(at) { at = b; }
    if offset_on_screen(c) < offset_on_screen(at) { at = c; }
    let scale = inverse_binade(a, b, c);
    let origin = a.clip * scale;
    let ab = b.clip * scale - origin;
    let ac = c.clip * scale - origin;
    let normal = cross(ab, ac);
    let determinant = dot(origin, normal);
    // Seen edge-on: any corner's value is as good as another.
    let inverse = select(scale / determinant, 0.0, determinant == 0.0);
    let to_pixels = vec2f(2.0, -2.0) / vec2f(f32(view.width), f32(view.height)) * inverse;
    let along_b = cross(ac, origin).xy * to_pixels;
    let along_c = cross(origin, ab).xy * to_pixels;
    let constant = normal.xy * to_pixels;
    let perspective = view.perspective == 1u;
    let slope = along_b * (b.depth - a.depth) + along_c * (c.depth - a.depth);
    let key_slope = select(slope + a.depth * constant, constant, perspective);
    let key = select(at.depth, 1.0 / at.clip.z, perspective);
    (*out).key_plane = vec3f(key, key_slope);
    let db = b.color - a.color;
    let dc = c.color - a.color;
    (*out).color_value = at.color / at.clip.z; // w is 1 without a perspective
    (*out).color_dx = a.color * constant.x + db * along_b.x + dc * along_c.x;
    (*out).color_dy = a.color * constant.y + db * along_b.y + dc * along_c.y;
    (*out).anchor_range = vec4f(to_screen(at), range);
    // At the anchor, which is a corner, one barycentric coordinate is 1 and the others are 0.
    let is_b = all(at.clip == b.clip);
    let is_c = !is_b && all(at.clip == c.clip);
    set_inside(out, along_b, along_c, select(vec2f(0.0), vec2f(1.0 / at.clip.z), vec2<bool>(is_b, is_c)));
}

struct Shaded {
    // 1/w under a perspective, else the eye depth.
    value: f32,
    color: vec4f,
}

fn value_at(v: Varyings, at: vec2f) -> f32 {
    let d = at - v.anchor_range.xy;
    let key = v.key_plane;
    return clamp(key.x + key.y * d.x + key.z * d.y, v.anchor_range.z, v.anchor_range.w);
}

// Depth and colour at a position in pixels.
fn shade(v: Varyings, at: vec2f) -> Shaded {
    let d = at - v.anchor_range.xy;
    let value = value_at(v, at);
    let w = select(1.0, 1.0 / value, view.perspective == 1u);
    let color = (v.color_value + v.color_dx * d.x + v.color_dy * d.y) * w;
    return Shaded(value, clamp(color, v.color_low, v.color_high));
}

fn is_cut_out(v: Varyings, color: vec4f) -> bool {
    return color.a < bitcast<f32>(v.ids.z);
}

// Window z, as the vertex stage sets it up for the hardware.
fn window_depth(value: f32) -> f32 {
    return select(view.z_offset - value * view.z_scale, view.near * value, view.perspective == 1u);
}
