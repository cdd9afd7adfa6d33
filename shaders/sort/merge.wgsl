// Bottom up, between two arrays.

var<private> merged_order: array<vec2u, TEMP>;
var<private> merged_entries: array<u32, TEMP>;

fn sort_entries(n: u32) {
    for (var width = 1u; width < n; width *= 2u) {
        for (var first = 0u; first < n; first += 2u * width) {
            let middle = min(first + width, n);
            let end = min(first + 2u * width, n);
            var a = first;
            var b = middle;
            for (var out = first; out < end; out++) {
                var take_left = b == end;
                if !take_left && a < middle {
                    take_left = !in_front(order[b], order[a]);
                }
                let from_index = select(b, a, take_left);
                merged_order[out] = order[from_index];
                merged_entries[out] = entries[from_index];
                a += u32(take_left);
                b += u32(!take_left);
            }
        }
        order = merged_order;
        entries = merged_entries;
    }
}
