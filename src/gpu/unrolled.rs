//! The temporary array of a short class with every index written out: constant indices stay in registers, where
//! indexed arrays are memory, and the size of that array is what a resolve costs.

use std::fmt::Write;

/// `gather`, `sort_entries` and `composite` of resolve/class.wgsl for arrays of `temp` entries.
pub fn text(temp: u32, back_to_front: bool) -> String {
    let mut text =
        String::from("fn gather(pixel: u32) -> u32 {\n    var c = first_of(pixel);\n    var n = 0u;\n");
    for i in 0..temp {
        // Writing to a String cannot fail. One entry alone needs no order.
        if temp > 1 {
            let _ = writeln!(text, "    order[{i}] = vec2u(0xffffffffu);");
        }
        let order = if temp > 1 { format!(" order[{i}] = order_of(node);") } else { String::new() };
        let _ = writeln!(
            text,
            "    if !is_end(c) {{ let node = node_at(c);{order} entries[{i}] = node; advance(&c); n = {i}u + 1u; }}"
        );
    }
    // What is past the end is greatest, and stays there.
    text.push_str("    return n;\n}\n\nfn sort_entries(n: u32) {\n");
    for (i, j) in network(temp) {
        let _ = writeln!(text, "    exchange({i}u, {j}u);");
    }
    text.push_str("}\n\nfn composite(n: u32, only: u32) {\n");
    // Without an early stop: neighbours seldom stop together, and not to stop keeps any bound.
    let mut visit = |i: u32| {
        let _ = writeln!(text, "    if n > {i}u {{ blend_entry(entries[{i}], only); }}");
    };
    if back_to_front {
        (0..temp).rev().for_each(&mut visit)
    } else {
        (0..temp).for_each(&mut visit)
    }
    text.push_str("}\n");
    text
}

/// Batcher's odd-even merge sort of `n` entries (Knuth, The Art of Computer Programming, volume 3, 5.2.2 M).
/// Exchanges past the end fall away: what would be there is greatest.
pub fn network(n: u32) -> Vec<(u32, u32)> {
    let mut exchanges = Vec::new();
    let top = n.next_power_of_two() / 2;
    let mut p = top;
    while p > 0 {
        let (mut q, mut r, mut d) = (top, 0, p);
        loop {
            exchanges.extend((0..n).filter(|i| i & p == r && i + d < n).map(|i| (i, i + d)));
            if q == p {
                break;
            }
            (d, q, r) = (q - p, q / 2, p);
        }
        p /= 2;
    }
    exchanges
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_networks_sort_every_sequence_of_zeros_and_ones() {
        // By the 0–1 principle they then sort everything.
        for n in 1..=16_u32 {
            let exchanges = network(n);
            for bits in 0..1_u32 << n {
                let mut list = bits;
                for &(i, j) in &exchanges {
                    if list >> i & 1 > list >> j & 1 {
                        list ^= 1 << i | 1 << j;
                    }
                }
                let zeros = n - bits.count_ones();
                assert_eq!(
                    list,
                    if zeros == 32 { 0 } else { ((1_u64 << n) - (1 << zeros)) as u32 },
                    "{n} {bits:b}"
                );
            }
        }
    }
}
