// Fragments that `take` gives as places, of PLACE_BITS each: `sort` makes their keys and orders them in registers, and leaves
// the places front to back.

const PLACES = 32u / PLACE_BITS; // of a word

var<private> order: array<u32, (DEPTH + PLACES - 1u) / PLACES>;

// The key of a place, or HIDDEN where none was taken.
fn taken_key(t: u32, is_taken: bool, pixel: vec2u) -> u32 {
    let key = visible_key(value_of_place(select(0u, t, is_taken), vec2f(pixel) + 0.5), pixel);
    if HIDES {
        visible -= u32(is_taken & (key == HIDDEN));
    }
    return select(HIDDEN, key, is_taken);
}

fn composite(n: u32, local: u32, pixel: vec2u) -> State {
    sort(n, pixel);
    var state = begin();
    for (var i = 0u; i < visible; i++) {
        let t = (order[i / PLACES] >> (PLACE_BITS * (i % PLACES))) & ((1u << PLACE_BITS) - 1u);
        composite_one(&state, i, id_of_place(t), vec2f(pixel) + 0.5);
    }
    return state;
}
