//! The warning of files of 16 bits whose upper bits are empty.

use crate::frames::{UNUSED_UPPER_BITS, brightest_bits};
use crate::survey::Survey;

/// The warning that the frames leave the upper bits of their files of 16 bits empty, if they do.
pub fn unused_bits_warning(survey: &Survey) -> Option<String> {
    let size = <(u32, u32)>::from(survey.cameras.size());
    brightest_bits(&survey.frames, size).and_then(unused_bits)
}

/// The warning that no frame uses the upper bits of its file; `bits` are those of the brightest
/// value.
pub(super) fn unused_bits(bits: u32) -> Option<String> {
    UNUSED_UPPER_BITS.contains(&bits).then(|| {
        format!(
            "the frames have files of 16 bits, but no value of more than {bits} bits: if the \
             camera delivers {bits} bits, add bits = {bits} under [frames]; otherwise use more \
             light or a longer exposure"
        )
    })
}
