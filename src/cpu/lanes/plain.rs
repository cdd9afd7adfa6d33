//! The lanes in arrays, for any processor.

use super::Lanes;
use crate::real::Real;

/// Lanes that need no proof.
#[derive(Debug, Clone, Copy)]
pub struct Plain;

impl Lanes for Plain {
    type I32 = [i32; 8];
    type F32 = [f32; 8];
    type I64 = [i64; 4];

    #[inline(always)]
    fn ints(self, values: [i32; 8]) -> [i32; 8] {
        values
    }
    #[inline(always)]
    fn splat_int(self, value: i32) -> [i32; 8] {
        [value; 8]
    }
    #[inline(always)]
    fn add_ints(self, a: [i32; 8], b: [i32; 8]) -> [i32; 8] {
        std::array::from_fn(|i| a[i].wrapping_add(b[i]))
    }
    #[inline(always)]
    fn mul_ints(self, a: [i32; 8], b: [i32; 8]) -> [i32; 8] {
        std::array::from_fn(|i| a[i].wrapping_mul(b[i]))
    }
    #[inline(always)]
    fn or(self, a: [i32; 8], b: [i32; 8]) -> [i32; 8] {
        std::array::from_fn(|i| a[i] | b[i])
    }
    #[inline(always)]
    fn count(self, numbers: &mut [u32; 8], lanes: [i32; 8], step: i32) {
        for (number, lane) in numbers.iter_mut().zip(lanes) {
            *number += (!(lane >> 31) & step) as u32;
        }
    }
    #[inline(always)]
    fn floats(self, values: [f32; 8]) -> [f32; 8] {
        values
    }
    #[inline(always)]
    fn pair(self, a: [f32; 4], b: [f32; 4]) -> [f32; 8] {
        [a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3]]
    }
    #[inline(always)]
    fn split(self, a: [f32; 8]) -> [[f32; 4]; 2] {
        [[a[0], a[1], a[2], a[3]], [a[4], a[5], a[6], a[7]]]
    }
    #[inline(always)]
    fn splat(self, value: f32) -> [f32; 8] {
        [value; 8]
    }
    #[inline(always)]
    fn add(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        std::array::from_fn(|i| a[i] + b[i])
    }
    #[inline(always)]
    fn sub(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        std::array::from_fn(|i| a[i] - b[i])
    }
    #[inline(always)]
    fn mul(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        std::array::from_fn(|i| a[i] * b[i])
    }
    #[inline(always)]
    fn div(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        std::array::from_fn(|i| a[i] / b[i])
    }
    #[inline(always)]
    fn min(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        std::array::from_fn(|i| b[i].smaller(a[i]))
    }
    #[inline(always)]
    fn max(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        std::array::from_fn(|i| b[i].larger(a[i]))
    }
    #[inline(always)]
    fn abs(self, a: [f32; 8]) -> [f32; 8] {
        a.map(f32::abs)
    }
    #[inline(always)]
    fn less(self, a: [f32; 8], b: [f32; 8]) -> [i32; 8] {
        std::array::from_fn(|i| -i32::from(a[i] < b[i]))
    }
    #[inline(always)]
    fn choose(self, lanes: [i32; 8], a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        std::array::from_fn(|i| if lanes[i] < 0 { a[i] } else { b[i] })
    }
    #[inline(always)]
    fn any(self, lanes: [i32; 8]) -> bool {
        lanes.iter().any(|&lane| lane != 0)
    }
    #[inline(always)]
    fn floor_to_ints(self, a: [f32; 8]) -> [i32; 8] {
        a.map(Real::floor_to_i32)
    }
    #[inline(always)]
    fn inverse_binade(self, a: [f32; 8]) -> [f32; 8] {
        a.map(Real::inverse_binade)
    }
    #[inline(always)]
    fn float_array(self, a: [f32; 8]) -> [f32; 8] {
        a
    }
    #[inline(always)]
    fn int_array(self, a: [i32; 8]) -> [i32; 8] {
        a
    }
    #[inline(always)]
    fn greater_ints(self, a: [i32; 8], b: [i32; 8]) -> [i32; 8] {
        std::array::from_fn(|i| -i32::from(a[i] > b[i]))
    }
    #[inline(always)]
    fn choose_ints(self, lanes: [i32; 8], a: [i32; 8], b: [i32; 8]) -> [i32; 8] {
        std::array::from_fn(|i| if lanes[i] < 0 { a[i] } else { b[i] })
    }
    #[inline(always)]
    fn xor(self, a: [i32; 8], b: [i32; 8]) -> [i32; 8] {
        std::array::from_fn(|i| a[i] ^ b[i])
    }
    #[inline(always)]
    fn fourth(self, a: [f32; 8]) -> [f32; 8] {
        std::array::from_fn(|i| a[i | 3])
    }
    #[inline(always)]
    fn with_one(self, a: [f32; 8]) -> [f32; 8] {
        std::array::from_fn(|i| if i % 4 == 3 { 1.0 } else { a[i] })
    }
    #[inline(always)]
    fn orderable(self, a: [f32; 8]) -> [i32; 8] {
        a.map(|v| {
            let bits = (v + 0.0).to_bits() as i32; // −0 + 0 = +0
            bits ^ ((bits >> 31) & i32::MAX)
        })
    }
    #[inline(always)]
    fn not(self, a: [i32; 8]) -> [i32; 8] {
        a.map(|v| !v)
    }
    #[inline(always)]
    unsafe fn scatter(self, values: &mut [i64], places: &[u32; 8], high: [i32; 8], low: [i32; 8]) {
        for i in 0..8 {
            values[places[i] as usize] = i64::from(high[i]) << 32 | i64::from(low[i] as u32);
        }
    }
    #[inline(always)]
    fn longs(self, values: [i64; 4]) -> [i64; 4] {
        values
    }
    #[inline(always)]
    fn long_array(self, a: [i64; 4]) -> [i64; 4] {
        a
    }
    #[inline(always)]
    fn where_greater(self, numbers: [i64; 4], k: i64, values: [i64; 4], otherwise: [i64; 4]) -> [i64; 4] {
        std::array::from_fn(|l| if numbers[l] > k { values[l] } else { otherwise[l] })
    }
    #[inline(always)]
    fn ordered(self, a: [i64; 4], b: [i64; 4]) -> ([i64; 4], [i64; 4]) {
        (std::array::from_fn(|l| a[l].min(b[l])), std::array::from_fn(|l| a[l].max(b[l])))
    }
}
