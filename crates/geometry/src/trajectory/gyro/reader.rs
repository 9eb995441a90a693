//! Reading of a gyroscope's log of any format.

use super::log::GyroLog;
use super::{gcsv, gopro};
use crate::trajectory::error::PoseError;
use std::path::Path;

impl GyroLog {
    /// Reads a log: the MP4 of a GoPro by its first box, anything else as gcsv.
    ///
    /// # Errors
    /// An unreadable file. Of gcsv: another first line; a header without scales, or with an
    /// impossible orientation; a table with other columns; a line with more or fewer columns than
    /// the table's first, or with something that is no number; times that do not increase; fewer
    /// than two samples. Of an MP4: a damaged index or sample table; no track `gpmd` or no `GYRO`
    /// in it; damaged payloads; an impossible orientation; fewer than two samples.
    pub fn read(path: &Path) -> Result<Self, PoseError> {
        match gopro::VideoFile::open(path)? {
            Some(video) => gopro::read(video),
            None => gcsv::read(path),
        }
    }
}
