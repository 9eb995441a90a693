//! Whether the pictures agree with another reading of the initial poses.
//!
//! In a round tunnel a camera on the axis looks at the wall whichever way its poses are read: from camera to world or back, along
//! +z or −z. The geometry cannot tell; the frames' overlaps can. Where a refinement has failed, the first frames are refined in
//! each reading.

use super::{RefineOptions, refine};
use crate::progress::{Progress, Silent};
use crate::survey::{Survey, SurveyError};
use std::sync::Arc;

/// Frames that are tried: two turns of twelve and some.
const TRIED: usize = 26;

/// The flags of the reading that makes more than half of the first frames sure, where the given one does not; `None` if there is
/// none, or if the given one does.
///
/// # Errors
/// Poses that cannot be read any more.
pub fn other_reading(survey: &Survey) -> Result<Option<String>, SurveyError> {
    let options = RefineOptions {
        // Nothing besides the poses.
        calibrate: Some(Vec::new()),
        ..RefineOptions::fast()
    };
    let silent: Arc<dyn Progress> = Arc::new(Silent);
    for (flags, reading) in survey.readings(TRIED)? {
        let sure = match refine(&reading, &options, &silent) {
            Ok(refined) => reading.frames.len() - refined.report.frames_on_prior,
            Err(_) => 0,
        };
        if 2 * sure > reading.frames.len() {
            return Ok(Some(flags).filter(|flags| !flags.is_empty()));
        }
    }
    Ok(None)
}
