//! Rounding of small numbers in single precision without casts, as vectors do it well.

/// 2²³: added to a number from 0 to 2²³, it leaves the nearest whole number (of two equally near
/// the even one) in the last bits of the sum. Unlike a cast, this is what vectors do well.
pub const WHOLE: f32 = 8_388_608.0;

/// A number from 0 to 2²² cut to the whole number below it, and what was cut off; anything for
/// other numbers.
#[inline(always)]
pub fn whole(value: f32) -> (i32, f32) {
    let nearest = (value + WHOLE) - WHOLE;
    let below = if nearest > value {
        nearest - 1.0
    } else {
        nearest
    };
    (
        ((below + WHOLE).to_bits() & 0x7f_ffff) as i32,
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
            assert_eq!(whole(value), (below, rest));
        }
    }
}
