//! Sorting short lists: networks of compare-exchanges, which have no branches to mispredict, for lists of up
//! to eight; most pixels of most scenes have no more.

use crate::real::Bounded;

/// Sorts ascending.
#[inline]
pub fn sort<E: Ord + Copy + Bounded>(list: &mut [E]) {
    match list.len() {
        0 | 1 => {}
        2 => {
            let (a, b) = (list[0], list[1]);
            (list[0], list[1]) = (a.min(b), a.max(b));
        }
        3 | 4 => padded::<E, 4>(list, &NETWORK_4),
        5..=8 => padded::<E, 8>(list, &NETWORK_8),
        9..=24 => insertion(list),
        _ => list.sort_unstable(),
    }
}

/// Optimal networks (Knuth, The Art of Computer Programming, volume 3, 5.3.4).
const NETWORK_4: [(usize, usize); 5] = [(0, 1), (2, 3), (0, 2), (1, 3), (1, 2)];
const NETWORK_8: [(usize, usize); 19] = [
    (0, 2),
    (1, 3),
    (4, 6),
    (5, 7),
    (0, 4),
    (1, 5),
    (2, 6),
    (3, 7),
    (0, 1),
    (2, 3),
    (4, 5),
    (6, 7),
    (2, 4),
    (3, 5),
    (1, 4),
    (3, 6),
    (1, 2),
    (3, 4),
    (5, 6),
];

/// Fills a copy up with what sorts last, and runs the network on it.
#[inline]
fn padded<E: Ord + Copy + Bounded, const N: usize>(list: &mut [E], network: &[(usize, usize)]) {
    let mut copy: [E; N] = std::array::from_fn(|i| list.get(i).copied().unwrap_or(E::MAX));
    for &(a, b) in network {
        (copy[a], copy[b]) = (copy[a].min(copy[b]), copy[a].max(copy[b]));
    }
    list.copy_from_slice(&copy[..list.len()]);
}

fn insertion<E: Ord + Copy>(list: &mut [E]) {
    for i in 1..list.len() {
        let entry = list[i];
        let mut j = i;
        while j > 0 && list[j - 1] > entry {
            list[j] = list[j - 1];
            j -= 1;
        }
        list[j] = entry;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_networks_sort_every_sequence_of_zeros_and_ones() {
        // By the 0–1 principle they then sort everything.
        for n in 0..=8_usize {
            for bits in 0..1_u64 << n {
                let mut list: Vec<u64> = (0..n).map(|i| bits >> i & 1).collect();
                sort(&mut list);
                assert!(list.is_sorted(), "{n} {bits:b}");
                assert_eq!(list.iter().sum::<u64>(), u64::from(bits.count_ones()));
            }
        }
    }

    #[test]
    fn longer_lists_are_sorted_too() {
        for n in 9..60_u64 {
            let mut list: Vec<u128> = (0..n).map(|i| u128::from(i * 7919 % 61)).collect();
            sort(&mut list);
            assert!(list.is_sorted(), "{n}");
        }
    }
}
