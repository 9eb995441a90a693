//! Units of weights and sums in whole numbers.

/// Bits of a sum below its whole part.
pub const fn bits(taps: usize) -> u32 {
    match taps {
        2 => 14,
        _ => 20,
    }
}

/// A sum under so many taps in units of a whole one.
pub const fn scale(taps: usize) -> f32 {
    1.0 / (1u32 << bits(taps)) as f32
}

/// What is added to a sum that is then cut to the nearest whole one.
pub const fn rounding(taps: usize) -> i32 {
    missing(taps) + (1 << (bits(taps) - 1))
}

/// What is missing of a sum: what cutting has taken away in the mean.
pub const fn missing(taps: usize) -> i32 {
    match taps {
        2 => 0,
        _ => 1 << 14,
    }
}
