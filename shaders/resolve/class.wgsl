// Resolve (GPU Pro 2, section 2.6): a pixel's list goes into a temporary array of TEMP entries, which is sorted and
// composited. TEMP is the class's; lists longer than any class take the stages in long.wgsl.

@group(1) @binding(0) var<storage, read_write> classes: Classes;
@group(1) @binding(1) var<storage, read> class_pixels: array<u32>;
// One colour a sample, where samples are resolved apart.
@group(1) @binding(2) var<storage, read_write> sample_colors: array<vec4f>;

// Copies a list. `only`: of which sample, where samples are resolved apart.
fn gather(pixel: u32, only: u32) -> u32 {
    var n = 0u;
    var c = first_of(pixel);
    for (var i = 0u; i < TEMP && !is_end(c); i++) {
        let node = node_at(c);
        advance(&c);
        // A limit is of the pixel's fragments: then those of other samples count too.
        if !PER_SAMPLE || LIMIT > 0u || (coverage_of(node) >> only & 1u) == 1u {
            order[n] = order_of(node);
            entries[n] = node;
            n++;
        }
    }
    return n;
}

// Puts the fragments of the greatest primitives first, where a reverse list has them.
fn put_last_submitted_first(n: u32) {
    for (var i = 0u; i < n; i++) {
        order[i] = order[i].yx;
    }
    sort_entries(n);
}

// Entries of the first LIMIT fragments of a sorted array. Hardware may cut a triangle into pieces that meet inside a
// pixel: they have one key and order, and are one fragment.
fn limited(n: u32, counts_dropped: bool) -> u32 {
    var fragments = 0u;
    var kept = n;
    for (var k = 0u; k < n; k++) {
        let is_piece = SAMPLES > 1u && HAS_ORDER && k > 0u && all(order[k] == order[max(k, 1u) - 1u]);
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

fn resolve_pixel(pixel: u32, only: u32) {
    var n = gather(pixel, only);
    if LIMIT > 0u && LIMIT_LAST && n > LIMIT {
        put_last_submitted_first(n);
        n = limited(n, only == 0u);
        for (var i = 0u; i < n; i++) {
            order[i] = order[i].yx;
        }
    }
    sort_entries(n);
    if LIMIT > 0u && !LIMIT_LAST {
        n = limited(n, only == 0u);
    }
    if PER_SAMPLE {
        let color = behind(pixel, only);
        var state = blend_begin(color);
        for (var k = 0u; k < n; k++) {
            let node = entries[select(k, n - 1u - k, BACK_TO_FRONT)];
            if LIMIT == 0u || (coverage_of(node) >> only & 1u) == 1u {
                blend_add(&state, source_of(node));
                if blend_done(state) {
                    break;
                }
            }
        }
        sample_colors[pixel * SAMPLES + only] = blend_end(state, color);
        return;
    }
    var states: array<Blend, SAMPLES>;
    for (var s = 0u; s < SAMPLES; s++) {
        states[s] = blend_begin(behind(pixel, s));
    }
    for (var k = 0u; k < n; k++) {
        let node = entries[select(k, n - 1u - k, BACK_TO_FRONT)];
        let source = source_of(node);
        let coverage = coverage_of(node);
        var done = true;
        for (var s = 0u; s < SAMPLES; s++) {
            if (coverage >> s & 1u) == 1u {
                var state = states[s];
                blend_add(&state, source);
                states[s] = state;
            }
            done &= blend_done(states[s]);
        }
        if done {
            break;
        }
    }
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
