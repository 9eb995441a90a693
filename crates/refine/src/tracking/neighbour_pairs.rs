//! Registration of pairs of neighbouring frames, by which hypotheses about the whole survey are
//! told apart: of how its poses are to be read, of its focal length.

use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::options::RefineOptions;
use crate::samples::footprints::footprint;
use crate::tracking::neighbours::Neighbours;
use crate::tracking::pose_prediction::PosePrediction;
use crate::tracking::registration::{Effort, Registered, register_frame};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// Largest number of pairs of neighbouring frames that are looked at: bounds the time.
const MAX_PAIRS: usize = 12;
/// Pairs that are registered at once; after each batch a hypothesis that cannot win any more is
/// given up.
const PAIRS_AT_ONCE: usize = 4;
/// Hypotheses of a frame's pose that are refined: neighbours overlap by much if all is right, so
/// that the right one is among the best.
const MAX_PAIR_HYPOTHESES: usize = 2;

/// The first frames of the pairs: evenly distributed, no frame in two pairs.
pub fn first_frames(frames: usize) -> Vec<usize> {
    let pairs = (frames / 2).min(MAX_PAIRS);
    (0..pairs).map(|k| k * frames / pairs.max(1)).collect()
}

/// Registers the frame after each of `firsts` on the wall that this one shows, both at the
/// estimates of `states`, as long as `is_wanted` of the results before; None where a frame does not
/// fit.
///
/// # Errors
/// [`ProblemError`]: a frame that cannot be read.
pub fn register_pairs(
    context: &EstimationContext,
    options: &RefineOptions,
    states: &FrameStates,
    firsts: &[usize],
    is_wanted: impl Fn(&[Option<Registered>]) -> bool,
) -> Result<Vec<Option<Registered>>, ProblemError> {
    let mut registered = Vec::new();
    for batch in firsts.chunks(PAIRS_AT_ONCE) {
        if !is_wanted(&registered) {
            break;
        }
        for pair in batch.par_map(|first| register_second(context, options, states, *first)) {
            registered.push(pair?);
        }
    }
    Ok(registered)
}

/// Registers the frame after `first` on the wall that this one shows.
fn register_second(
    context: &EstimationContext,
    options: &RefineOptions,
    states: &FrameStates,
    first: usize,
) -> Result<Option<Registered>, ProblemError> {
    let frame_range = first..first + 2;
    if states.inliers(&frame_range).contains(&false) {
        return Ok(None);
    }
    let estimates = &states.estimates[frame_range.clone()];
    let seen = frame_range.clone().zip(estimates).map(|(k, estimate)| {
        let camera = context.cameras.of(k).with_sweep(&states.sweep(context, k));
        footprint(context, &camera, k, &estimate.pose)
    });
    let Ok(footprints) = seen.collect::<Result<Vec<_>, _>>() else {
        return Ok(None);
    };
    let neighbours = Neighbours {
        estimates,
        registered: &[true, false],
        footprints: &footprints,
        frame_range,
    };
    let predicted = PosePrediction {
        pose: estimates[1].pose,
        sigma_scale: 1.0,
    };
    let mut effort = Effort::of(MAX_PAIR_HYPOTHESES);
    let registered = register_frame(
        context,
        options,
        first + 1,
        &predicted,
        &neighbours,
        &mut effort,
    )?;
    Ok(registered.ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_spread_and_share_no_frame() {
        assert_eq!(first_frames(1).len(), 0);
        assert_eq!(first_frames(5), [0, 2]);
        let firsts = first_frames(1001);
        assert_eq!(firsts.len(), MAX_PAIRS);
        assert!(firsts.windows(2).all(|pair| pair[1] >= pair[0] + 2));
        assert!(firsts.iter().all(|first| first + 1 < 1001));
        assert!(first_frames(24).iter().all(|first| first % 2 == 0));
    }
}
