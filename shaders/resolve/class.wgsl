// Resolve (GPU Pro 2, section 2.6): a pixel's list goes into a temporary array of TEMP entries, which is sorted and
// composited. TEMP is the class's; lists longer than any class take the stages in long.wgsl.

struct Classes {
    totals: array<u32, CLASS_SLOTS>,
    bases: array<u32, CLASS_SLOTS>,
}

@group(1) @binding(0) var<storage, read> classes: Classes;
@group(1) @binding(1) var<storage, read> class_pixels: array<u32>;
// One colour a sample, where samples are resolved apart.
@group(1) @binding(2) var<storage, read_write> sample_colors: array<vec4f>;

// Copies a list. `only`: of which sample, where samples are resolved apart.
fn gather(pixel: u32, only: u32) -> u32 {
    var n = 0u;
    var c = first_of(pixel);
    for (var i = 0u; i < TEMP; i++) {
        if !is_end(c) {
            let node = node_at(c);
            advance(&c);
            // A limit is of the pixel's fragments: then those of other samples count too.
            if !PER_SAMPLE || LIMIT > 0u || (coverage_of(node) >> only & 1u) == 1u {
                order[n] = order_of(node);
                entries[n] = node;
                n++;
            }
        }
    }
    return n;
}

// Keeps the fragments of the greatest primitives, as a reverse list read up to a limit would.
fn keep_last_submitted(n: u32) {
    for (var i = 0u; i < n; i++) {
        order[i] = order[i].yx;
    }
    sort_entries(n);
    for (var i = 0u; i < n; i++) {
        order[i] = order[i].yx;
    }
}

fn resolve_pixel(pixel: u32, only: u32) {
    var n = gather(pixel, only);
    if LIMIT > 0u && LIMIT_LAST && n > LIMIT {
        keep_last_submitted(n);
        n = LIMIT;
    }
    sort_entries(n);
    if LIMIT > 0u {
        n = min(n, LIMIT);
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
    if i < classes.totals[CLASS] * INVOCATIONS_PER_PIXEL {
        let pixel = class_pixels[classes.bases[CLASS] + i / INVOCATIONS_PER_PIXEL];
        resolve_pixel(pixel, i % INVOCATIONS_PER_PIXEL);
    }
}
