//! The lanes in AVX2's registers.
#![cfg(target_arch = "x86_64")]

use std::arch::x86_64::*;

use super::Lanes;

/// Proof that the processor has AVX2.
#[derive(Debug, Clone, Copy)]
pub struct Avx2(());

impl Avx2 {
    /// # Safety
    /// The processor must have AVX2.
    pub unsafe fn new() -> Self {
        Self(())
    }
}

/// One or more intrinsics that need AVX2, of which the receiver is the proof.
macro_rules! avx2 {
    ($body:expr) => {
        // SAFETY: an `Avx2` exists only where the processor has AVX2, and that is all that these intrinsics ask for;
        // what they load and store are whole arrays of the vector's size.
        unsafe { $body }
    };
}

impl Lanes for Avx2 {
    type I32 = __m256i;
    type F32 = __m256;
    type I64 = __m256i;

    #[inline(always)]
    fn ints(self, values: [i32; 8]) -> __m256i {
        avx2!(_mm256_loadu_si256(values.as_ptr().cast()))
    }
    #[inline(always)]
    fn splat_int(self, value: i32) -> __m256i {
        avx2!(_mm256_set1_epi32(value))
    }
    #[inline(always)]
    fn add_ints(self, a: __m256i, b: __m256i) -> __m256i {
        avx2!(_mm256_add_epi32(a, b))
    }
    #[inline(always)]
    fn mul_ints(self, a: __m256i, b: __m256i) -> __m256i {
        avx2!(_mm256_mullo_epi32(a, b))
    }
    #[inline(always)]
    fn or(self, a: __m256i, b: __m256i) -> __m256i {
        avx2!(_mm256_or_si256(a, b))
    }
    #[inline(always)]
    fn count(self, numbers: &mut [u32; 8], lanes: __m256i, step: i32) {
        avx2!({
            let step = _mm256_andnot_si256(_mm256_srai_epi32::<31>(lanes), _mm256_set1_epi32(step));
            let sum = _mm256_add_epi32(_mm256_loadu_si256(numbers.as_ptr().cast()), step);
            _mm256_storeu_si256(numbers.as_mut_ptr().cast(), sum);
        })
    }
    #[inline(always)]
    fn floats(self, values: [f32; 8]) -> __m256 {
        avx2!(_mm256_loadu_ps(values.as_ptr()))
    }
    #[inline(always)]
    fn pair(self, a: [f32; 4], b: [f32; 4]) -> __m256 {
        avx2!(_mm256_set_m128(_mm_loadu_ps(b.as_ptr()), _mm_loadu_ps(a.as_ptr())))
    }
    #[inline(always)]
    fn split(self, a: __m256) -> [[f32; 4]; 2] {
        let mut halves = [[0.0; 4]; 2];
        avx2!(_mm256_storeu_ps(halves.as_mut_ptr().cast(), a));
        halves
    }
    #[inline(always)]
    fn splat(self, value: f32) -> __m256 {
        avx2!(_mm256_set1_ps(value))
    }
    #[inline(always)]
    fn add(self, a: __m256, b: __m256) -> __m256 {
        avx2!(_mm256_add_ps(a, b))
    }
    #[inline(always)]
    fn sub(self, a: __m256, b: __m256) -> __m256 {
        avx2!(_mm256_sub_ps(a, b))
    }
    #[inline(always)]
    fn mul(self, a: __m256, b: __m256) -> __m256 {
        avx2!(_mm256_mul_ps(a, b))
    }
    #[inline(always)]
    fn div(self, a: __m256, b: __m256) -> __m256 {
        avx2!(_mm256_div_ps(a, b))
    }
    // These two give their second operand where either is a NaN, or both are zeros.
    #[inline(always)]
    fn min(self, a: __m256, b: __m256) -> __m256 {
        avx2!(_mm256_min_ps(a, b))
    }
    #[inline(always)]
    fn max(self, a: __m256, b: __m256) -> __m256 {
        avx2!(_mm256_max_ps(a, b))
    }
    #[inline(always)]
    fn abs(self, a: __m256) -> __m256 {
        avx2!(_mm256_andnot_ps(_mm256_set1_ps(-0.0), a))
    }
    #[inline(always)]
    fn less(self, a: __m256, b: __m256) -> __m256i {
        avx2!(_mm256_castps_si256(_mm256_cmp_ps::<_CMP_LT_OQ>(a, b)))
    }
    #[inline(always)]
    fn choose(self, lanes: __m256i, a: __m256, b: __m256) -> __m256 {
        avx2!(_mm256_blendv_ps(b, a, _mm256_castsi256_ps(lanes)))
    }
    #[inline(always)]
    fn any(self, lanes: __m256i) -> bool {
        avx2!(_mm256_movemask_epi8(lanes) != 0)
    }
    #[inline(always)]
    fn floor_to_ints(self, a: __m256) -> [i32; 8] {
        self.int_array(avx2!(_mm256_cvttps_epi32(_mm256_floor_ps(a))))
    }
    #[inline(always)]
    fn inverse_binade(self, a: __m256) -> __m256 {
        avx2!({
            let exponent = _mm256_srli_epi32::<23>(_mm256_castps_si256(self.abs(a)));
            let exponent = _mm256_min_epi32(exponent, _mm256_set1_epi32(2 * 127 - 1));
            let inverse = _mm256_sub_epi32(_mm256_set1_epi32(2 * 127), exponent);
            _mm256_castsi256_ps(_mm256_slli_epi32::<23>(inverse))
        })
    }
    #[inline(always)]
    fn float_array(self, a: __m256) -> [f32; 8] {
        let mut values = [0.0; 8];
        avx2!(_mm256_storeu_ps(values.as_mut_ptr(), a));
        values
    }
    #[inline(always)]
    fn int_array(self, a: __m256i) -> [i32; 8] {
        let mut values = [0; 8];
        avx2!(_mm256_storeu_si256(values.as_mut_ptr().cast(), a));
        values
    }
    #[inline(always)]
    fn greater_ints(self, a: __m256i, b: __m256i) -> __m256i {
        avx2!(_mm256_cmpgt_epi32(a, b))
    }
    #[inline(always)]
    fn choose_ints(self, lanes: __m256i, a: __m256i, b: __m256i) -> __m256i {
        avx2!(_mm256_blendv_epi8(b, a, lanes))
    }
    #[inline(always)]
    fn xor(self, a: __m256i, b: __m256i) -> __m256i {
        avx2!(_mm256_xor_si256(a, b))
    }
    #[inline(always)]
    fn fourth(self, a: __m256) -> __m256 {
        avx2!(_mm256_permute_ps::<0xff>(a))
    }
    #[inline(always)]
    fn with_one(self, a: __m256) -> __m256 {
        avx2!(_mm256_blend_ps::<0x88>(a, _mm256_set1_ps(1.0)))
    }
    #[inline(always)]
    fn orderable(self, a: __m256) -> __m256i {
        avx2!({
            let bits = _mm256_castps_si256(_mm256_add_ps(a, _mm256_setzero_ps())); // −0 + 0 = +0
            let negative = _mm256_srai_epi32::<31>(bits);
            _mm256_xor_si256(bits, _mm256_srli_epi32::<1>(negative))
        })
    }
    #[inline(always)]
    fn not(self, a: __m256i) -> __m256i {
        avx2!(_mm256_xor_si256(a, _mm256_set1_epi32(-1)))
    }
    #[inline(always)]
    unsafe fn scatter(self, values: &mut [i64], places: &[u32; 8], high: __m256i, low: __m256i) {
        let at = values.as_mut_ptr();
        // SAFETY: for the instructions as everywhere here; the caller promises that the places are in `values`.
        unsafe {
            // Of each half of the register the first two, and the last two.
            let (first, last) = (_mm256_unpacklo_epi32(low, high), _mm256_unpackhi_epi32(low, high));
            let pairs = [
                _mm256_castsi256_pd(first),
                _mm256_castsi256_pd(last),
                _mm256_castpd128_pd256(_mm256_extractf128_pd::<1>(_mm256_castsi256_pd(first))),
                _mm256_castpd128_pd256(_mm256_extractf128_pd::<1>(_mm256_castsi256_pd(last))),
            ];
            for i in 0..4 {
                let pair = _mm256_castpd256_pd128(pairs[i]);
                _mm_storel_pd(at.add(places[2 * i] as usize).cast(), pair);
                _mm_storeh_pd(at.add(places[2 * i + 1] as usize).cast(), pair);
            }
        }
    }
    #[inline(always)]
    fn longs(self, values: [i64; 4]) -> __m256i {
        avx2!(_mm256_loadu_si256(values.as_ptr().cast()))
    }
    #[inline(always)]
    fn long_array(self, a: __m256i) -> [i64; 4] {
        let mut values = [0; 4];
        avx2!(_mm256_storeu_si256(values.as_mut_ptr().cast(), a));
        values
    }
    #[inline(always)]
    fn where_greater(self, numbers: __m256i, k: i64, values: __m256i, otherwise: __m256i) -> __m256i {
        avx2!({
            let greater = _mm256_cmpgt_epi64(numbers, _mm256_set1_epi64x(k));
            _mm256_blendv_epi8(otherwise, values, greater)
        })
    }
    #[inline(always)]
    fn ordered(self, a: __m256i, b: __m256i) -> (__m256i, __m256i) {
        avx2!({
            let swap = _mm256_cmpgt_epi64(a, b);
            (_mm256_blendv_epi8(a, b, swap), _mm256_blendv_epi8(b, a, swap))
        })
    }
}
