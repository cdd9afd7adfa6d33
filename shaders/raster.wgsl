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
    pad: u32,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> batch: Batch;
// Nine floats a triangle, relative to the scene's centre; scalars, since a vec3 would stride 16 bytes.
@group(0) @binding(2) var<storage, read> positions: array<f32>;
@group(0) @binding(3) var<storage, read> colors: array<vec4f>;
@group(0) @binding(4) var<storage, read> mesh_ids: array<u32>;
@group(0) @binding(5) var<storage, read> meshes: array<MeshState>;

struct Corner {
    clip: vec3f, // x, y, w
    depth: f32,
    color: vec4f,
}

struct Varyings {
    @builtin(position) @invariant position: vec4f,
    @location(0) color: vec4f,
    @location(1) depth: f32,
    // The vertices' ranges: interpolation may round past them, and flat colours must stay exact.
    @location(2) @interpolate(flat) color_low: vec4f,
    @location(3) @interpolate(flat) color_high: vec4f,
    @location(4) @interpolate(flat) plane_range: vec2f,
    @location(5) @interpolate(flat) primitive: u32,
    @location(6) @interpolate(flat) mesh: vec2u, // is_opaque, bits of alpha_cutoff
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
    let facing = dot(a.clip, cross(b.clip, c.clip));
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
    if view.perspective == 1u {
        // z is constant: 0 ≤ z holds, z ≤ w clips at the near depth, and z/w is a reversed depth with the
        // same relative precision at every distance.
        out.position = vec4f(corner.clip.xy, view.near, corner.clip.z);
        let w = vec3f(a.clip.z, b.clip.z, c.clip.z);
        let high = max(w.x, max(w.y, w.z));
        let low = min(w.x, min(w.y, w.z));
        // A triangle that reaches behind the eye has no largest 1/w.
        out.plane_range = vec2f(1.0 / high, select(1.0 / view.near, 1.0 / low, low > view.near));
    } else {
        out.position = vec4f(corner.clip.xy, view.z_offset - corner.depth * view.z_scale, 1.0);
        out.plane_range = vec2f(min(a.depth, min(b.depth, c.depth)), max(a.depth, max(b.depth, c.depth)));
    }
    out.color = corner.color;
    out.depth = corner.depth;
    out.color_low = min(a.color, min(b.color, c.color));
    out.color_high = max(a.color, max(b.color, c.color));
    out.primitive = batch.first_primitive + triangle;
    out.mesh = vec2u(mesh.is_opaque, bitcast<u32>(mesh.alpha_cutoff));
    return out;
}

// 1/w under a perspective, else the eye depth.
fn plane_value(v: Varyings) -> f32 {
    let value = select(v.depth, v.position.w, view.perspective == 1u);
    return clamp(value, v.plane_range.x, v.plane_range.y);
}

// The hardware clips neither the far plane of a perspective nor an orthographic view's two.
fn beyond_depth_range(value: f32) -> bool {
    if view.perspective == 1u {
        return value * view.far < 1.0;
    }
    return value < view.near || value > view.far;
}

fn fragment_color(v: Varyings) -> vec4f {
    return clamp(v.color, v.color_low, v.color_high);
}

fn is_cut_out(v: Varyings, color: vec4f) -> bool {
    return color.a < bitcast<f32>(v.mesh.y);
}
