//! Prediction of a frame's pose by the prior, given the frames that are registered already.

use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::thresholds::footprints::MAX_OVERLAP_DISTANCE_FRAMES;
use tunnelstitch_geometry::trajectory::{JitterModel, Pose};

/// The prior's prediction of a frame's pose.
#[derive(Clone, Copy, Debug)]
pub struct PosePrediction {
    /// The predicted pose.
    pub pose: Pose,
    /// σ of the prediction over that of a single step of the prior.
    pub sigma_scale: f64,
}

/// Predicts the pose of frame `frame` from the inliers around it; falls back to the initial pose if
/// the prediction lies outside the tunnel.
///
/// - In a rig, from an inlier of the same moment, as far as there is one: by the relation of their
///   cameras.
/// - Random walk: the nearest inlier's pose, followed by the initial steps from there. Its σ grows
///   with the square root of the number of steps.
/// - Independent errors: the initial pose, moved by the gauge motion (rotation about the axis,
///   translation along it) that the inliers have taken on.
pub fn predict_pose(
    context: &EstimationContext,
    frame: usize,
    states: &FrameStates,
) -> PosePrediction {
    let predicted = predict_pose_unchecked(context, frame, states);
    match context.surface.check_inside(&predicted.pose.t_wc) {
        Ok(()) => predicted,
        Err(_) => PosePrediction {
            pose: context.prior.initial[frame],
            ..predicted
        },
    }
}

/// Predicts the pose of frame `frame`, be it inside the tunnel or not.
fn predict_pose_unchecked(
    context: &EstimationContext,
    frame: usize,
    states: &FrameStates,
) -> PosePrediction {
    let metric = context.calibration.datum(&context.kappa);
    let initial = |k: usize| metric.to_nominal_tunnel(&context.prior.initial[k]);
    let around = frame.saturating_sub(MAX_OVERLAP_DISTANCE_FRAMES)
        ..(frame + MAX_OVERLAP_DISTANCE_FRAMES).min(states.estimates.len());
    let inliers = around.filter(|i| *i != frame && states.rejections[*i].is_none());
    let prior = context.prior;
    let from = |nearest: usize| {
        let pose = &states.estimates[nearest].pose;
        let (first, last) = (nearest.min(frame), nearest.max(frame));
        PosePrediction {
            pose: prior.predict_at(&metric, nearest, pose, frame),
            sigma_scale: prior.steps_between(first, last).sqrt(),
        }
    };
    let of_moment = inliers.clone().filter(|i| prior.is_same_moment(*i, frame));
    if let Some(nearest) = of_moment.min_by_key(|i| i.abs_diff(frame)) {
        return from(nearest);
    }
    match prior.jitter.model {
        JitterModel::RandomWalk => match inliers.min_by_key(|i| i.abs_diff(frame)) {
            Some(nearest) => from(nearest),
            None => PosePrediction {
                pose: initial(frame),
                sigma_scale: context.prior.variance_ratios[frame].sqrt(),
            },
        },
        JitterModel::Independent => {
            let (from, to): (Vec<Pose>, Vec<Pose>) = inliers
                .map(|i| (initial(i), states.estimates[i].pose))
                .unzip();
            let motion = context.gauge().align(&from, &to);
            PosePrediction {
                pose: motion.apply(&initial(frame)),
                sigma_scale: context.prior.variance_ratios[frame].sqrt(),
            }
        }
    }
}
