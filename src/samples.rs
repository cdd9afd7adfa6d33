//! Where a pixel's samples lie: the standard patterns that Vulkan and Direct3D share.

use crate::error::{Error, Result};

/// Offsets from the pixel's centre, right and down, in 1/16 pixel. Sample s is bit s of a coverage mask.
pub type Offset = (i32, i32);

static ONE: [Offset; 1] = [(0, 0)];
static TWO: [Offset; 2] = [(4, 4), (-4, -4)];
static FOUR: [Offset; 4] = [(-2, -6), (6, -2), (-6, 2), (2, 6)];
static EIGHT: [Offset; 8] = [(1, -3), (-1, 3), (5, 1), (-3, -5), (-5, 5), (-7, -1), (3, 7), (7, -7)];
static SIXTEEN: [Offset; 16] = [
    (1, 1),
    (-1, -3),
    (-3, 2),
    (4, -1),
    (-5, -2),
    (2, 5),
    (5, 3),
    (3, -5),
    (-2, 6),
    (0, -7),
    (-4, -6),
    (-6, 4),
    (-8, 0),
    (7, -4),
    (6, 7),
    (-7, -8),
];

/// The sample counts that there are patterns for.
pub const COUNTS: [u32; 5] = [1, 2, 4, 8, 16];
pub const MAX_SAMPLES: usize = 16;

pub fn check_samples(samples: u32) -> Result<u32> {
    match COUNTS.contains(&samples) {
        true => Ok(samples),
        false => Err(Error::Parameter(format!("samples must be one of {COUNTS:?}, got {samples}"))),
    }
}

/// A mask of all samples.
pub fn full(samples: u32) -> u32 {
    u32::MAX >> (32 - samples)
}

/// The pattern of a sample count of [`COUNTS`]; the centre alone for any other.
pub fn pattern(samples: u32) -> &'static [Offset] {
    match samples {
        2 => &TWO,
        4 => &FOUR,
        8 => &EIGHT,
        16 => &SIXTEEN,
        _ => &ONE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pattern_has_its_count_and_no_two_samples_in_one_row_or_column() {
        for count in COUNTS {
            let offsets = pattern(count);
            assert_eq!(offsets.len(), count as usize);
            for axis in [|o: &Offset| o.0, |o: &Offset| o.1] {
                let mut values: Vec<_> = offsets.iter().map(axis).collect();
                values.sort_unstable();
                values.dedup();
                assert_eq!(values.len(), count as usize);
                assert!(values.iter().all(|v| (-8..8).contains(v)));
            }
        }
    }
}
