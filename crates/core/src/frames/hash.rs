//! The hash of a survey's frames, for the provenance of results.

use super::frame_file::FrameFile;
use crate::persist::provenance::{self, HashError, Input};
use std::path::Path;

/// Hashes the frames of a survey, in their order, or the video or recording that they are in.
///
/// # Errors
/// [`HashError`] of the first that cannot be read.
pub fn hash_frames(frames: &[FrameFile]) -> Result<Input, HashError> {
    if let Some(file) = frames.first().and_then(FrameFile::shared_file) {
        return provenance::input(file);
    }
    let paths: Vec<&Path> = frames.iter().map(|frame| frame.path.as_path()).collect();
    provenance::input_list(&paths)
}
