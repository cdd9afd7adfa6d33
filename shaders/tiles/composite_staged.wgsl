// Keys and triangles in workgroup memory, of visible fragments alone, sorted by Batcher's odd-even merge sort (Knuth, The
// Art of Computer Programming, volume 3, 5.2.2 M), in loops: parts that no other class has room for are few, and written
// out this takes drivers seconds to compile.

fn composite(n: u32, local: u32, pixel: vec2u) -> State {
    sort(n);
    var state = begin();
    for (var i = 0u; i < n; i++) {
        composite_one(&state, i, ids[entry(i)], vec2f(pixel) + 0.5);
    }
    return state;
}

fn exchange(i: u32, j: u32) {
    let a = vec2u(keys[entry(i)], ids[entry(i)]);
    let b = vec2u(keys[entry(j)], ids[entry(j)]);
    if b.x < a.x || (b.x == a.x && b.y > a.y) { // of equal keys the later triangle is in front
        keys[entry(i)] = b.x;
        ids[entry(i)] = b.y;
        keys[entry(j)] = a.x;
        ids[entry(j)] = a.y;
    }
}

fn sort(n: u32) {
    var top = 1u;
    while 2u * top < n {
        top *= 2u;
    }
    for (var p = top; p > 0u; p /= 2u) {
        var q = top;
        var r = 0u;
        var d = p;
        loop {
            for (var i = 0u; i + d < n; i++) {
                if (i & p) == r {
                    exchange(i, i + d);
                }
            }
            if q == p {
                break;
            }
            d = q - p;
            q /= 2u;
            r = p;
        }
    }
}
