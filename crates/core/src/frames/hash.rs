//! The hash of a survey's frames, for the provenance of results.

use super::frame_file::FrameFile;
use crate::persist::provenance::{self, HashError, Input};
use std::path::Path;

/// Hashes the frames of a survey, in their order, or the video, the recording or the TIFF files
/// that they are in.
///
/// # Errors
/// [`HashError`] of the first that cannot be read.
pub fn hash_frames(frames: &[FrameFile]) -> Result<Input, HashError> {
    let mut paths: Vec<&Path> = frames.iter().map(FrameFile::file).collect();
    paths.dedup();
    match frames.first().and_then(FrameFile::shared_file) {
        Some(file) if paths.len() == 1 => provenance::input(file),
        _ => provenance::input_list(&paths),
    }
}
