//! The frames of all stretches in one tunnel: that of the first stretch.

use crate::error::RefineError;
use crate::model::frame_states::FrameStates;
use crate::model::rejection::RejectionReason;
use crate::parameters::calibration::Kappa;
use crate::parameters::frame_estimate::FrameEstimate;
use crate::shards::alignment::{ShardAlignment, common_inliers, distance_px};
use crate::shards::division::Shard;
use crate::shards::state::StraightShard;
use crate::stages::setup::Setup;
use std::ops::Range;
use tunnelstitch_geometry::numerics::median::upper_median;
use tunnelstitch_geometry::surface::GaugeMotion;

/// Distance between the places of a frame by two stretches beyond which one of them is wrong,
/// pixels: up to there a Gauss–Newton step may be judged by its slope
/// ([`crate::solver::gauss_newton`]), as it does not lead to another minimum.
const MAX_DISTANCE_PX: f64 = 1.0;

/// The frames of all stretches.
pub struct JoinedFrames {
    /// Estimates and rejection reasons, poses in the straight tunnel.
    pub states: FrameStates,
    /// Of each stretch, its alignment to the first.
    pub alignments: Vec<ShardAlignment>,
    /// Frames of which two stretches disagree.
    pub displaced: Vec<(usize, RejectionReason)>,
}

/// Joins the frames of all stretches, in order.
///
/// # Errors
/// [`RefineError::ShardsDisagree`].
pub fn join_frames(setup: &Setup, shards: &[StraightShard]) -> Result<JoinedFrames, RefineError> {
    let mut joined = JoinedFrames {
        states: FrameStates {
            estimates: Vec::with_capacity(setup.count()),
            rejections: Vec::with_capacity(setup.count()),
            kappa: Kappa::zeros(),
        },
        alignments: Vec::with_capacity(shards.len()),
        displaced: Vec::new(),
    };
    let mut before: Option<(&Shard, FrameStates)> = None;
    for StraightShard { shard, end } in shards {
        let own = match end {
            Some(end) => end.snapshot.state.frames.clone(),
            None => unsolved(setup, &shard.frames),
        };
        let alignment = match &before {
            None => ShardAlignment::default(),
            Some((neighbour, states)) => {
                let pair = [(*neighbour, states), (shard, &own)];
                align(setup, pair, &mut joined.displaced)?
            }
        };
        let own = aligned(own, shard, &alignment);
        let places = shard.place(shard.own.start)..shard.place(shard.own.end);
        let states = &mut joined.states;
        states.estimates.extend(&own.estimates[places.clone()]);
        states.rejections.extend_from_slice(&own.rejections[places]);
        joined.alignments.push(alignment);
        before = Some((shard, own));
    }
    Ok(joined)
}

/// The states of frames that no equations determine.
fn unsolved(setup: &Setup, frames: &Range<usize>) -> FrameStates {
    let rejections = vec![Some(RejectionReason::Unsolved); frames.len()];
    FrameStates::at(&setup.prior.initial[frames.clone()], rejections)
}

/// The alignment of a stretch to the one before, which is aligned already: by the frames that both
/// have registered, or, if there are none, by the initial step between them. Adds frames that they
/// place differently to `displaced`.
fn align(
    setup: &Setup,
    [(before, states_before), (shard, states)]: [(&Shard, &FrameStates); 2],
    displaced: &mut Vec<(usize, RejectionReason)>,
) -> Result<ShardAlignment, RefineError> {
    let context = setup.initial_context(0.0);
    let gauge = context.gauge();
    let frames = middle_half(shard.frames.start..before.frames.end);
    let firsts = [before.frames.start, shard.frames.start];
    let common = common_inliers(frames, [states_before, states], firsts);
    if common.is_empty() {
        let (last, first) = (shard.own.start - 1, shard.own.start);
        let pose = &states_before.estimates[before.place(last)].pose;
        let datum = setup.calibration.datum(&Kappa::zeros());
        let predicted = setup.prior.predict_at(&datum, last, pose, first);
        let own = states.estimates[shard.place(first)].pose;
        return Ok(ShardAlignment {
            motion: gauge.align(&[own], &[predicted]),
            ..ShardAlignment::default()
        });
    }
    let of = |states: &FrameStates, shard: &Shard| -> Vec<FrameEstimate> {
        let estimates = common.iter().map(|k| states.estimates[shard.place(*k)]);
        estimates.collect()
    };
    let (own, neighbours) = (of(states, shard), of(states_before, before));
    let alignment = ShardAlignment::of_common(&gauge, &own, &neighbours);
    let wall = (context.surface.as_ref(), &context.cameras);
    let distances = common.iter().zip(own.iter().zip(&neighbours));
    let distances_px = distances.map(|(k, (own, neighbour))| {
        let aligned = alignment.motion.apply(&own.pose);
        distance_px(wall, *k, [&neighbour.pose, &aligned])
    });
    let distances_px: Vec<f64> = distances_px.collect();
    let median_px = upper_median(distances_px.clone()).unwrap_or(0.0);
    if median_px > MAX_DISTANCE_PX {
        return Err(RefineError::ShardsDisagree {
            number: before.number,
            first: common[0],
            last: common[common.len() - 1],
            distance_px: median_px,
        });
    }
    let far = common.iter().zip(distances_px);
    let far = far.filter(|(_, error_px)| *error_px > MAX_DISTANCE_PX);
    displaced.extend(far.map(|(k, error_px)| (*k, RejectionReason::Misaligned { error_px })));
    Ok(alignment)
}

/// The half of a range in its middle: frames near the ends of a stretch have neighbours on one side
/// only.
fn middle_half(range: Range<usize>) -> Range<usize> {
    let quarter = range.len() / 4;
    range.start + quarter..range.end - quarter
}

/// States of a stretch as the one before would have them.
fn aligned(states: FrameStates, shard: &Shard, alignment: &ShardAlignment) -> FrameStates {
    let first = shard.frames.start;
    let estimates = states.estimates.iter();
    let rejections = states.rejections.into_iter();
    FrameStates {
        estimates: estimates.map(|e| alignment.apply(e)).collect(),
        rejections: rejections
            .map(|reason| reason.map(|reason| in_survey(reason, first, &alignment.motion)))
            .collect(),
        kappa: states.kappa,
    }
}

/// A reason of a stretch that begins with frame `first`, in the terms of the survey.
fn in_survey(reason: RejectionReason, first: usize, motion: &GaugeMotion) -> RejectionReason {
    match reason {
        RejectionReason::Repeated(frame) => RejectionReason::Repeated(first + frame),
        RejectionReason::Contradicts { frame, correlation } => RejectionReason::Contradicts {
            frame: first + frame,
            correlation,
        },
        RejectionReason::Ambiguous {
            other,
            separation_m,
        } => RejectionReason::Ambiguous {
            other: motion.apply(&other),
            separation_m,
        },
        other => other,
    }
}
