//! Units of weights and sums in whole numbers.

/// Bits of a sum below its integer part.
pub const fn bits(taps: usize) -> u32 {
    match taps {
        2 => 14,
        _ => 20,
    }
}

/// Unit of a sum for a number of taps, as a fraction of a grey level.
pub const fn scale(taps: usize) -> f32 {
    1.0 / (1u32 << bits(taps)) as f32
}

/// Offset of a sum before its fractional bits are cut off: half a unit and the loss by truncation.
pub const fn rounding(taps: usize) -> i32 {
    missing(taps) + (1 << (bits(taps) - 1))
}

/// Mean loss of a sum by truncation.
pub const fn missing(taps: usize) -> i32 {
    match taps {
        2 => 0,
        _ => 1 << 14,
    }
}
