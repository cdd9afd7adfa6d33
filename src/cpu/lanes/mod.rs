//! The vector operations that setup and tiles are made of, in plain Rust and for AVX2.
//!
//! Both round alike: none contracts a product and a sum, and none is an approximation.

mod avx2;
mod plain;

use crate::real::Real;

#[cfg(target_arch = "x86_64")]
pub use avx2::Avx2;
pub use plain::Plain;

/// The instructions that loops are compiled for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Instructions {
    Any,
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Instructions {
    /// The best that this processor has.
    pub fn detected() -> Self {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            return Self::Avx2;
        }
        Self::Any
    }
}

/// Eight lanes of 32 bits, or four of 64. A value of such a type is the proof that its instructions are there.
pub trait Lanes: Copy {
    type I32: Copy;
    type F32: Copy;
    type I64: Copy;

    fn ints(self, values: [i32; 8]) -> Self::I32;
    fn splat_int(self, value: i32) -> Self::I32;
    /// Both wrap around.
    fn add_ints(self, a: Self::I32, b: Self::I32) -> Self::I32;
    fn mul_ints(self, a: Self::I32, b: Self::I32) -> Self::I32;
    fn or(self, a: Self::I32, b: Self::I32) -> Self::I32;
    /// Adds `step` to the numbers whose lane is not negative.
    fn count(self, numbers: &mut [u32; 8], lanes: Self::I32, step: i32);

    fn floats(self, values: [f32; 8]) -> Self::F32;
    /// Two of four.
    fn pair(self, a: [f32; 4], b: [f32; 4]) -> Self::F32;
    fn split(self, a: Self::F32) -> [[f32; 4]; 2];
    fn splat(self, value: f32) -> Self::F32;
    fn add(self, a: Self::F32, b: Self::F32) -> Self::F32;
    fn sub(self, a: Self::F32, b: Self::F32) -> Self::F32;
    fn mul(self, a: Self::F32, b: Self::F32) -> Self::F32;
    fn div(self, a: Self::F32, b: Self::F32) -> Self::F32;
    /// `Real::times_plus`.
    #[inline(always)]
    fn times_plus(self, a: Self::F32, b: Self::F32, c: Self::F32) -> Self::F32 {
        if cfg!(feature = "fma") {
            let (a, b, c) = (self.float_array(a), self.float_array(b), self.float_array(c));
            return self.floats(std::array::from_fn(|i| a[i].times_plus(b[i], c[i])));
        }
        self.add(self.mul(a, b), c)
    }
    /// `a` where it is less than `b`, else `b`: `Real::smaller` of `b` and `a`.
    fn min(self, a: Self::F32, b: Self::F32) -> Self::F32;
    /// `a` where it is greater than `b`, else `b`: `Real::larger` of `b` and `a`.
    fn max(self, a: Self::F32, b: Self::F32) -> Self::F32;
    /// `Real::clamped`: a NaN becomes `low`.
    #[inline(always)]
    fn clamped(self, a: Self::F32, low: Self::F32, high: Self::F32) -> Self::F32 {
        self.min(self.max(a, low), high)
    }
    fn abs(self, a: Self::F32) -> Self::F32;
    /// All bits set in the lanes where it is so.
    fn less(self, a: Self::F32, b: Self::F32) -> Self::I32;
    /// `a` in `lanes` that are all set, `b` in those that are 0.
    fn choose(self, lanes: Self::I32, a: Self::F32, b: Self::F32) -> Self::F32;
    /// Some lane is all set.
    fn any(self, lanes: Self::I32) -> bool;
    /// The caller has bounded the values.
    fn floor_to_ints(self, a: Self::F32) -> [i32; 8];
    /// `Real::inverse_binade`.
    fn inverse_binade(self, a: Self::F32) -> Self::F32;
    fn float_array(self, a: Self::F32) -> [f32; 8];
    fn int_array(self, a: Self::I32) -> [i32; 8];
    fn greater_ints(self, a: Self::I32, b: Self::I32) -> Self::I32;
    fn choose_ints(self, lanes: Self::I32, a: Self::I32, b: Self::I32) -> Self::I32;
    fn xor(self, a: Self::I32, b: Self::I32) -> Self::I32;
    /// The fourth of each four, in all of them.
    fn fourth(self, a: Self::F32) -> Self::F32;
    /// With 1 as the fourth of each four.
    fn with_one(self, a: Self::F32) -> Self::F32;

    /// Bits whose signed order is the order of the values; −0 counts as +0.
    fn orderable(self, a: Self::F32) -> Self::I32;
    fn not(self, a: Self::I32) -> Self::I32;
    /// Writes `high` above `low`, one integer a lane, to these places.
    ///
    /// # Safety
    /// All must be places in `values`.
    unsafe fn scatter(self, values: &mut [i64], places: &[u32; 8], high: Self::I32, low: Self::I32);

    fn longs(self, values: [i64; 4]) -> Self::I64;
    fn long_array(self, a: Self::I64) -> [i64; 4];
    /// Where `numbers` is greater than k, `values`, else `otherwise`.
    fn where_greater(self, numbers: Self::I64, k: i64, values: Self::I64, otherwise: Self::I64) -> Self::I64;
    /// The lesser and the greater of each two.
    fn ordered(self, a: Self::I64, b: Self::I64) -> (Self::I64, Self::I64);
}
