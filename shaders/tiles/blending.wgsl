// Plain blending by the hardware, unsorted: the wrong image of the same geometry, as a yardstick of speed.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> eye: Eye;
@group(0) @binding(2) var<storage, read> positions: array<f32>;
@group(0) @binding(3) var<storage, read> faces: array<u32>;
@group(0) @binding(4) var<storage, read> mesh_ids: array<u32>;
@group(0) @binding(5) var<storage, read> meshes: array<MeshInfo>;
@group(0) @binding(6) var<storage, read> colors: array<vec4f>;

struct Varyings {
    @builtin(position) position: vec4f,
    @location(0) color: vec4f,
}

@vertex
fn vs_blending(@builtin(vertex_index) index: u32) -> Varyings {
    let vertex = faces[index];
    let triangle = index / 3u;
    let mesh = meshes[mesh_ids[triangle]];
    let at = vec3f(positions[3u * vertex], positions[3u * vertex + 1u], positions[3u * vertex + 2u]);
    let p = vec4f(at - eye.center_high.xyz, 1.0);
    let w = dot(eye.rows[2], p);
    var color = mesh.first_color;
    switch mesh.rate {
        case 0u: {}
        case 1u: { color += vertex - mesh.first_vertex; }
        case 2u: { color += triangle - mesh.first_triangle; }
        default: { color += index - 3u * mesh.first_triangle; }
    }
    var v: Varyings;
    v.position = vec4f(dot(eye.rows[0], p), dot(eye.rows[1], p), 0.5 * w, w);
    v.color = colors[color];
    return v;
}

@fragment
fn fs_blending(v: Varyings) -> @location(0) vec4f {
    return v.color;
}
