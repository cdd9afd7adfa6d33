// Coverage of 8×8 pixels, by one invocation.

// Of the 8×8 pixels from `first` those that are covered, row after row from the lowest bit, up to `last`.
fn covered_block(item: Item, corner: vec2i, first: vec2i, last: vec2i) -> vec2u {
    let size = min(last - first + 1, vec2i(8));
    var rows = vec2u(0u);
    if item.piece_count > 0 {
        for (var i = 0; i < size.x * size.y; i++) {
            let at = vec2i(i % size.x, i / size.x);
            if pieces_cover(item.first_piece, item.piece_count, corner, first + at) {
                rows[at.y / 4] |= 1u << u32(at.x + 8 * (at.y % 4));
            }
        }
        return rows;
    }
    let in_row = (1u << u32(size.x)) - 1u;
    var e = item.edges.q + item.edges.a * first.x + item.edges.b * first.y;
    for (var j = 0; j < size.y; j++) {
        // Eight signs at once: a sign bit is 1 outside.
        var f = e;
        var outside = 0u;
        for (var i = 0u; i < 8u; i++) {
            outside |= (bitcast<u32>(f.x | f.y | f.z) >> 31u) << i;
            f += item.edges.a;
        }
        let row = (~outside & in_row) << u32(8 * (j % 4));
        if j < 4 {
            rows.x |= row;
        } else {
            rows.y |= row;
        }
        e += item.edges.b;
    }
    return rows;
}

// Takes a pixel out of a block whose first is `first`: its number in rows of 16.
fn next_pixel(rest: ptr<function, vec2u>, first: vec2i) -> u32 {
    var bit = firstTrailingBit((*rest).x);
    if (*rest).x != 0u {
        (*rest).x &= (*rest).x - 1u;
    } else {
        bit = firstTrailingBit((*rest).y) + 32u;
        (*rest).y &= (*rest).y - 1u;
    }
    return (u32(first.y) + bit / 8u) * 16u + u32(first.x) + bit % 8u;
}
