//! Rounding of small numbers in single precision without casts, for vector code.

/// 2²³: added to a number from 0 to 2²³, it leaves the nearest whole number (of two equally near
/// the even one) in the last bits of the sum. Compilers turn this into vector code; casts they do
/// not.
pub const ROUNDING_OFFSET: f32 = 8_388_608.0;

/// Splits a number from 0 to 2²² into the whole number below it and the fraction; the result for
/// other numbers has no meaning.
#[inline(always)]
pub fn floor_and_fraction(value: f32) -> (i32, f32) {
    let nearest = (value + ROUNDING_OFFSET) - ROUNDING_OFFSET;
    let below = if nearest > value {
        nearest - 1.0
    } else {
        nearest
    };
    (
        ((below + ROUNDING_OFFSET).to_bits() & 0x7f_ffff) as i32,
        value - below,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_cut_to_the_whole_below() {
        for (value, below, rest) in [
            (0.0, 0, 0.0),
            (0.75, 0, 0.75),
            (1.0, 1, 0.0),
            (4095.5, 4095, 0.5),
        ] {
            assert_eq!(floor_and_fraction(value), (below, rest));
        }
    }
}
