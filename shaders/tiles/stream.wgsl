// A method other than exact: an invocation owns a pixel and holds the method's state, and walks the tile's triangles, in
// the order of submission, as often as the method asks for. Samples are taken one after the other.

struct Totals {
    fragments: atomic<u32>,
    deepest: atomic<u32>,
    // By a bounded method, merged or dropped; of several samples, of the one with most.
    left_out: atomic<u32>,
    filled_tiles: atomic<u32>,
}

@group(1) @binding(0) var<storage, read_write> image: array<vec4f>;
@group(1) @binding(1) var<storage, read_write> pixel_counts: array<u32>;
@group(1) @binding(2) var<storage, read_write> totals: Totals;
@group(1) @binding(3) var<uniform> method: Method;
@group(1) @binding(4) var background_image: texture_2d<f32>;

var<workgroup> wanting: atomic<u32>;
var<workgroup> tile_fragments: atomic<u32>;
var<workgroup> tile_deepest: atomic<u32>;
var<workgroup> tile_left_out: atomic<u32>;

var<private> state: State;
var<private> own_sample: u32;
var<private> own_pass: u32;
var<private> is_wanted: bool;
// Of the pixel, whatever the sample.
var<private> own_count: u32;
// Of the sample.
var<private> sample_count: u32;

fn visit(n: u32, pixel: vec2u, center: vec2f, mask: u32) {
    let opaque_here = is_opaque(n);
    if HIDES && opaque_here {
        return;
    }
    let coverage = mask & FULL_MASK & ~hidden(n, pixel, center, mask);
    if coverage == 0u {
        return;
    }
    let at = place_of_fragment(mask, center);
    var color = color_in(n, at);
    if opaque_here {
        if !passes(n, color) {
            return;
        }
        color.a = 1.0;
    }
    if own_pass == 0u && own_sample == 0u {
        own_count += 1u;
    }
    if !is_wanted || (coverage >> own_sample & 1u) == 0u {
        return;
    }
    if own_pass == 0u {
        sample_count += 1u;
    }
    let value = value_at(items[n].key, at);
    let depth = select(value, 1.0 / value, view.perspective == 1u);
    let mode = select(0u, (items[n].flags >> BLEND_SHIFT) & 15u, MIXED && !opaque_here);
    insert(&state, Fragment(color, depth, sort_key(value), items[n].id, mode), own_pass);
}

fn behind(pixel: vec2u) -> vec4f {
    if HIDES {
        let color = opaque_colors[(pixel.y * view.width + pixel.x) * SAMPLES + own_sample];
        if color.a == 1.0 {
            return color;
        }
    }
    if view.background_texture == 1u {
        return textureLoad(background_image, pixel, 0);
    }
    return view.background;
}

fn weight_of_sample(color: vec4f) -> f32 {
    if SAMPLES > 1u && MSAA_RESOLVE == MSAA_HDR {
        return 1.0 / (1.0 + max(0.0, max(color.r, max(color.g, color.b))));
    }
    return 1.0;
}

// Whether some pixel of the tile wants another pass.
fn any_wants(own: bool, local: u32) -> bool {
    workgroupBarrier(); // the answer before is read
    if local == 0u {
        atomicStore(&wanting, 0u);
    }
    workgroupBarrier(); // it is 0
    if own {
        atomicStore(&wanting, 1u);
    }
    workgroupBarrier(); // all have said
    return atomicLoad(&wanting) == 1u;
}

@compute @workgroup_size(256)
fn cs_stream(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let tile = group.xy + vec2u(0u, method.first_row / 16u);
    let pixel = tile * 16u + vec2u(local % 16u, local / 16u);
    let is_inside = pixel.x < view.width && pixel.y < view.height;
    let out = (pixel.y - method.first_row) * view.width + pixel.x;
    if local == 0u {
        atomicStore(&tile_fragments, 0u);
        atomicStore(&tile_deepest, 0u);
        atomicStore(&tile_left_out, 0u);
    }
    own_count = 0u;
    var sum = vec4f(0.0);
    var weights = 0.0;
    var most_left_out = 0u;
    for (var s = 0u; s < SAMPLES; s++) {
        own_sample = s;
        sample_count = 0u;
        state = begin(Place(pixel, s));
        for (var p = 0u; ; p++) {
            own_pass = p;
            // Asked once more than there are passes: the state then takes in what the last one found.
            is_wanted = is_inside && turn(&state, p) && p < method.passes;
            if !any_wants(is_wanted, local) {
                break;
            }
            walk(tile, 0u, local);
        }
        let color = end(&state, behind(pixel));
        most_left_out = max(most_left_out, left_out(&state, sample_count));
        if MSAA_RESOLVE == MSAA_NONE && is_inside {
            image[out * SAMPLES + s] = color;
        }
        let weight = weight_of_sample(color);
        sum += weight * color;
        weights += weight;
    }
    if is_inside {
        if MSAA_RESOLVE != MSAA_NONE {
            image[out] = select(sum / weights, sum, SAMPLES == 1u);
        }
        pixel_counts[out] = own_count;
        atomicAdd(&tile_fragments, own_count);
        atomicMax(&tile_deepest, own_count);
        atomicAdd(&tile_left_out, most_left_out);
    }
    workgroupBarrier(); // all are counted
    if local == 0u && atomicLoad(&tile_fragments) > 0u {
        atomicAdd(&totals.fragments, atomicLoad(&tile_fragments));
        atomicMax(&totals.deepest, atomicLoad(&tile_deepest));
        atomicAdd(&totals.left_out, atomicLoad(&tile_left_out));
        atomicAdd(&totals.filled_tiles, 1u);
    }
}
