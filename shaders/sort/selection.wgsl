fn sort_entries(n: u32) {
    for (var k = 0u; k + 1u < n; k++) {
        var least = k;
        for (var i = k + 1u; i < n; i++) {
            if in_front(order[i], order[least]) {
                least = i;
            }
        }
        exchange(k, least);
    }
}
