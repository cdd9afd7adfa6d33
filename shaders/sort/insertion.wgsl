// The chapter's own.

fn sort_entries(n: u32) {
    for (var k = 1u; k < n; k++) {
        let own = order[k];
        let entry = entries[k];
        var i = k;
        while i > 0u && in_front(own, order[i - 1u]) {
            order[i] = order[i - 1u];
            entries[i] = entries[i - 1u];
            i--;
        }
        order[i] = own;
        entries[i] = entry;
    }
}
