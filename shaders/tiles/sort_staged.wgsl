// Batcher's odd-even merge sort (Knuth, The Art of Computer Programming, volume 3, 5.2.2 M), in loops: deep pixels of small
// triangles are few, and written out this takes drivers seconds to compile.

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

fn sort(n: u32, all: u32) {
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
    // What is hidden was not kept.
    visible = n;
}
