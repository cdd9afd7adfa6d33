// What opaque geometry left (opaque.wgsl).

@group(2) @binding(0) var<storage, read> opaque_keys: array<u32>;
@group(2) @binding(1) var<storage, read> opaque_colors: array<vec4f>;
