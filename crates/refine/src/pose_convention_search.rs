//! Search for the pose convention that the frames agree with.
//!
//! In a round tunnel a camera on the axis looks at the wall in every convention of its poses: from
//! camera to world or from world to camera, along +z or −z. The geometry cannot tell them apart,
//! but the overlaps of the frames can. Where a refinement has failed, the first frames are refined
//! in each convention.

use crate::options::RefineOptions;
use crate::pipeline::refine;
use std::sync::Arc;
use tunnelstitch_core::progress::{Progress, Silent};
use tunnelstitch_core::survey::{Survey, SurveyError};

/// Angle by which the camera turns within the frames that are refined, radians: once around, and
/// about a field of view more, so that the last frames overlap the first.
const MIN_TURN_RAD: f64 = 1.15 * std::f64::consts::TAU;
/// Smallest number of frames that are refined in each convention.
const MIN_FRAMES: usize = 8;
/// Largest number of frames that are refined in each convention: bounds the time.
const MAX_FRAMES: usize = 40;

/// Counts the frames to refine in each convention.
fn count_frames(survey: &Survey) -> usize {
    let poses = survey.initial_poses();
    let mut turned_rad = 0.0;
    let steps = poses.iter().zip(poses.iter().skip(1));
    let turning_steps = steps
        .take_while(|(before, after)| {
            turned_rad += before.r_wc.angle_to(&after.r_wc);
            turned_rad < MIN_TURN_RAD
        })
        .count();
    (turning_steps + 2).clamp(MIN_FRAMES, MAX_FRAMES)
}

/// Finds the conventions in which more than half of the first frames are photometric, and returns
/// the flags that select those with the fewest changes.
///
/// There may be two: poses exactly as planned, seen from the tunnel's other end, are those of
/// another convention. None is returned if the convention given is right, or no other is.
///
/// # Errors
/// [`SurveyError`] if the poses cannot be read.
pub fn search_pose_conventions(survey: &Survey) -> Result<Vec<String>, SurveyError> {
    let options = RefineOptions {
        // Only the poses.
        calibrate: Some(Vec::new()),
        ..RefineOptions::fast()
    };
    let silent: Arc<dyn Progress> = Arc::new(Silent);
    let mut fitting = Vec::new();
    let (frames, mut fewest) = (count_frames(survey), usize::MAX);
    for (flags, reading) in survey.pose_convention_variants(frames)? {
        // A short survey has been refined in the convention given already.
        let is_known = flags.is_empty() && survey.frames.len() <= frames;
        if is_known || flags.len() > fewest {
            continue;
        }
        let photometric = match refine(&reading, &options, &silent) {
            Ok(refined) => reading.frames.len() - refined.report.frames_on_prior,
            Err(_) => 0,
        };
        if 2 * photometric > reading.frames.len() {
            if flags.is_empty() {
                return Ok(Vec::new());
            }
            fewest = flags.len();
            fitting.push(flags.join(" and "));
        }
    }
    Ok(fitting)
}
