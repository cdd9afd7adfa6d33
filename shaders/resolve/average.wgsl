// The mean of samples that were resolved apart (GPU Pro 2, section 2.7.2).

@group(1) @binding(0) var<storage, read> sample_colors: array<vec4f>;

@compute @workgroup_size(16, 16)
fn cs_average(@builtin(global_invocation_id) id: vec3u) {
    let pixel = id.y * band.width + id.x;
    if id.x >= band.width || id.y >= band.height || counts[pixel] == 0u || counts[pixel] > LONGEST_CLASS {
        return;
    }
    var colors: array<vec4f, SAMPLES>;
    for (var s = 0u; s < SAMPLES; s++) {
        colors[s] = sample_colors[pixel * SAMPLES + s];
    }
    finish(pixel, &colors);
}
