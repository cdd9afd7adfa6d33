// The camera and the meshes, as stages that read the scene itself see them.

struct Eye {
    // Rows of the matrix from positions relative to the centre to clip x, y, w and eye depth.
    rows: array<vec4f, 4>,
    // What positions are kept relative to, as a sum of two floats.
    center_high: vec4f,
    center_low: vec4f,
    // 2 / width and −2 / height.
    to_pixels: vec2f,
    near: f32,
    // The largest float where there is no far plane.
    far: f32,
    triangles: u32,
    // Pieces of clipped triangles that there is room for.
    piece_capacity: u32,
    pad0: u32,
    pad1: u32,
}

struct MeshInfo {
    first_triangle: u32,
    first_vertex: u32,
    first_color: u32,
    // 0 one, 1 a vertex, 2 a face, 3 a corner.
    rate: u32,
    // 0 none, 1 back, 2 front.
    cull: u32,
    flags: u32,
    alpha_cutoff: f32,
    // Positions have a low part.
    is_double: u32,
}
