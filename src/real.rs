//! The two precisions of the CPU pipeline, from one generic source, and the sort key made from a depth.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// `f32` or `f64`: the arithmetic that a pipeline needs, and the unsigned integer of the same size
/// that orders it.
pub trait Real:
    Copy
    + Send
    + Sync
    + PartialOrd
    + PartialEq
    + Default
    + std::fmt::Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + 'static
{
    type Key: Copy + Ord + Send + Sync + Default + std::fmt::Debug + 'static;
    /// A key and a rank in one integer, ordered by the key first: one comparison sorts by both.
    type Entry: Copy + Ord + Bounded + Send + Sync + Default + std::fmt::Debug + 'static;
    const ZERO: Self;
    const ONE: Self;
    const NAN: Self;
    const MAX_KEY: Self::Key;

    fn from_f64(value: f64) -> Self;
    fn to_f64(self) -> f64;
    fn from_i32(value: i32) -> Self;
    /// `floor(self)` as an integer; the caller has bounded the value.
    fn floor_to_i32(self) -> i32;
    fn is_finite(self) -> bool;
    /// Bits whose unsigned order is the order of the values; −0 counts as +0, so that they tie.
    fn orderable(self) -> Self::Key;
    fn from_orderable(key: Self::Key) -> Self;
    fn entry(key: Self::Key, rank: u32) -> Self::Entry;
    fn key_of(entry: Self::Entry) -> Self::Key;
    fn rank_of(entry: Self::Entry) -> u32;
    /// The key in reverse order.
    fn reversed(key: Self::Key) -> Self::Key;

    fn clamped(self, low: Self, high: Self) -> Self {
        // Two comparisons, not `clamp`: a NaN cannot reach this point, and these become min and max.
        let v = if self < low { low } else { self };
        if v > high { high } else { v }
    }
    fn smaller(self, other: Self) -> Self {
        if other < self { other } else { self }
    }
    fn larger(self, other: Self) -> Self {
        if other > self { other } else { self }
    }
}

/// An integer with a largest value, which sorts after every entry.
pub trait Bounded {
    const MAX: Self;
}
impl Bounded for u64 {
    const MAX: Self = Self::MAX;
}
impl Bounded for u128 {
    const MAX: Self = Self::MAX;
}

macro_rules! impl_real {
    ($float:ty, $key:ty, $entry:ty, $sign:expr) => {
        impl Real for $float {
            type Key = $key;
            type Entry = $entry;
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const NAN: Self = <$float>::NAN;
            const MAX_KEY: $key = <$key>::MAX;

            #[inline]
            fn from_f64(value: f64) -> Self {
                value as $float
            }
            #[inline]
            fn to_f64(self) -> f64 {
                self as f64
            }
            #[inline]
            fn from_i32(value: i32) -> Self {
                value as $float
            }
            #[inline]
            fn floor_to_i32(self) -> i32 {
                self.floor() as i32
            }
            #[inline]
            fn is_finite(self) -> bool {
                <$float>::is_finite(self)
            }
            #[inline]
            fn orderable(self) -> $key {
                let bits = (self + 0.0).to_bits(); // −0 + 0 = +0
                if bits & $sign == 0 { bits | $sign } else { !bits }
            }
            #[inline]
            fn from_orderable(key: $key) -> Self {
                <$float>::from_bits(if key & $sign == 0 { !key } else { key & !$sign })
            }
            #[inline]
            fn entry(key: $key, rank: u32) -> $entry {
                <$entry>::from(key) << 32 | <$entry>::from(rank)
            }
            #[inline]
            fn key_of(entry: $entry) -> $key {
                (entry >> 32) as $key
            }
            #[inline]
            fn rank_of(entry: $entry) -> u32 {
                entry as u32
            }
            #[inline]
            fn reversed(key: $key) -> $key {
                !key
            }
        }
    };
}
impl_real!(f32, u32, u64, 0x8000_0000_u32);
impl_real!(f64, u64, u128, 0x8000_0000_0000_0000_u64);

/// The sort key of a fragment: smaller is in front.
///
/// Under a perspective it is made from 1/w, which is linear on the screen and larger when nearer;
/// otherwise from the eye depth itself.
#[inline]
pub fn sort_key<T: Real>(plane_value: T, perspective: bool) -> T::Key {
    if perspective { T::reversed(plane_value.orderable()) } else { plane_value.orderable() }
}

/// The eye depth that a sort key stands for.
#[inline]
pub fn depth_of_key<T: Real>(key: T::Key, perspective: bool) -> T {
    if perspective { T::ONE / T::from_orderable(T::reversed(key)) } else { T::from_orderable(key) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_order_like_the_values_they_are_made_from() {
        let values = [-1e30_f32, -2.0, -1e-40, 0.0, 1e-45, 1e-3, 1.0, 7e37];
        for pair in values.windows(2) {
            assert!(pair[0].orderable() < pair[1].orderable(), "{pair:?}");
            assert_eq!(f32::from_orderable(pair[0].orderable()), pair[0]);
        }
        assert_eq!((-0.0_f64).orderable(), 0.0_f64.orderable());
    }

    #[test]
    fn nearer_fragments_have_smaller_keys_in_both_projections() {
        assert!(sort_key(1.0_f64 / 2.0, true) < sort_key(1.0_f64 / 3.0, true));
        assert!(sort_key(2.0_f64, false) < sort_key(3.0_f64, false));
        assert_eq!(depth_of_key::<f64>(sort_key(0.25, true), true), 4.0);
        assert_eq!(depth_of_key::<f64>(sort_key(-4.0, false), false), -4.0);
    }
}
