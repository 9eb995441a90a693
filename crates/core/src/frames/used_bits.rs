//! Bits that the values of 16-bit files use.

use super::decode::colour_type;
use super::frame_file::FrameFile;
use super::stored_frame::StoredFrame;
use std::ops::RangeInclusive;

/// Bits of the brightest value in files of 16 bits by which the upper bits are empty: cameras of 10
/// to 14 bits often leave them so.
pub const UNUSED_UPPER_BITS: RangeInclusive<u32> = 9..=14;

/// Bits of a frame's brightest value, if its file is of 16 bits.
pub fn used_bits(file: &FrameFile, frame: &StoredFrame) -> Option<u32> {
    let brightest = frame.brightest().filter(|_| has_sixteen_bits(file))?;
    Some(u16::BITS - brightest.leading_zeros())
}

/// True if the file of a frame has values of 16 bits, by its header.
pub fn has_sixteen_bits(file: &FrameFile) -> bool {
    colour_type(file)
        .is_ok_and(|colour| colour.bits_per_pixel() == 16 * u16::from(colour.channel_count()))
}
