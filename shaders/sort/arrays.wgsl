// The temporary array of a sort (GPU Pro 2, section 2.6.3): (key, order) of each fragment, and its node.

var<private> order: array<vec2u, TEMP>;
var<private> entries: array<u32, TEMP>;

fn exchange(i: u32, j: u32) {
    let a = order[i];
    let b = order[j];
    if in_front(b, a) {
        order[i] = b;
        order[j] = a;
        let entry = entries[i];
        entries[i] = entries[j];
        entries[j] = entry;
    }
}
