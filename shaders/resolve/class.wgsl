// Resolve (GPU Pro 2, section 2.6): a pixel's list goes into a temporary array of TEMP entries, which is sorted and
// composited. TEMP is the class's; lists longer than any class take the stages in long.wgsl. How the array is walked,
// `gather` and `composite`, is in class_loops.wgsl, or written out for short arrays.

@group(1) @binding(0) var<storage, read_write> classes: Classes;
@group(1) @binding(1) var<storage, read> class_pixels: array<u32>;
// One colour a sample, where samples are resolved apart.
@group(1) @binding(2) var<storage, read_write> sample_colors: array<vec4f>;

// One of each sample, or where samples are resolved apart the first alone.
var<private> states: array<Blend, SAMPLES>;

fn blend_entry(node: u32, only: u32) {
    let coverage = coverage_of(node);
    let source = source_of(node);
    if PER_SAMPLE {
        if (coverage >> only & 1u) == 1u {
            var state = states[0];
            blend_add(&state, source);
            states[0] = state;
        }
        return;
    }
    for (var s = 0u; s < SAMPLES; s++) {
        if SAMPLES == 1u || (coverage >> s & 1u) == 1u {
            var state = states[s];
            blend_add(&state, source);
            states[s] = state;
        }
    }
}

fn all_done() -> bool {
    var done = true;
    for (var s = 0u; s < select(SAMPLES, 1u, PER_SAMPLE); s++) {
        done &= blend_done(states[s]);
    }
    return done;
}

// Entries of the first LIMIT fragments of a sorted array.
fn limited(n: u32, counts_dropped: bool) -> u32 {
    var fragments = 0u;
    var kept = n;
    for (var k = 0u; k < n; k++) {
        let is_piece = k > 0u && are_pieces(order[k], order[max(k, 1u) - 1u]);
        fragments += u32(!is_piece);
        if fragments > LIMIT {
            kept = min(kept, k);
        }
    }
    if counts_dropped && fragments > LIMIT {
        atomicAdd(&classes.dropped, fragments - LIMIT);
    }
    return kept;
}

// Keeps the fragments of the greatest primitives, where a reverse list has them.
fn keep_last_submitted(n: u32, counts_dropped: bool) -> u32 {
    for (var i = 0u; i < n; i++) {
        order[i] = by_primitive(order[i]);
    }
    sort_entries(n);
    let kept = limited(n, counts_dropped);
    for (var i = 0u; i < kept; i++) {
        order[i] = order_of(entries[i]);
    }
    return kept;
}

fn resolve_pixel(pixel: u32, only: u32) {
    var n = gather(pixel);
    if LIMIT > 0u && LIMIT_LAST && n > LIMIT {
        n = keep_last_submitted(n, only == 0u);
    }
    sort_entries(n);
    if LIMIT > 0u && !LIMIT_LAST {
        n = limited(n, only == 0u);
    }
    if PER_SAMPLE {
        let color = behind(pixel, only);
        states[0] = blend_begin(color);
        composite(n, only);
        sample_colors[pixel * SAMPLES + only] = blend_end(states[0], color);
        return;
    }
    for (var s = 0u; s < SAMPLES; s++) {
        states[s] = blend_begin(behind(pixel, s));
    }
    composite(n, only);
    var colors: array<vec4f, SAMPLES>;
    for (var s = 0u; s < SAMPLES; s++) {
        colors[s] = blend_end(states[s], behind(pixel, s));
    }
    finish(pixel, &colors);
}

@compute @workgroup_size(64)
fn cs_resolve(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = id.y * groups.x * 64u + id.x;
    if i < atomicLoad(&classes.totals[CLASS]) * INVOCATIONS_PER_PIXEL {
        let pixel = class_pixels[classes.bases[CLASS] + i / INVOCATIONS_PER_PIXEL];
        resolve_pixel(pixel, i % INVOCATIONS_PER_PIXEL);
    }
}
