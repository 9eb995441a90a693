//! From `[frames]` to the frames.

use super::{FramesSection, SurveyError, times};
use crate::frames::{self, FrameFile};
use std::path::Path;

/// The frames that a section names, relative to `folder`, and their times, seconds, where a file tells them. A mask that lies among
/// the frames is none of them.
///
/// # Errors
/// A malformed pattern, no frames, a malformed file of times.
pub(super) fn list(
    section: &FramesSection,
    folder: &Path,
    frame_times: Option<&Path>,
) -> Result<(Vec<FrameFile>, Option<Vec<f64>>), SurveyError> {
    let mask = section.mask.as_ref().map(|mask| folder.join(mask));
    let frames = frames::list(folder, &section.images, mask.as_deref())?;
    let own = section.times.as_ref().map(|times| folder.join(times));
    let times_s = match frame_times.or(own.as_deref()) {
        Some(path) => Some(times::read(path, &frames)?),
        None => None,
    };
    Ok((frames, times_s))
}
