// Keys and triangles in workgroup memory: `sort` orders them, and leaves HIDDEN at the end.

fn composite(n: u32, local: u32, pixel: vec2u) -> State {
    sort(n, widest(n));
    var state = begin();
    for (var i = 0u; i < visible; i++) {
        composite_one(&state, i, ids[entry(i)], vec2f(pixel) + 0.5);
    }
    return state;
}
