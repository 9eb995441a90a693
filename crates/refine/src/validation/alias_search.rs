//! Search for aliases: gauge motions after which a frame matches the wall as well as it does now.

use crate::comparison::unexplained::Unexplained;
use crate::comparison::unwrapped_frame::UnwrappedFrame;
use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::options::RefineOptions;
use crate::thresholds::footprints::MAX_OVERLAP_DISTANCE_FRAMES;
use crate::tracking::correlation_search::{
    MIN_SEPARATION_SAMPLES, MIN_SQUARED_CORRELATION_LEFT, find_matching_shifts, min_samples,
};
use crate::tracking::neighbours::Neighbours;
use crate::tracking::reference_mosaic::ReferenceMosaic;
use crate::tracking::registration::MAX_DEVIATION_COST;
use nalgebra::Vector2;
use tunnelstitch_geometry::surface::{Footprint, GaugeMotion, gauge_component};
use tunnelstitch_geometry::trajectory::Pose;

/// Number of times that the step of the search for the best fraction of a sample is halved: the
/// last one is a sixteenth of a sample.
const SHIFT_REFINEMENTS: usize = 4;

/// Finds the gauge motions (rotations about the axis, translations along it) within the prior's
/// reach after which frame `frame` matches what the others show as well as it does now.
///
/// # Errors
/// [`ProblemError`].
pub fn find_alias_motions(
    context: &EstimationContext,
    options: &RefineOptions,
    frame: usize,
    states: &FrameStates,
    footprints: &[Footprint],
) -> Result<Vec<GaugeMotion>, ProblemError> {
    let side = context.cameras.shorter_side();
    let level = options
        .handover_level(side)
        .max(options.coarsest_level(side).saturating_sub(1));
    let frame_range = frame.saturating_sub(MAX_OVERLAP_DISTANCE_FRAMES)
        ..(frame + MAX_OVERLAP_DISTANCE_FRAMES).min(states.estimates.len());
    let mut registered = states.inliers(&frame_range);
    registered[frame - frame_range.start] = false;
    let neighbours = Neighbours {
        estimates: &states.estimates[frame_range.clone()],
        registered: &registered,
        footprints: &footprints[frame_range.clone()],
        frame_range,
    };
    let pose = states.estimates[frame].pose;
    let reach_m = reach_m(context);
    let margin_m = reach_m[0].max(reach_m[1]);
    let overlapping = neighbours.find_overlapping(context, frame, &pose, margin_m)?;
    let unwrapped_frames = neighbours.unwrap_frames(context, level, &overlapping)?;
    if unwrapped_frames.is_empty() {
        return Ok(Vec::new());
    }
    let camera = context.cameras.of(frame).at_level(level);
    let sweep = neighbours.sweep(context, frame);
    let unwrapped = UnwrappedFrame::new(context, level, frame, &sweep)?;
    let target = (frame, &pose);
    let mosaic = ReferenceMosaic::new(context, &unwrapped_frames, &camera, target, margin_m)?;
    let comparison = Comparison {
        context,
        mosaic: &mosaic,
        unwrapped: &unwrapped,
        pose: &pose,
    };
    let ncc_score = mosaic.compute_ncc(context, &unwrapped, &pose);
    let Some(present) = Unexplained::of(&ncc_score, min_samples(&unwrapped)) else {
        return Ok(Vec::new());
    };
    let min_squared_correlation =
        MIN_SQUARED_CORRELATION_LEFT * present.min_squared_correlation(ncc_score.texture_share());
    let shifts = find_matching_shifts(&mosaic, &unwrapped, &pose, reach_m, min_squared_correlation);
    let spacing_m = mosaic.grid.spacing_m;
    let mut motions = Vec::new();
    for shift_m in shifts {
        // Where the shape of the tunnel forbids a motion, no alias is reached by it.
        let (made_m, _) = comparison.motion(shift_m);
        let missed_m = (made_m - Vector2::from(shift_m)).norm();
        if shift_m[0].hypot(shift_m[1]) < MIN_SEPARATION_SAMPLES * spacing_m
            || missed_m > MIN_SEPARATION_SAMPLES * spacing_m
        {
            continue;
        }
        let (unexplained, shift_m) = comparison.refine_shift(shift_m, spacing_m);
        let (made_m, motion) = comparison.motion(shift_m);
        if unexplained.is_some_and(|there| present.is_matched_by(&there))
            && made_m.norm() >= MIN_SEPARATION_SAMPLES * spacing_m
        {
            motions.push(motion);
        }
    }
    Ok(motions)
}

/// Largest shifts along s and h that the prior allows, metres.
fn reach_m(context: &EstimationContext) -> [f64; 2] {
    let radius_m = context.surface.perimeter_m() / std::f64::consts::TAU;
    let jitter = &context.prior.jitter;
    let max_sigma = (2.0 * MAX_DEVIATION_COST).sqrt();
    [
        (max_sigma * jitter.rotation_sigma_rad).min(std::f64::consts::PI) * radius_m,
        (max_sigma * jitter.translation_sigma_m[1]).min(std::f64::consts::PI * radius_m),
    ]
}

/// A frame and the reference mosaic that it is compared with at shifted poses.
struct Comparison<'a> {
    context: &'a EstimationContext<'a>,
    mosaic: &'a ReferenceMosaic,
    unwrapped: &'a UnwrappedFrame,
    pose: &'a Pose,
}

impl Comparison<'_> {
    /// The gauge motion closest to a shift on the wall, with the shift that it makes.
    fn motion(&self, shift_m: [f64; 2]) -> (Vector2<f64>, GaugeMotion) {
        gauge_component(self.context.surface.as_ref(), self.pose, &shift_m.into())
    }

    /// Unexplained shares at a shift on the wall; None if too few samples are shared, or the two do
    /// not correlate.
    fn unexplained(&self, shift_m: [f64; 2]) -> Option<Unexplained> {
        let pose = self.motion(shift_m).1.apply(self.pose);
        let ncc_score = self.mosaic.compute_ncc(self.context, self.unwrapped, &pose);
        Unexplained::of(&ncc_score, min_samples(self.unwrapped))
    }

    /// Refines a shift to a fraction of a sample by pattern search: the best of ever closer
    /// neighbours. Returns it with its unexplained shares.
    fn refine_shift(&self, shift_m: [f64; 2], spacing_m: f64) -> (Option<Unexplained>, [f64; 2]) {
        let mut best = (self.unexplained(shift_m), shift_m);
        let mut step = 0.5 * spacing_m;
        for _ in 0..SHIFT_REFINEMENTS {
            let [s_m, h_m] = best.1;
            for (ds, dh) in [(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0)] {
                let shift_m = [s_m + ds * step, h_m + dh * step];
                let there = self.unexplained(shift_m);
                if there
                    .is_some_and(|there| best.0.is_none_or(|best| there.contrast < best.contrast))
                {
                    best = (there, shift_m);
                }
            }
            step *= 0.5;
        }
        best
    }
}
