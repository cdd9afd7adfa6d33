// The scene as it was given, drawn by the hardware's rasteriser: what native forms of methods see. Depth and colour are
// interpolated by the hardware, between corners that it has snapped to 1/256 of a pixel.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> eye: Eye;
@group(0) @binding(2) var<uniform> method: Method;
@group(0) @binding(3) var<storage, read> positions: array<f32>;
@group(0) @binding(4) var<storage, read> position_rests: array<f32>;
@group(0) @binding(5) var<storage, read> faces: array<u32>;
@group(0) @binding(6) var<storage, read> mesh_ids: array<u32>;
@group(0) @binding(7) var<storage, read> meshes: array<MeshInfo>;
@group(0) @binding(8) var<storage, read> colors: array<vec4f>;

const CULL_BACK = 1u;
const CULL_FRONT = 2u;

struct Varyings {
    // The same bits whatever the pass: passes compare depths.
    @builtin(position) @invariant position: vec4f,
    // Where a triangle covers some samples of a pixel alone, at one of those.
    @location(0) @interpolate(perspective, centroid) color: vec4f,
    @location(1) @interpolate(perspective, centroid) depth: f32,
    @location(2) @interpolate(flat) primitive: u32,
    @location(3) @interpolate(flat) mesh: u32,
    // Of a triangle of one colour: interpolated, alpha 1 may be a little less on some GPUs, and let something through.
    @location(4) @interpolate(flat) own_color: vec4f,
    @location(5) @interpolate(flat) has_gradient: u32,
}

fn position_of(vertex: u32, mesh: MeshInfo) -> vec4f {
    var p: vec3f;
    for (var i = 0u; i < 3u; i++) {
        p[i] = positions[3u * vertex + i] - eye.center_high[i];
        if mesh.is_double == 1u {
            p[i] += position_rests[3u * vertex + i] - eye.center_low[i];
        } else {
            p[i] -= eye.center_low[i];
        }
    }
    return vec4f(p, 1.0);
}

fn drawn(index: u32, wants_opaque: bool) -> Varyings {
    var v: Varyings;
    let triangle = index / 3u;
    let id = mesh_ids[triangle];
    let mesh = meshes[id];
    if ((mesh.flags & OPAQUE) != 0u) != wants_opaque {
        v.position = vec4f(0.0, 0.0, 0.0, 1.0); // all three corners in one point: nothing to rasterise
        return v;
    }
    let vertex = faces[index];
    var color = mesh.first_color;
    switch mesh.rate {
        case 0u: {}
        case 1u: { color += vertex - mesh.first_vertex; }
        case 2u: { color += triangle - mesh.first_triangle; }
        default: { color += index - 3u * mesh.first_triangle; }
    }
    let p = position_of(vertex, mesh);
    let w = dot(eye.rows[2], p);
    v.depth = select(dot(eye.rows[3], p), w, view.perspective == 1u);
    // Reversed, and clipped at the near depth (see shaders/raster.wgsl).
    let z = select(view.z_offset - v.depth * view.z_scale, view.near, view.perspective == 1u);
    v.position = vec4f(dot(eye.rows[0], p), dot(eye.rows[1], p), z, w);
    v.color = colors[color];
    v.own_color = v.color;
    v.has_gradient = mesh.flags & GRADIENT;
    v.primitive = triangle;
    v.mesh = id;
    return v;
}

@vertex
fn vs_opaque(@builtin(vertex_index) index: u32) -> Varyings {
    return drawn(index, true);
}

@vertex
fn vs_translucent(@builtin(vertex_index) index: u32) -> Varyings {
    return drawn(index, false);
}

// Discards what the scene says is no fragment.
fn fragment_of(v: Varyings, is_front: bool) -> Fragment {
    let value = select(v.depth, 1.0 / v.depth, view.perspective == 1u);
    var is_none = beyond_depth_range(value);
    if CULLS {
        let cull = meshes[v.mesh].cull;
        is_none |= (cull == CULL_BACK && !is_front) || (cull == CULL_FRONT && is_front);
    }
    // Interpolation may round past what corners have.
    let smooth_color = vec4f(max(v.color.rgb, vec3f(0.0)), clamp(v.color.a, 0.0, 1.0));
    let color = select(v.own_color, smooth_color, v.has_gradient != 0u);
    if CUTS_OUT {
        is_none |= color.a < meshes[v.mesh].alpha_cutoff;
    }
    if is_none {
        discard;
    }
    return Fragment(color, v.depth, sort_key(value), v.primitive, 0u);
}

@fragment
fn fs_opaque(v: Varyings, @builtin(front_facing) is_front: bool) -> @location(0) vec4f {
    return vec4f(fragment_of(v, is_front).color.rgb, 1.0);
}

@fragment
fn fs_count(v: Varyings, @builtin(front_facing) is_front: bool) -> @location(0) vec4f {
    let fragment = fragment_of(v, is_front);
    return vec4f(1.0, 0.0, 0.0, fragment.color.a);
}
