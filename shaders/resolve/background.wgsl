// The straight colours behind the lists, opaque surfaces included: one a sample.

@group(1) @binding(0) var<storage, read_write> colors: array<vec4f>;

@compute @workgroup_size(16, 16)
fn cs_background(@builtin(global_invocation_id) id: vec3u) {
    if id.x < band.width && id.y < band.height {
        let pixel = id.y * band.width + id.x;
        for (var s = 0u; s < SAMPLES; s++) {
            colors[pixel * SAMPLES + s] = behind(pixel, s);
        }
    }
}
