//! Bits that the values of 16-bit files use.

use super::decode::colour_type;
use super::frame_file::FrameFile;
use super::stored_frame::StoredFrame;
use std::ops::RangeInclusive;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// Bits of the brightest value in files of 16 bits by which the upper bits are empty: cameras of 10
/// to 14 bits often leave them so, and programs that save values of 8 bits as numbers of 16.
pub const UNUSED_UPPER_BITS: RangeInclusive<u32> = 8..=14;

/// Number of frames that are decoded at a time.
const FRAMES_AT_A_TIME: usize = 12;

/// Bits of the brightest value of frames in files of 16 bits; `None` if there are none. `size` is
/// that of the calibration, pixels; frames of another, and those that cannot be read, are passed
/// over.
///
/// All frames are decoded as long as their upper bits are empty, those that are evenly distributed
/// first.
pub fn brightest_bits(frames: &[FrameFile], (width, height): (u32, u32)) -> Option<u32> {
    let step = frames.len().div_ceil(FRAMES_AT_A_TIME).max(1);
    let order: Vec<&FrameFile> = (0..step)
        .flat_map(|first| frames.iter().skip(first).step_by(step))
        .collect();
    let mut brightest = None;
    for files in order.chunks(FRAMES_AT_A_TIME) {
        let bits = files.par_map(|file| {
            let frame = has_sixteen_bits(file).then(|| StoredFrame::decode(file, width, height));
            let brightest = frame?.ok()?.brightest()?;
            Some(u16::BITS - brightest.leading_zeros())
        });
        brightest = bits.into_iter().flatten().chain(brightest).max();
        if brightest.is_none_or(|bits| bits > *UNUSED_UPPER_BITS.end()) {
            break;
        }
    }
    brightest
}

/// True if the file of a frame has values of 16 bits, by its header.
fn has_sixteen_bits(file: &FrameFile) -> bool {
    colour_type(file)
        .is_ok_and(|colour| colour.bits_per_pixel() == 16 * u16::from(colour.channel_count()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{ImageBuffer, Luma};

    /// One frame of many may be the only one that uses all bits.
    #[test]
    fn the_brightest_of_all_frames_counts() {
        let dir = tempfile::tempdir().unwrap();
        let bits = |brightest: u16, at: usize| {
            let frames = (0..40).map(|k| {
                let value = if k == at { brightest } else { 300 };
                let picture = ImageBuffer::from_pixel(8, 6, Luma([value]));
                let path = dir.path().join(format!("{k}.png"));
                picture.save(&path).unwrap();
                FrameFile::picture(k, path)
            });
            let frames: Vec<FrameFile> = frames.collect();
            assert_eq!(brightest_bits(&frames, (60000, 60000)), None);
            brightest_bits(&frames, (8, 6))
        };
        assert_eq!(bits(4000, 7), Some(12));
        assert_eq!(bits(40000, 39), Some(16));
        assert_eq!(bits(40000, 0), Some(16));
    }
}
