//! Whether the pictures agree with another reading of the initial poses.
//!
//! In a round tunnel a camera on the axis looks at the wall whichever way its poses are read: from
//! camera to world or back, along +z or −z. The geometry cannot tell; the frames' overlaps can.
//! Where a refinement has failed, the first frames are refined in each reading.

use crate::progress::{Progress, Silent};
use crate::refine::options::RefineOptions;
use crate::refine::pipeline::refine;
use crate::survey::{Survey, SurveyError};
use std::sync::Arc;

/// How far the camera must turn within the frames that are tried, in all: once around and some.
const TURN_RAD: f64 = 1.15 * std::f64::consts::TAU;
/// Least and greatest number of frames that are tried.
const TRIED: (usize, usize) = (8, 40);

/// Number of frames to try.
fn tried(survey: &Survey) -> usize {
    let poses = survey.initial_poses();
    let mut turned_rad = 0.0;
    let steps = poses.iter().zip(poses.iter().skip(1));
    let enough = steps
        .take_while(|(before, after)| {
            turned_rad += before.r_wc.angle_to(&after.r_wc);
            turned_rad < TURN_RAD
        })
        .count();
    (enough + 2).clamp(TRIED.0, TRIED.1)
}

/// The flags of the readings that make more than half of the first frames sure where the given one
/// does not: those with the fewest changes. There may be two: poses exactly as planned, seen from
/// the tunnel's other end, are those of another convention. Empty if there is none, or if the given
/// one does.
///
/// # Errors
/// Poses that cannot be read any more.
pub fn search_pose_conventions(survey: &Survey) -> Result<Vec<String>, SurveyError> {
    let options = RefineOptions {
        // Nothing besides the poses.
        calibrate: Some(Vec::new()),
        ..RefineOptions::fast()
    };
    let silent: Arc<dyn Progress> = Arc::new(Silent);
    let mut fitting = Vec::new();
    let (tried, mut fewest) = (tried(survey), usize::MAX);
    for (flags, reading) in survey.pose_convention_variants(tried)? {
        // All frames of a short survey have been refined as given.
        let is_known = flags.is_empty() && survey.frames.len() <= tried;
        if is_known || flags.len() > fewest {
            continue;
        }
        let sure = match refine(&reading, &options, &silent) {
            Ok(refined) => reading.frames.len() - refined.report.frames_on_prior,
            Err(_) => 0,
        };
        if 2 * sure > reading.frames.len() {
            if flags.is_empty() {
                return Ok(Vec::new());
            }
            fewest = flags.len();
            fitting.push(flags.join(" and "));
        }
    }
    Ok(fitting)
}
