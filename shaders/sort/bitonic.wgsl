// Batcher's network for any length: what lies past the end counts as greatest, and never moves, since each merge
// begins by reversing its second half.

fn sort_entries(n: u32) {
    for (var size = 2u; size / 2u < n; size *= 2u) {
        for (var i = 0u; i < n; i++) {
            let j = i ^ (size - 1u);
            if i < j && j < n {
                exchange(i, j);
            }
        }
        for (var step = size / 4u; step > 0u; step /= 2u) {
            for (var i = 0u; i < n; i++) {
                let j = i ^ step;
                if i < j && j < n {
                    exchange(i, j);
                }
            }
        }
    }
}
