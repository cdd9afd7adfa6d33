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
    + bytemuck::Pod
    + 'static
{
    type Key: Copy + Ord + Send + Sync + Default + bytemuck::Zeroable + std::fmt::Debug + 'static;
    /// A key and a rank in one integer, ordered by the key first: one comparison sorts by both.
    type Entry: Copy + Ord + Bounded + Send + Sync + Default + std::fmt::Debug + 'static;
    const ZERO: Self;
    const ONE: Self;
    const NAN: Self;
    const MAX_KEY: Self::Key;

    fn from_f64(value: f64) -> Self;
    /// position − center, as the devices of this precision compute it.
    fn relative(position: f64, center: f64) -> Self;
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

    /// self · b + c, of what is not promised to the bit: with feature `fma`, rounded once.
    fn times_plus(self, b: Self, c: Self) -> Self;
    fn abs(self) -> Self;
    fn sqrt(self) -> Self;
    fn exp(self) -> Self;
    fn exp_m1(self) -> Self;
    fn ln(self) -> Self;
    fn ln_1p(self) -> Self;
    fn sin_cos(self) -> (Self, Self);
    /// The power of two that brings a positive value into [1, 2), as far as it is a normal number itself.
    fn inverse_binade(self) -> Self;

    /// Comparisons that become min and max, and turn a NaN (of two infinities, on a sliver) into `low`.
    fn clamped(self, low: Self, high: Self) -> Self {
        let v = if self > low { self } else { low };
        if v < high { v } else { high }
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
    ($float:ty, $key:ty, $entry:ty, $sign:expr, $bias:expr, $relative:expr) => {
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
            fn relative(position: f64, center: f64) -> Self {
                $relative(position, center)
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
            #[inline(always)]
            fn times_plus(self, b: Self, c: Self) -> Self {
                if cfg!(feature = "fma") { self.mul_add(b, c) } else { self * b + c }
            }
            #[inline]
            fn abs(self) -> Self {
                <$float>::abs(self)
            }
            #[inline]
            fn sqrt(self) -> Self {
                <$float>::sqrt(self)
            }
            #[inline]
            fn exp(self) -> Self {
                <$float>::exp(self)
            }
            #[inline]
            fn exp_m1(self) -> Self {
                <$float>::exp_m1(self)
            }
            #[inline]
            fn ln(self) -> Self {
                <$float>::ln(self)
            }
            #[inline]
            fn ln_1p(self) -> Self {
                <$float>::ln_1p(self)
            }
            #[inline]
            fn sin_cos(self) -> (Self, Self) {
                <$float>::sin_cos(self)
            }
            #[inline]
            fn inverse_binade(self) -> Self {
                let shift = <$float>::MANTISSA_DIGITS - 1;
                let exponent = (self.to_bits() & !$sign) >> shift;
                // 2^(e − bias) has the exponent field e; its inverse has 2·bias − e.
                <$float>::from_bits((2 * $bias - exponent.min(2 * $bias - 1)) << shift)
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
impl_real!(f32, u32, u64, 0x8000_0000_u32, 127, relative_f32);
impl_real!(f64, u64, u128, 0x8000_0000_0000_0000_u64, 1023, std::ops::Sub::sub);

/// A double as a float and what that leaves: 48 bits.
pub fn split(value: f64) -> (f32, f32) {
    let high = value as f32;
    let rest = (value - f64::from(high)) as f32;
    (high, if high.is_finite() { rest } else { 0.0 })
}

/// With one rounding of the difference, in floats alone, so that every device gives the same bits: Knuth's two-sum
/// keeps what the first difference loses (shaders/tiles/setup.wgsl).
fn relative_f32(position: f64, center: f64) -> f32 {
    let ((high, rest), (center, center_rest)) = (split(position), split(center));
    let sum = high - center;
    let shadow = sum - high;
    let lost = (high - (sum - shadow)) + (-center - shadow);
    sum + (lost + (rest - center_rest))
}

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
    fn inverse_binades_are_powers_of_two_and_never_zero_or_infinite() {
        for v in [1.0_f32, 1.99, 3e-38, 1e38, f32::MAX, 0.0, 1e-45] {
            let inverse = v.inverse_binade();
            assert!(inverse.is_normal() && inverse.to_bits() & 0x7f_ffff == 0, "{v}");
        }
        assert_eq!(6.5_f64.inverse_binade(), 0.25);
        assert_eq!((0.3_f32).inverse_binade(), 4.0);
    }

    #[test]
    fn a_nan_is_clamped_into_the_range() {
        assert_eq!(f32::NAN.clamped(1.0, 2.0), 1.0);
        assert_eq!([0.5_f32, 1.5, 9.0].map(|v| v.clamped(1.0, 2.0)), [1.0, 1.5, 2.0]);
    }

    #[test]
    fn nearer_fragments_have_smaller_keys_in_both_projections() {
        assert!(sort_key(1.0_f64 / 2.0, true) < sort_key(1.0_f64 / 3.0, true));
        assert!(sort_key(2.0_f64, false) < sort_key(3.0_f64, false));
        assert_eq!(depth_of_key::<f64>(sort_key(0.25, true), true), 4.0);
        assert_eq!(depth_of_key::<f64>(sort_key(-4.0, false), false), -4.0);
    }
}
