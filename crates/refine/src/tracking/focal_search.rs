//! Search for a focal length that is hardly known.
//!
//! Tracking and Gauss–Newton correct a focal length that is wrong by a few per cent. Where its
//! prior is wider, focal lengths are tried over the whole of it: with each, the second frames of
//! some pairs of neighbours are registered on the wall that the first ones show. A wrong focal
//! length turns them by too much or too little against the prior of the poses, and bends what they
//! show, so that it correlates less. The log-posterior of κ₀ = ln f is the sum over the pairs of
//! log-likelihood and prior.

use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::model::rejection::RejectionReason;
use crate::options::RefineOptions;
use crate::parameters::calibration::{FOCAL_INDEX, Kappa};
use crate::tracking::neighbour_pairs::{first_frames, register_pairs};
use crate::tracking::registration::{MAX_DEVIATION_COST, Registered};
use tunnelstitch_core::progress::Progress;

/// Distance between the logarithms of neighbouring focal lengths: half of it moves the border of a
/// picture by a pixel or two of the level at which frames are searched for, and tracking corrects
/// as much.
const STEP: f64 = 0.05;
/// Reach of the search, 1-σ of the prior.
const REACH_SIGMAS: f64 = 2.0;

/// Shared parameters with which tracking begins: zero but for the logarithm of the focal length
/// over the given one, if it is asked for and its prior reaches farther than tracking does by
/// itself.
/// `rejections`: of frames that show nothing.
///
/// # Errors
/// [`ProblemError`]: a frame that cannot be read.
pub fn search_focal_length(
    context: &EstimationContext,
    options: &RefineOptions,
    rejections: &[Option<RejectionReason>],
    progress: &dyn Progress,
) -> Result<Kappa, ProblemError> {
    let calibration = &context.calibration;
    let sigma = calibration.sigma[FOCAL_INDEX];
    let reach = reach(sigma);
    if reach == 0 || !calibration.free[FOCAL_INDEX] {
        return Ok(Kappa::zeros());
    }
    let states = FrameStates::at(&context.prior.initial, rejections.to_vec());
    let firsts = first_frames(states.estimates.len());
    progress.start("focal length", 2 * reach as usize + 1);
    let (mut best, mut found) = (f64::NEG_INFINITY, Kappa::zeros());
    for k in -reach..=reach {
        let mut kappa = Kappa::zeros();
        kappa[FOCAL_INDEX] = STEP * f64::from(k);
        let context = context.at(kappa);
        let pairs = register_pairs(&context, options, &states, &firsts, |_| true)?;
        let of_pairs: f64 = pairs.iter().map(log_posterior).sum();
        let score = of_pairs - 0.5 * (kappa[FOCAL_INDEX] / sigma).powi(2);
        if score > best {
            (best, found) = (score, kappa);
        }
        progress.advance(1);
    }
    progress.finish();
    Ok(found)
}

/// Number of steps that the search goes to either side, for a prior of `sigma` (1-σ of ln f).
fn reach(sigma: f64) -> i32 {
    (REACH_SIGMAS * sigma / STEP) as i32
}

/// Number of registrations of a frame that the search takes in a survey of `frames`, for a prior of
/// `sigma` (1-σ of ln f); 0 if nothing is searched for.
pub fn focal_search_registrations(sigma: f64, frames: usize) -> usize {
    match reach(sigma) {
        0 => 0,
        reach => (2 * reach as usize + 1) * first_frames(frames).len(),
    }
}

/// Log-posterior of the second frame of a pair; one that does not fit deviates by as much as the
/// prior allows, and correlates with nothing.
fn log_posterior(registered: &Option<Registered>) -> f64 {
    registered.map_or(-MAX_DEVIATION_COST, |registered| {
        registered.log_likelihood - registered.deviation
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::calibration::Calibration;
    use crate::test_scene::{bricks, with_context};
    use tunnelstitch_core::progress::Silent;
    use tunnelstitch_core::test_wall::TestWall;
    use tunnelstitch_geometry::camera::Camera;

    /// κ₀ that is found where the given focal length is `factor` times the true one, with a prior
    /// of `sigma`.
    fn found(factor: f64, sigma: f64) -> f64 {
        let wall = TestWall::ring(bricks);
        let (mut pictures, poses) = (wall.frames(), &wall.poses[..6]);
        pictures.truncate(poses.len());
        with_context(&wall, pictures, poses, |context, states| {
            let given = Camera {
                fx: factor * wall.camera.fx,
                fy: factor * wall.camera.fy,
                ..wall.camera
            };
            let mut calibration = Calibration::none(given);
            calibration.free[FOCAL_INDEX] = true;
            calibration.sigma[FOCAL_INDEX] = sigma;
            let context = EstimationContext {
                cameras: given.into(),
                calibration,
                ..context.clone()
            };
            let options = RefineOptions {
                // The pyramids have one level.
                coarsest_side: given.shorter_side(),
                ..RefineOptions::default()
            };
            search_focal_length(&context, &options, &states.rejections, &Silent).unwrap()
                [FOCAL_INDEX]
        })
    }

    #[test]
    fn the_nearest_focal_length_tried_is_found() {
        for factor in [0.78f64, 1.3] {
            let left = found(factor, 0.15) + factor.ln();
            assert!(left.abs() <= STEP, "{factor}: {left}");
        }
    }

    #[test]
    fn a_focal_length_known_to_a_few_per_cent_is_not_searched_for() {
        assert_eq!(found(1.3, 0.02), 0.0);
        assert_eq!(focal_search_registrations(0.02, 100), 0);
        let pairs = first_frames(100).len();
        // Twelve steps of 5 % to either side.
        assert_eq!(focal_search_registrations(0.31, 100), 25 * pairs);
    }
}
