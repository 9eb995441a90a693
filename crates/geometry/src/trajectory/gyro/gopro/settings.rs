//! The camera's settings: GPMF that it writes once into the index, in the box `GPMF` of `udta`.
//!
//! A HERO7 writes the readout time into the track `gpmd`, too, where it is often wrong; it is not
//! read there.
//!
//! Source: issue 48 of <https://github.com/gopro/gpmf-parser>; the settings of a HERO11, whose
//! `SROT` is 24.0 for 5.3K at 30 frames a second.

use super::boxes::find_if_there;
use super::klv::KlvList;
use super::video_file::VideoFile;
use std::path::Path;

/// The readout time of the rolling shutter that the video of a GoPro states in its settings,
/// milliseconds from the first row to the last. [`None`] if it states none, or is no such video.
pub fn gopro_readout_ms(path: &Path) -> Option<f64> {
    let mut video = VideoFile::open(path).ok()??;
    readout_ms(&video.index().ok()?).ok()?
}

/// The time from reading the first row of a frame to the last (`SROT`), milliseconds, if the
/// settings state one above 0. `index` is the content of the box `moov`.
///
/// # Errors
/// Damaged settings; a time that is no number.
pub fn readout_ms(index: &[u8]) -> Result<Option<f64>, String> {
    let Some(user_data) = find_if_there(index, *b"udta")? else {
        return Ok(None);
    };
    let Some(settings) = find_if_there(user_data, *b"GPMF")? else {
        return Ok(None);
    };
    for device in KlvList(settings) {
        if let Some(readout) = device?.children().find(*b"SROT")? {
            let numbers = readout.rows()?.concat();
            let stated = numbers.first().filter(|ms| **ms > 0.0 && ms.is_finite());
            // In single precision: without its digits below a microsecond.
            return Ok(stated.map(|ms| (1e3 * ms).round() / 1e3));
        }
    }
    Ok(None)
}
