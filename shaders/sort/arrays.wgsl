// The temporary array of a sort (GPU Pro 2, section 2.6.3): (key, order) of each fragment, and its node.

var<private> order: array<vec2u, TEMP>;
var<private> entries: array<u32, TEMP>;

fn exchange(i: u32, j: u32) {
    let a = order[i];
    let b = order[j];
    let swaps = in_front(b, a);
    order[i] = select(a, b, swaps);
    order[j] = select(b, a, swaps);
    let p = entries[i];
    let q = entries[j];
    entries[i] = select(p, q, swaps);
    entries[j] = select(q, p, swaps);
}
