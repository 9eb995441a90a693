//! Work of the stages of a refinement, for the display of progress.
//!
//! Seconds per frame, measured on surveys of 40 to 150 frames of 320 × 240 to 1280 × 960 px
//! (`refine -v`, two cores). Only their ratios count.

use crate::stages::plan::Stage;
use std::collections::VecDeque;
use tunnelstitch_core::progress::JobStage;

/// Time of prescreening, which decodes the frames.
const PRESCREEN_S: f64 = 0.008;
/// Time of registering a frame; it does so at a size that does not depend on the camera's.
const TRACK_S: f64 = 0.05;
/// Time of correcting the common shading.
const CORRECT_SHADING_S: f64 = 0.0005;
/// Time of the first solve, which only brings the estimate close.
const FIRST_SOLVE_S: f64 = 0.07;
/// Time per pixel of each of the two solves with dense samples.
const DENSE_SOLVE_PER_PIXEL_S: f64 = 0.35e-6;
/// Time per pixel of the solve jointly with the wall.
const JOINT_SOLVE_PER_PIXEL_S: f64 = 15e-6;
/// Time of comparing pairs.
const VALIDATE_PAIRS_S: f64 = 0.012;
/// Time of searching for aliases.
const RESOLVE_ALIASES_S: f64 = 0.015;
/// Time of uncertainty and verdict.
const ASSESS_S: f64 = 0.005;

/// Time of a stage per frame of `pixels`, seconds.
fn work_s(stage: &Stage, pixels: f64) -> f64 {
    match stage {
        Stage::Prescreen => PRESCREEN_S,
        Stage::Track => TRACK_S,
        Stage::CorrectShading => CORRECT_SHADING_S,
        Stage::Solve(plan) if plan.sampling.joint => JOINT_SOLVE_PER_PIXEL_S * pixels,
        Stage::Solve(_) if stage.is_dense_solve() => DENSE_SOLVE_PER_PIXEL_S * pixels,
        Stage::Solve(_) => FIRST_SOLVE_S,
        Stage::ValidatePairs => VALIDATE_PAIRS_S,
        Stage::ResolveAliases => RESOLVE_ALIASES_S,
        Stage::Assess => ASSESS_S,
    }
}

/// The place of the first of the stages that are `left`, after those that are `over`, for frames of
/// `pixels`.
pub fn place_in_job(over: &[Stage], left: &VecDeque<Stage>, pixels: f64) -> JobStage {
    let work_s = |stage: &Stage| work_s(stage, pixels);
    let done_s: f64 = over.iter().map(work_s).sum();
    let total_s = done_s + left.iter().map(work_s).sum::<f64>();
    JobStage {
        number: over.len() + 1,
        of: over.len() + left.len(),
        done_share: done_s / total_s,
        share: left.front().map_or(0.0, work_s) / total_s,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::RefineOptions;
    use crate::stages::plan::plan_stages;

    #[test]
    fn shares_of_all_stages_add_up_to_the_whole_job() {
        let mut left = plan_stages(&RefineOptions::default());
        let (mut over, mut places, count) = (Vec::new(), Vec::new(), left.len());
        let mut done_share = 0.0;
        while !left.is_empty() {
            let place = place_in_job(&over, &left, 3e5);
            assert_eq!((place.number, place.of), (over.len() + 1, count));
            assert!((place.done_share - done_share).abs() < 1e-12, "{place:?}");
            done_share += place.share;
            places.push(place);
            over.extend(left.pop_front());
        }
        assert!((done_share - 1.0).abs() < 1e-12);
        // Half of the work are the dense solves, as measured on 640 × 480 px.
        let dense = places[count - 3].share + places[count - 2].share;
        assert!((0.4..0.6).contains(&dense));
    }
}
