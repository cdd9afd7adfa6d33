fn sift(start: u32, n: u32) {
    var root = start;
    for (var child = 2u * root + 1u; child < n; child = 2u * root + 1u) {
        if child + 1u < n && in_front(order[child], order[child + 1u]) {
            child++;
        }
        if !in_front(order[root], order[child]) {
            return;
        }
        exchange_any(root, child);
        root = child;
    }
}

fn exchange_any(i: u32, j: u32) {
    let own = order[i];
    let entry = entries[i];
    order[i] = order[j];
    entries[i] = entries[j];
    order[j] = own;
    entries[j] = entry;
}

fn sort_entries(n: u32) {
    for (var root = n / 2u; root > 0u; root--) {
        sift(root - 1u, n);
    }
    for (var end = n; end > 1u; end--) {
        exchange_any(0u, end - 1u);
        sift(0u, end - 1u);
    }
}
