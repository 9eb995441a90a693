//! The frames of all stretches in one tunnel: that of the first stretch.

use crate::error::RefineError;
use crate::model::frame_states::FrameStates;
use crate::model::rejection::RejectionReason;
use crate::parameters::calibration::Kappa;
use crate::parameters::frame_estimate::FrameEstimate;
use crate::shards::alignment::{ShardAlignment, common_inliers};
use crate::shards::division::Shard;
use crate::shards::state::StraightShard;
use crate::stages::setup::Setup;
use crate::tracking::pose_separation::separation_px;
use std::ops::Range;
use tunnelstitch_core::frames::PictureNoise;
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
    let context = setup.initial_context(PictureNoise::default());
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
    let surface = context.surface.as_ref();
    let distances = common.iter().zip(own.iter().zip(&neighbours));
    let distances_px = distances.map(|(k, (own, neighbour))| {
        let aligned = alignment.motion.apply(&own.pose);
        separation_px(surface, context.cameras.of(*k), &neighbour.pose, &aligned)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::RefineInput;
    use crate::options::RefineOptions;
    use crate::shards::state::ShardEnd;
    use crate::stages::begin::begin;
    use crate::stages::state::{PipelineState, Snapshot};
    use image::DynamicImage;
    use std::sync::Arc;
    use tunnelstitch_core::frames::{FrameSet, Light};
    use tunnelstitch_geometry::camera::Camera;
    use tunnelstitch_geometry::surface::Circle;
    use tunnelstitch_geometry::trajectory::{Jitter, JitterModel, StampedPose, spiral};

    /// Frames of the survey.
    const FRAMES: usize = 600;
    /// Stretches that it is in.
    const STRETCHES: usize = 3;

    /// The true estimate of a frame.
    fn truth(frame: usize) -> FrameEstimate {
        FrameEstimate {
            pose: spiral(frame + 1, 0.1, 0.5)[frame],
            log_gain: 0.1 * (0.3 * frame as f64).sin(),
            bias: 2.0 * (0.7 * frame as f64).cos(),
        }
    }

    /// The difference of a stretch to the first one.
    fn difference(number: usize) -> ShardAlignment {
        let n = (number - 1) as f64;
        ShardAlignment {
            motion: GaugeMotion::about_y(0.7 * n, -1.3 * n),
            log_gain: 0.05 * n,
            bias: -3.0 * n,
        }
    }

    /// The inverse of [`ShardAlignment::apply`].
    fn without(alignment: &ShardAlignment, estimate: &FrameEstimate) -> FrameEstimate {
        let log_gain = estimate.log_gain - alignment.log_gain;
        FrameEstimate {
            pose: alignment.motion.reversed().apply(&estimate.pose),
            log_gain,
            bias: estimate.bias - log_gain.exp() * alignment.bias,
        }
    }

    /// Calls a function with a survey and its stretches, whose estimates and rejections are those
    /// that `change` makes of the true ones by stretch and frame of the survey.
    fn with_stretches<T>(
        change: impl Fn(usize, usize, &mut FrameEstimate) -> Option<RejectionReason>,
        function: impl FnOnce(&Setup, &[StraightShard]) -> T,
    ) -> T {
        let grey = DynamicImage::new_luma8(32, 24);
        let frames = FrameSet::in_memory((0..FRAMES).map(|_| grey.clone()));
        let initial = (0..FRAMES).map(|k| StampedPose {
            time_s: k as f64,
            pose: truth(k).pose,
        });
        let initial: Vec<StampedPose> = initial.collect();
        let jitter = Jitter {
            model: JitterModel::RandomWalk,
            rotation_sigma_rad: 0.03,
            translation_sigma_m: [0.02; 3],
        };
        let camera = Camera::from_vertical_fov(32, 24, 1.0);
        let wall = Arc::new(Circle::new(3.0).unwrap());
        let input = RefineInput::new(camera, wall, &frames, &initial, jitter);
        let options = RefineOptions::default();
        let setup = Setup::new(input, &options).unwrap();
        let stretch = |number: usize| {
            let shard = Shard::new(number, STRETCHES, FRAMES, 1).unwrap();
            let of_frame = |frame: usize| {
                let mut estimate = without(&difference(number), &truth(frame));
                let rejection = change(number, frame, &mut estimate);
                (estimate, rejection)
            };
            let (estimates, rejections) = shard.frames.clone().map(of_frame).unzip();
            let state = PipelineState {
                frames: FrameStates {
                    estimates,
                    rejections,
                    kappa: Kappa::zeros(),
                },
                ..begin(&setup)
            };
            let snapshot = Snapshot {
                state,
                light: Light::Even,
                hidden_bands: Vec::new(),
                timings: Vec::new(),
                elapsed_s: 0.0,
            };
            let end = ShardEnd {
                snapshot: Box::new(snapshot),
                bend_per_m: [0.0; 2],
            };
            StraightShard {
                shard,
                end: Some(end),
            }
        };
        let stretches: Vec<StraightShard> = (1..=STRETCHES).map(stretch).collect();
        function(&setup, &stretches)
    }

    #[test]
    fn stretches_of_known_gauges_make_the_survey() {
        let reason = |number: usize, frame: usize, _: &mut FrameEstimate| {
            let is_repeated = frame == 431 && number == 3;
            is_repeated.then_some(RejectionReason::Repeated(430 - (400 - 80)))
        };
        with_stretches(reason, |setup, stretches| {
            let joined = join_frames(setup, stretches).unwrap();
            assert_eq!(joined.states.estimates.len(), FRAMES);
            for (k, found) in joined.states.estimates.iter().enumerate() {
                let expected = truth(k);
                assert!(found.pose.local(&expected.pose).norm() < 1e-9, "{k}");
                assert!((found.log_gain - expected.log_gain).abs() < 1e-9, "{k}");
                assert!((found.bias - expected.bias).abs() < 1e-9, "{k}");
            }
            let rejected = &joined.states.rejections;
            assert_eq!(rejected[431], Some(RejectionReason::Repeated(430)));
            assert_eq!(rejected.iter().flatten().count(), 1);
            assert!(joined.displaced.is_empty());
            for (k, alignment) in joined.alignments.iter().enumerate() {
                let off = alignment.motion.plus(-1.0, &difference(k + 1).motion);
                assert!(off.turn_rad.abs() < 1e-9 && off.shift_m.abs() < 1e-9);
            }
        });
    }

    #[test]
    fn frames_that_stretches_place_apart_are_named_and_too_many_are_an_error() {
        // Pixels are 15 cm wide.
        let displaced = |from: usize| {
            move |number: usize, frame: usize, estimate: &mut FrameEstimate| {
                if number == 2 && (from..215).contains(&frame) {
                    estimate.pose.t_wc.y += 0.4 * if frame.is_multiple_of(2) { 1.0 } else { -1.0 };
                }
                None
            }
        };
        with_stretches(displaced(211), |setup, stretches| {
            let joined = join_frames(setup, stretches).unwrap();
            let frames: Vec<usize> = joined.displaced.iter().map(|(k, _)| *k).collect();
            assert_eq!(frames, [211, 212, 213, 214]);
        });
        with_stretches(displaced(120), |setup, stretches| {
            let Err(error) = join_frames(setup, stretches).map(|_| ()) else {
                panic!("joined");
            };
            let message = error.to_string();
            assert!(
                message.contains("shards 1 and 2 place frames 160 to 239"),
                "{message}"
            );
        });
    }

    #[test]
    fn without_common_frames_the_initial_step_leads_on() {
        let dark = |_: usize, frame: usize, _: &mut FrameEstimate| {
            (150..250)
                .contains(&frame)
                .then_some(RejectionReason::Featureless)
        };
        with_stretches(dark, |setup, stretches| {
            let joined = join_frames(setup, stretches).unwrap();
            let pose = joined.states.estimates[FRAMES - 1].pose;
            assert!(pose.local(&truth(FRAMES - 1).pose).norm() < 1e-9);
        });
    }
}
