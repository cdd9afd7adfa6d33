// Triangles as setup leaves them: snapped corners, and the planes of the unsnapped triangle.

// Vectors, so that one load brings four words.
struct Raster {
    // Edge functions relative to the centre of the first pixel of the triangle's box, in 1/256 pixel: the slopes a₀, a₁,
    // b₀, b₁ (the third edge's are what makes their sum 0) …
    slopes: vec4i,
    // … the three values, floored to whole 256ths, and the flags. Of a triangle whose flags say PIECES: the first of
    // its pieces, and how many there are.
    values: vec4i,
}

// What the sort key is made from, 1/w under a perspective, else the eye depth: a plane around the anchor, and the
// range of the corners.
struct KeyPlane {
    // value, gx, gy, low
    plane: vec4f,
    // high, anchor x and y, and the alpha below which fragments are discarded
    rest: vec4f,
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

// Its corners lie aside: it was clipped, or is too large for slopes of 32 bits.
const PIECES = 2u;
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
// What flooring the three values left, in 1/16 pixel: four bits each.
const REST_SHIFT = 16u;
const LAST_REST_SHIFT = 28u;
const BLEND_SHIFT = 24u;

const TILE = 16;

// Pixels that may be covered, inclusive and cut to the viewport, in 14 bits each: x0, y0, then x1, y1; above them four
// bits each of the share of the box that the triangle covers. Nothing where x0 is over x1.
fn packed_box(box: vec4i, share: f32) -> vec2u {
    let b = vec4u(box);
    let s = u32(clamp(share, 0.0, 1.0) * 255.0);
    return vec2u(b.x | (b.y << 14u) | ((s & 15u) << 28u), b.z | (b.w << 14u) | ((s >> 4u) << 28u));
}

const EMPTY_BOX = vec2u(1u, 0u);

fn unpacked_box(p: vec2u) -> vec4i {
    let b = p & vec2u(0x3fffu);
    let c = (p >> vec2u(14u)) & vec2u(0x3fffu);
    return vec4i(i32(b.x), i32(c.x), i32(b.y), i32(c.y));
}

fn share_of(p: vec2u) -> f32 {
    return f32((p.x >> 28u) | ((p.y >> 28u) << 4u)) / 255.0;
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
