//! Sorting one pixel's list (GPU Pro 2, section 2.6.3). All strategies give the same order; `auto` is networks of
//! compare-exchanges, which have no branches to mispredict, for lists of up to eight (most pixels of most
//! scenes have no more), then insertion, then the standard library's.

use crate::frame::Sort;
use crate::real::Bounded;

/// Sorts ascending.
#[inline]
pub fn sort<E: Ord + Copy + Bounded>(strategy: Sort, list: &mut [E]) {
    match strategy {
        Sort::Auto => auto(list),
        Sort::Insertion => insertion(list),
        Sort::Selection => selection(list),
        Sort::Bitonic => bitonic(list),
        Sort::Merge => merge(list),
        Sort::Heap => heap(list),
    }
}

#[inline]
fn auto<E: Ord + Copy + Bounded>(list: &mut [E]) {
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

fn selection<E: Ord + Copy>(list: &mut [E]) {
    for i in 0..list.len() {
        if let Some(least) = (i..list.len()).min_by_key(|&j| list[j]) {
            list.swap(i, least);
        }
    }
}

/// Batcher's bitonic network for any length: what lies past the end counts as greatest, and never moves, since
/// each merge begins by reversing its second half.
fn bitonic<E: Ord + Copy>(list: &mut [E]) {
    let n = list.len();
    let mut size = 2;
    while size / 2 < n {
        let mut exchange = |i: usize, j: usize| {
            if i < j && j < n {
                (list[i], list[j]) = (list[i].min(list[j]), list[i].max(list[j]));
            }
        };
        for i in 0..n {
            exchange(i, i ^ (size - 1));
        }
        let mut step = size / 4;
        while step > 0 {
            for i in 0..n {
                exchange(i, i ^ step);
            }
            step /= 2;
        }
        size *= 2;
    }
}

/// Bottom up, between the list and a copy of it.
fn merge<E: Ord + Copy>(list: &mut [E]) {
    let n = list.len();
    let mut copy = list.to_vec();
    let mut width = 1;
    while width < n {
        for first in (0..n).step_by(2 * width) {
            let (middle, end) = ((first + width).min(n), (first + 2 * width).min(n));
            let (mut a, mut b) = (first, middle);
            for out in &mut copy[first..end] {
                let left = b == end || (a < middle && list[a] <= list[b]);
                *out = list[if left { a } else { b }];
                if left { a += 1 } else { b += 1 }
            }
        }
        list.copy_from_slice(&copy);
        width *= 2;
    }
}

fn heap<E: Ord + Copy>(list: &mut [E]) {
    let sift = |list: &mut [E], mut root: usize| loop {
        let mut child = 2 * root + 1;
        if child >= list.len() {
            return;
        }
        if child + 1 < list.len() && list[child] < list[child + 1] {
            child += 1;
        }
        if list[root] >= list[child] {
            return;
        }
        list.swap(root, child);
        root = child;
    };
    (0..list.len() / 2).rev().for_each(|root| sift(list, root));
    for end in (1..list.len()).rev() {
        list.swap(0, end);
        sift(&mut list[..end], 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Sort; 6] =
        [Sort::Auto, Sort::Insertion, Sort::Selection, Sort::Bitonic, Sort::Merge, Sort::Heap];

    #[test]
    fn every_strategy_sorts_every_sequence_of_zeros_and_ones() {
        // By the 0–1 principle the networks then sort everything.
        for strategy in ALL {
            for n in 0..=11_usize {
                for bits in 0..1_u64 << n {
                    let mut list: Vec<u64> = (0..n).map(|i| bits >> i & 1).collect();
                    sort(strategy, &mut list);
                    assert!(list.is_sorted(), "{strategy:?} {n} {bits:b}");
                    assert_eq!(list.iter().sum::<u64>(), u64::from(bits.count_ones()));
                }
            }
        }
    }

    #[test]
    fn longer_lists_are_sorted_too() {
        for strategy in ALL {
            for n in 9..130_u64 {
                let given: Vec<u128> = (0..n).map(|i| u128::from(i * 7919 % 61)).collect();
                let mut list = given.clone();
                sort(strategy, &mut list);
                let mut wanted = given;
                wanted.sort_unstable();
                assert_eq!(list, wanted, "{strategy:?} {n}");
            }
        }
    }
}
