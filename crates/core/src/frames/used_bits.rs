//! Bits that the values of 16-bit files use.

use super::decode::colour_type;
use super::frame_file::FrameFile;
use super::stored_frame::StoredFrame;
use std::ops::RangeInclusive;

/// Bits of the brightest value in files of 16 bits by which the upper bits are empty: cameras of 10
/// to 14 bits often leave them so.
pub const UNUSED_UPPER_BITS: RangeInclusive<u32> = 9..=14;

/// Bits of the brightest value of a frame, of whose file [`has_sixteen_bits`] is true; None of one
/// of 8 bits.
pub fn used_bits(frame: &StoredFrame) -> Option<u32> {
    Some(u16::BITS - frame.brightest()?.leading_zeros())
}

/// True if the file of a frame has values of 16 bits, by its header.
pub fn has_sixteen_bits(file: &FrameFile) -> bool {
    colour_type(file)
        .is_ok_and(|colour| colour.bits_per_pixel() == 16 * u16::from(colour.channel_count()))
}
