// An invocation a pixel tests all triangles of the tile, and keeps what covers in workgroup memory: for tiles of many
// triangles, that other classes have no room for.

const BATCH = 32u;

var<workgroup> batch: array<Item, BATCH>;
// Entry e of pixel p lies at e · THREADS + p.
var<workgroup> keys: array<u32, ENTRIES>;
var<workgroup> ids: array<u32, ENTRIES>;

var<private> first_entry: u32;

fn entry(i: u32) -> u32 {
    return first_entry + i * THREADS;
}

fn covers(t: u32, corner: vec2i, place: vec2i) -> bool {
    if batch[t].piece_count > 0 {
        return pieces_cover(batch[t].first_piece, batch[t].piece_count, corner, place);
    }
    let e = batch[t].edges.q + batch[t].edges.a * place.x + batch[t].edges.b * place.y;
    return (e.x | e.y | e.z) >= 0;
}

fn gather(span: Span, corner: vec2i, place: vec2i, is_inside: bool, local: u32) -> u32 {
    var n = 0u;
    first_entry = local;
    let pixel = vec2u(corner + place);
    for (var first = 0u; first < span.count; first += BATCH) {
        let size = min(BATCH, span.count - first);
        if n > DEPTH {
            atomicStore(&overflows, 1u);
        }
        workgroupBarrier(); // the batch before is read
        if atomicLoad(&overflows) == 1u {
            return n; // the part goes on to the next class: the rest need not be walked
        }
        for (var t = local; t < size; t += THREADS) {
            batch[t] = item_of(tile_entries[span.first + first + t], corner.x, corner.y);
        }
        workgroupBarrier(); // the batch is written
        for (var t = 0u; t < size; t++) {
            if HIDES && (batch[t].flags & OPAQUE) != 0u {
                continue; // done before
            }
            if is_inside && covers(t, corner, place) {
                let key = visible_key(value_at(batch[t].key, vec2f(pixel) + 0.5), pixel);
                if key != HIDDEN {
                    if n < DEPTH {
                        keys[entry(n)] = key;
                        ids[entry(n)] = batch[t].id;
                    }
                    n++;
                }
            }
        }
    }
    return n;
}
