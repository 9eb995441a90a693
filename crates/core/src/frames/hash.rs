//! The hash of a survey's frames, for the provenance of results.

use super::frame_file::FrameFile;
use crate::persist::provenance::{self, HashError, Input};
use std::path::Path;

/// Hashes the frames of a survey, in their order, or the video that they are in.
///
/// # Errors
/// [`HashError`] of the first that cannot be read.
pub fn hash_frames(frames: &[FrameFile]) -> Result<Input, HashError> {
    if let Some(frame) = frames.first().filter(|frame| frame.is_in_video()) {
        return provenance::input(frame.file());
    }
    let paths: Vec<&Path> = frames.iter().map(|frame| frame.path.as_path()).collect();
    provenance::input_list(&paths)
}
