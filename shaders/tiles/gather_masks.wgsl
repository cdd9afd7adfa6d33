// An invocation a pixel tests all triangles of the tile, at most MOST, and keeps a bit for each that covers: for few
// triangles, that cover many pixels. Keys are made when they are sorted.

const MOST = 128u;
const BATCH = 32u;

// Edge functions at the tile's first pixel, and the number of pieces where there are several; their slopes, and the first
// piece.
var<workgroup> batch_q: array<vec4i, BATCH>;
var<workgroup> batch_a: array<vec4i, BATCH>;
var<workgroup> batch_b: array<vec4i, BATCH>;
// Of all triangles what keys are made from, value by value, so that invocations that read several do not collide.
var<workgroup> plane_value: array<f32, MOST>;
var<workgroup> plane_gx: array<f32, MOST>;
var<workgroup> plane_gy: array<f32, MOST>;
var<workgroup> plane_low: array<f32, MOST>;
var<workgroup> plane_high: array<f32, MOST>;
var<workgroup> plane_x: array<f32, MOST>;
var<workgroup> plane_y: array<f32, MOST>;
var<workgroup> plane_id: array<u32, MOST>;

var<private> covering: vec4u;

fn load(t: u32, id: u32, corner: vec2i) {
    let item = item_of(id, corner.x, corner.y);
    var q = vec4i(item.edges.q, item.piece_count);
    if HIDES && (item.flags & OPAQUE) != 0u {
        q = vec4i(-0x7fffffff, -0x7fffffff, -0x7fffffff, 0); // done before
    }
    let slot = t % BATCH;
    batch_q[slot] = q;
    batch_a[slot] = vec4i(item.edges.a, item.first_piece);
    batch_b[slot] = vec4i(item.edges.b, 0);
    plane_value[t] = item.key.plane.x;
    plane_gx[t] = item.key.plane.y;
    plane_gy[t] = item.key.plane.z;
    plane_low[t] = item.key.plane.w;
    plane_high[t] = item.key.rest.x;
    plane_x[t] = item.key.rest.y;
    plane_y[t] = item.key.rest.z;
    plane_id[t] = id;
}

// A bit for each of 32 triangles.
fn tested(first: u32, span: Span, corner: vec2i, place: vec2i, local: u32) -> u32 {
    let size = min(BATCH, span.count - first);
    workgroupBarrier(); // the batch before is read
    if local < size {
        load(first + local, tile_entries[span.first + first + local], corner);
    }
    workgroupBarrier(); // the batch is written
    var mask = 0u;
    for (var t = 0u; t < size; t++) {
        let q = batch_q[t];
        let a = batch_a[t];
        let e = q.xyz + a.xyz * place.x + batch_b[t].xyz * place.y;
        var covers = (e.x | e.y | e.z) >= 0;
        if q.w > 0 {
            covers = pieces_cover(a.w, q.w, corner, place);
        }
        mask |= u32(covers) << t;
    }
    return mask;
}

fn gather(span: Span, corner: vec2i, place: vec2i, is_inside: bool, local: u32) -> u32 {
    var mask = vec4u(0u);
    if span.count > MOST {
        return DEPTH + 1u;
    }
    mask.x = tested(0u, span, corner, place, local);
    if span.count > 32u {
        mask.y = tested(32u, span, corner, place, local);
    }
    if span.count > 64u {
        mask.z = tested(64u, span, corner, place, local);
    }
    if span.count > 96u {
        mask.w = tested(96u, span, corner, place, local);
    }
    covering = select(vec4u(0u), mask, is_inside);
    let counts = countOneBits(covering);
    return counts.x + counts.y + counts.z + counts.w;
}

// The next triangle of the mask; any of them, if there is none.
fn take(i: u32) -> u32 {
    // The first word that is not empty loses its lowest bit.
    let empty = covering == vec4u(0u);
    let is_first = vec4<bool>(!empty.x, empty.x & !empty.y, empty.x & empty.y & !empty.z, empty.x & empty.y & empty.z);
    let bits = select(select(select(covering.w, covering.z, is_first.z), covering.y, is_first.y), covering.x, is_first.x);
    let word = select(select(select(96u, 64u, is_first.z), 32u, is_first.y), 0u, is_first.x);
    covering = select(covering, covering & (covering - 1u), is_first);
    return min(word + firstTrailingBit(bits), MOST - 1u);
}

fn id_of_place(t: u32) -> u32 {
    return plane_id[t];
}

fn value_of_place(t: u32, at: vec2f) -> f32 {
    let d = at - vec2f(plane_x[t], plane_y[t]);
    let value = plane_value[t] + product(plane_gx[t], d.x) + product(plane_gy[t], d.y);
    return clamped(value, plane_low[t], plane_high[t]);
}
