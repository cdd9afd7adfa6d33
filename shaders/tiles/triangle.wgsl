// Triangles as setup leaves them: snapped corners, and the planes of the unsnapped triangle.

struct Raster {
    // 1/256 pixel, in the order that makes the area positive with y down. Of a triangle that was clipped: its box
    // (x0, y0, x1, y1), its first piece, and how many there are.
    corners: array<i32, 6>,
    flags: u32,
    // Where its colours begin (see color.wgsl).
    colors: u32,
}

// What the sort key is made from, 1/w under a perspective, else the eye depth: a plane around the anchor, and the
// range of the corners.
struct KeyPlane {
    value: f32,
    gx: f32,
    gy: f32,
    low: f32,
    high: f32,
    anchor_x: f32,
    anchor_y: f32,
    alpha_cutoff: f32,
}

// What stages count on the way.
struct Counters {
    // Finite triangles whose transformed values are not.
    rejected: atomic<u32>,
    to_clip: atomic<u32>,
    // Demands, which may exceed what there is room for: then the host makes room and starts again.
    pieces: atomic<u32>,
    bin_entries: atomic<u32>,
    tile_entries: atomic<u32>,
    // Of a tile's list; TOO_LONG where a bin has more triangles than a software driver's loops reach.
    longest: atomic<u32>,
    // The pixels where translucent triangles may land: 65,536 less the first column and row, and one past the last; 0
    // where there are none.
    box: array<atomic<u32>, 4>,
}

const TOO_LONG = 0xffffffffu;

const VISIBLE = 1u;
const CLIPPED = 2u;
// Its corners differ in colour.
const GRADIENT = 4u;
// Colours lie side by side, three a triangle; else they are its vertices'.
const BY_CORNER = 8u;
const OPAQUE = 16u;
// Fragments of less alpha are discarded.
const CUT_OUT = 32u;
// The corner that is first, second and third in canonical order, two bits each.
const ORDER_SHIFT = 8u;
// Which of those the planes are anchored at.
const ANCHOR_SHIFT = 14u;
const BLEND_SHIFT = 24u;

const TILE = 16;

// Pixels that may be covered: x0, y0, x1, y1, inclusive and cut to the viewport (src/cpu/setup.rs, pixel_box).
fn pixel_box(r: Raster) -> vec4i {
    var low = vec2i(r.corners[0], r.corners[1]);
    var high = vec2i(r.corners[2], r.corners[3]);
    if (r.flags & CLIPPED) == 0u {
        let third = vec2i(r.corners[4], r.corners[5]);
        let first = low;
        low = min(first, min(high, third));
        high = max(first, max(high, third));
    }
    return box_of(low, high);
}

fn box_of(low: vec2i, high: vec2i) -> vec4i {
    var first: vec2i;
    var last: vec2i;
    if SAMPLES > 1u {
        // Samples lie from 256 i to 256 i + 240.
        first = (low + 15) >> vec2u(8u);
        last = high >> vec2u(8u);
    } else {
        // Centres lie at 256 i + 128: round the low end up and the high end down to one.
        first = (low + 127) >> vec2u(8u);
        last = (high - 128) >> vec2u(8u);
    }
    let size = vec2i(i32(view.width), i32(view.height));
    return vec4i(max(first, vec2i(0)), min(last, size - 1));
}

fn is_empty(b: vec4i) -> bool {
    return b.x > b.z || b.y > b.w;
}
