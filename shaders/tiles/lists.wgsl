// Every fragment of a tile, as the stages that keep lists take them: coverage at the samples, one depth and one colour.

const BATCH = 32u;
// In a pixel's mask: the centre is covered too.
const CENTER_BIT = 1u << 16u;

var<workgroup> items: array<Item, BATCH>;
var<workgroup> shared_span: Span;

fn mask_of(e: Edges, i: i32, j: i32) -> u32 {
    let along = e.a * i + e.b * j;
    let center = e.q + along;
    let is_inside = min(center.x, min(center.y, center.z)) >= 0;
    if SAMPLES == 1u {
        return select(0u, CENTER_BIT | 1u, is_inside);
    }
    var mask = select(0u, CENTER_BIT, is_inside);
    var pattern = SAMPLE_OFFSETS;
    for (var s = 0u; s < SAMPLES; s++) {
        let q = edges_at(e, pattern[s].x, pattern[s].y) + along;
        mask |= u32(min(q.x, min(q.y, q.z)) >= 0) << s;
    }
    return mask;
}

// The union over the pieces of a triangle.
fn coverage(n: u32, i: i32, j: i32, x0: i32, y0: i32) -> u32 {
    if items[n].piece_count == 0 {
        return mask_of(items[n].edges, i, j);
    }
    var mask = 0u;
    for (var p = 0; p < items[n].piece_count; p++) {
        mask |= mask_of(edges_of(pieces[items[n].first_piece + p], x0, y0), i, j);
    }
    return mask;
}

fn sample_at(center: vec2f, s: u32) -> vec2f {
    var offsets = PATTERN;
    return center + offsets[s];
}

// Where depth and colour are taken: at the centre if it is covered, else at the lowest covered sample.
fn place_of_fragment(mask: u32, center: vec2f) -> vec2f {
    if SAMPLES == 1u || (mask & CENTER_BIT) != 0u {
        return center;
    }
    return sample_at(center, firstTrailingBit(mask));
}

// Walks a slice of the tile's list: of window.count triangles, from window.first on.
fn walk(tile: vec2u, slice: u32, local: u32) {
    let x0 = TILE * i32(tile.x);
    let y0 = TILE * i32(tile.y);
    let i = i32(local % 16u);
    let j = i32(local / 16u);
    let pixel = vec2u(vec2i(x0 + i, y0 + j));
    let is_inside = pixel.x < view.width && pixel.y < view.height;
    let center = vec2f(pixel) + 0.5;
    if local == 0u {
        let span = tiles[(tile.y - window.first_row) * window.tiles_x + tile.x];
        let first = min(window.first + slice * window.count, span.count);
        shared_span = Span(span.first + first, min(span.count - first, window.count));
    }
    let span = workgroupUniformLoad(&shared_span);
    for (var first = 0u; first < span.count; first += BATCH) {
        workgroupBarrier(); // the batch before is read
        if local < BATCH && first + local < span.count {
            items[local] = item_of(tile_entries[span.first + first + local], x0, y0);
        }
        workgroupBarrier(); // the batch is written
        for (var n = 0u; n < min(BATCH, span.count - first); n++) {
            let mask = coverage(n, i, j, x0, y0);
            if is_inside && (mask & FULL_MASK) != 0u {
                visit(n, pixel, center, mask);
            }
        }
    }
}

fn is_opaque(n: u32) -> bool {
    return (items[n].flags & OPAQUE) != 0u;
}

fn color_in(n: u32, at: vec2f) -> vec4f {
    return color_at(items[n].id, items[n].flags, items[n].key, at);
}

fn passes(n: u32, color: vec4f) -> bool {
    return (items[n].flags & CUT_OUT) == 0u || color.a >= items[n].key.rest.w;
}
