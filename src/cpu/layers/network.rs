//! Sorting four pixels' lists at once, a lane each: networks of compare-exchanges, which take the same steps
//! whatever the lists hold. All are Batcher's merge exchange, which knows any length (Knuth, The Art of Computer
//! Programming, volume 3, 5.2.2, algorithm M): up to 8 entries none has fewer steps, at 16 it takes 63 where 60 are known.

use crate::cpu::lanes::Lanes;

/// Pixels that are sorted together.
pub const QUAD: usize = 4;
/// The longest lists that are sorted in registers.
pub const LONGEST: usize = 16;
/// Steps for `LONGEST` entries, and one.
const MOST_STEPS: usize = 64;

/// Steps of the network for `n` entries: pairs to be put in order. The rest are pairs of one entry with itself.
const fn steps(n: usize) -> [(usize, usize); MOST_STEPS] {
    let mut steps = [(0, 0); MOST_STEPS];
    let (mut count, top) = (0, n.next_power_of_two() / 2);
    let mut p = top;
    while p > 0 {
        let (mut q, mut r, mut d) = (top, 0, p);
        loop {
            let mut i = 0;
            while i + d < n {
                if i & p == r {
                    steps[count] = (i, i + d);
                    count += 1;
                }
                i += 1;
            }
            if q == p {
                break;
            }
            (d, q, r) = (q - p, q / 2, p);
        }
        p /= 2;
    }
    steps
}

struct Network<const N: usize>;
impl<const N: usize> Network<N> {
    const STEPS: [(usize, usize); MOST_STEPS] = steps(N);
}

/// Writes every step out, so that indices are constants and lists stay in registers.
macro_rules! every_step {
    ($v:ident, $list:ident, $network:ty, $($step:literal)*) => {
        $(
            let (i, j) = <$network>::STEPS[$step];
            if i != j {
                ($list[i], $list[j]) = $v.ordered($list[i], $list[j]);
            }
        )*
    };
}

/// Sorts lists of N entries.
#[inline(always)]
pub fn sort<V: Lanes, const N: usize>(v: V, list: &mut [V::I64; N]) {
    const { assert!(N <= LONGEST) }
    every_step!(v, list, Network<N>,
        0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31
        32 33 34 35 36 37 38 39 40 41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59 60 61 62 63);
}

/// Sorts lists of any length, in memory.
#[inline(always)]
pub fn sort_long<V: Lanes>(v: V, list: &mut [[i64; QUAD]]) {
    let n = list.len();
    let top = n.next_power_of_two() / 2;
    let mut p = top;
    while p > 0 {
        let (mut q, mut r, mut d) = (top, 0, p);
        loop {
            // Blocks of p whose bit p is as r has it.
            let mut block = r;
            while block + d < n {
                for i in block..(block + p).min(n - d) {
                    let (a, b) = v.ordered(v.longs(list[i]), v.longs(list[i + d]));
                    (list[i], list[i + d]) = (v.long_array(a), v.long_array(b));
                }
                block += 2 * p;
            }
            if q == p {
                break;
            }
            (d, q, r) = (q - p, q / 2, p);
        }
        p /= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::lanes::Plain;

    /// By the 0–1 principle a network that sorts all zeros and ones sorts everything.
    fn all_sequences<const N: usize>() {
        for bits in 0..1_u32 << N {
            let given: [[i64; QUAD]; N] = std::array::from_fn(|i| {
                std::array::from_fn(|l| i64::from(bits.rotate_left(l as u32) >> i & 1))
            });
            let (mut short, mut long) = (given, given);
            sort(Plain, &mut short);
            sort_long(Plain, &mut long);
            assert_eq!(short, long);
            for l in 0..QUAD {
                let lane = short.map(|quad| quad[l]);
                assert!(lane.is_sorted(), "{N} {bits:b}");
                assert_eq!(lane.iter().sum::<i64>(), given.iter().map(|quad| quad[l]).sum::<i64>());
            }
        }
    }

    #[test]
    fn every_network_sorts_every_sequence_of_zeros_and_ones() {
        all_sequences::<1>();
        all_sequences::<2>();
        all_sequences::<3>();
        all_sequences::<4>();
        all_sequences::<5>();
        all_sequences::<6>();
        all_sequences::<7>();
        all_sequences::<8>();
        all_sequences::<9>();
        all_sequences::<10>();
        all_sequences::<11>();
        all_sequences::<12>();
        all_sequences::<13>();
        all_sequences::<14>();
        all_sequences::<15>();
        all_sequences::<16>();
    }

    #[test]
    fn longer_lists_are_sorted_lane_by_lane() {
        for n in 17..256_i64 {
            let mut list: Vec<[i64; QUAD]> =
                (0..n).map(|i| std::array::from_fn(|l| (i * 7919 + l as i64) % 61 - 30)).collect();
            let mut wanted: [Vec<i64>; QUAD] =
                std::array::from_fn(|l| list.iter().map(|quad| quad[l]).collect());
            wanted.iter_mut().for_each(|lane| lane.sort_unstable());
            sort_long(Plain, &mut list);
            for (l, lane) in wanted.iter().enumerate() {
                assert!(list.iter().map(|quad| quad[l]).eq(lane.iter().copied()), "{n}");
            }
        }
    }
}
