// A part of a tile: an invocation owns a pixel, whose fragments are gathered, sorted in registers, and composited front to
// back with method exact. A part that holds more than its class has room for goes to the next class.
//
// Classes gather in four ways (gather_masks.wgsl, gather_triangles.wgsl, gather_deep.wgsl, gather_staged.wgsl), each with a
// `gather` that returns how many fragments a pixel has, and a `composite`. Workgroup memory is what bounds how many parts are
// in flight: none holds more of it than it must.

@group(1) @binding(0) var<storage, read_write> image: array<vec4f>;
@group(1) @binding(1) var<storage, read_write> pixel_counts: array<u32>;
@group(1) @binding(2) var<storage, read_write> classes: Classes;
// Parts of each class, window.parts apart.
@group(1) @binding(3) var<storage, read_write> parts: array<u32>;
// Workgroups of the next class.
@group(1) @binding(4) var<storage, read_write> next_groups: array<atomic<u32>, 3>;
@group(1) @binding(5) var background_image: texture_2d<f32>;

var<workgroup> overflows: atomic<u32>;
var<workgroup> deepest: atomic<u32>;
var<workgroup> fragments: atomic<u32>;
var<workgroup> shared_span: Span;
var<workgroup> shared_part: u32;

// Fragments of the own pixel that are composited.
var<private> visible: u32;

fn color_of(id: u32, at: vec2f) -> vec4f {
    if !HAS_GRADIENTS {
        return color_at(id, 0u, KeyPlane(), at);
    }
    return color_at(id, flags_of(rasters[id]), key_planes[id], at);
}

// Composites the i-th nearest fragment of a pixel. None is left out where nothing shows through, though it may be:
// to look took an H100 1 to 6 % of a frame (benchmarks/NOTES.md).
fn composite_one(state: ptr<function, State>, i: u32, id: u32, at: vec2f) {
    let color = color_of(id, at);
    insert(state, color);
    keep(i, id, at, color);
}

fn behind(at: vec2u) -> vec4f {
    if HIDES {
        let color = opaque_colors[at.y * view.width + at.x];
        if color.a == 1.0 {
            return color;
        }
    }
    if view.background_texture == 1u {
        return textureLoad(background_image, at, 0);
    }
    return view.background;
}

// Greater than any key.
const HIDDEN = 0xffffffffu;

// The key of a fragment that opaque surfaces leave visible, or HIDDEN. What lies at their depth is kept.
fn visible_key(value: f32, pixel: vec2u) -> u32 {
    let key = sort_key(value);
    if HIDES && key > opaque_keys[pixel.y * view.width + pixel.x] {
        return HIDDEN;
    }
    return key;
}

// Hands the part to the next class, cut into as many as its workgroups are smaller.
fn push_next(part: u32) {
    let n = max(THREADS / NEXT_THREADS, 1u);
    let place = atomicAdd(&classes.counts[NEXT_CLASS], n);
    for (var i = 0u; i < n; i++) {
        parts[NEXT_CLASS * window.parts + place + i] = part + i * NEXT_THREADS / UNIT;
    }
    atomicMax(&next_groups[0], min(place + n, MOST_GROUPS));
}

@compute @workgroup_size(THREADS)
fn cs_resolve(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    if local == 0u {
        shared_part = atomicLoad(&classes.counts[OWN_CLASS]);
    }
    let count = workgroupUniformLoad(&shared_part);
    // One turn, but for images of more parts than a dispatch has workgroups.
    for (var i = group.x; i < count; i += MOST_GROUPS) {
        if local == 0u {
            shared_part = parts[OWN_CLASS * window.parts + i];
            shared_span = tiles[shared_part / UNITS];
            atomicStore(&overflows, 0u);
            atomicStore(&deepest, 0u);
            atomicStore(&fragments, 0u);
        }
        let part = workgroupUniformLoad(&shared_part);
        let span = workgroupUniformLoad(&shared_span);
        resolve_part(part, span, local);
        workgroupBarrier(); // all is read before the next turn writes it
    }
}

fn resolve_part(part: u32, span: Span, local: u32) {
    let tile = part / UNITS;
    let corner = vec2i(vec2u(tile % window.tiles_x, tile / window.tiles_x + window.first_row)) * TILE;
    let in_tile = part % UNITS * UNIT + local;
    let place = vec2i(i32(in_tile % 16u), i32(in_tile / 16u));
    let pixel = vec2u(corner + place);
    let is_inside = pixel.x < view.width && pixel.y < view.height;
    let gathered = gather(span, corner, place, is_inside, local);
    if gathered > DEPTH {
        atomicStore(&overflows, 1u);
    }
    workgroupBarrier(); // it is known whether some pixel has no room
    if atomicLoad(&overflows) == 1u {
        if local == 0u {
            push_next(part);
        }
        return;
    }
    visible = gathered;
    begin_list(gathered, local);
    let color = composite(gathered, local, pixel);
    if is_inside {
        let out = pixel.y * view.width + pixel.x;
        image[out] = end(color, behind(pixel));
        if COUNTS {
            pixel_counts[out] = visible;
        }
        end_list(out);
    }
    count_visible();
    workgroupBarrier(); // all are counted
    if local == 0u && atomicLoad(&fragments) > 0u {
        atomicAdd(&classes.fragments, atomicLoad(&fragments));
        atomicMax(&classes.deepest, atomicLoad(&deepest));
    }
}
