//! Stage: states the uncertainty and the verdict of every frame, and writes the report.

use crate::error::RefineError;
use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::model::rejection::RejectionReason;
use crate::parameters::calibration::{Calibration, Datum, Kappa};
use crate::parameters::frame_estimate::FrameEstimate;
use crate::problem::linearisation::FrameContribution;
use crate::refined::Refined;
use crate::report::{FrameFlag, FrameReport, PoseReport, RefineReport};
use crate::solver::gauss_newton::Solution;
use crate::stages::session::Session;
use crate::stages::setup::Setup;
use crate::stages::state::{Estimation, PipelineState};
use crate::thresholds::assessment::{MAX_SIGMA_PX, MAX_STEP_PX, MAX_STEP_SIGMA, MIN_PIXEL_SHARE};
use crate::tracking::pose_separation::separation_m;
use crate::uncertainty::calibration_report::CalibrationReport;
use crate::uncertainty::frame_sigma::FrameSigma;
use crate::uncertainty::rolling_shutter_test::estimate_readout;
use crate::uncertainty::solution_uncertainty::SolutionUncertainty;
use crate::validation::inconsistent_frames::{find_disagreement, find_inconsistent_frames};
use crate::validation::pairwise_lucas_kanade::align_pairs;
use tunnelstitch_core::frames::FrameSet;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::surface::GaugeMotion;
use tunnelstitch_geometry::trajectory::{StampedPose, Trajectory};

/// Runs the stage on the last full-size solve.
///
/// # Errors
/// [`RefineError::NoOverlap`] if nothing could be solved at full size; a frame that cannot be read.
pub fn run<'a>(
    setup: &'a Setup<'a>,
    mut estimation: Estimation<'a>,
    session: &mut Session,
) -> Result<Estimation<'a>, RefineError> {
    let (solution, stopping) = estimation.solution.take().ok_or(RefineError::NoOverlap)?;
    session.progress.start("covariance", 1);
    let state = &mut estimation.state;
    let context = setup.context(state);
    reject_finally(setup, &context, state)?;
    let readout = estimate_readout(&context, setup.options, &state.frames)?;
    let calibration = setup.calibration_at(state);
    let uncertainty = SolutionUncertainty::at(&context, &solution, &calibration)?;
    let metric = calibration.datum(&context.kappa);
    let estimates = &state.frames.estimates;
    let motion = setup
        .prior
        .align_gauge(&context.surface.gauge(), estimates, &metric);
    for rejection in state.frames.rejections.iter_mut().flatten() {
        if let RejectionReason::Ambiguous { other, .. } = rejection {
            *other = metric.to_metres(&motion.apply(other));
        }
    }
    let frames = report_frames(setup, &context, &state.frames, &solution, &uncertainty);
    session.progress.finish();
    session.record_time("covariance");
    let on_prior = frames
        .iter()
        .filter(|frame| frame.flag != FrameFlag::Photometric);
    let record = &solution.record;
    let report = RefineReport {
        stopped_because: record.stop.explain(&stopping, record.last_step_px),
        frames_on_prior: on_prior.count(),
        frames,
        levels: std::mem::take(&mut state.levels),
        rolling_shutter: readout,
        variance_factor: uncertainty.covariances.variance_factor,
        calibration: report_calibration(setup, &calibration, &context.kappa, &uncertainty, state),
        timings: std::mem::take(&mut session.timings),
    };
    estimation.refined = Some(Refined {
        trajectory: trajectory(setup.input.initial, &state.frames, &metric, &motion),
        report,
        covariances: uncertainty.covariances.moved(&motion).scaled(metric.scale),
    });
    Ok(estimation)
}

/// Rejects frames with an alias that the prior does not exclude, and frames that the others do not
/// support at full size.
fn reject_finally(
    setup: &Setup,
    context: &EstimationContext,
    state: &mut PipelineState,
) -> Result<(), ProblemError> {
    let (count, finest) = (setup.count(), setup.handover_level());
    let pairs = align_pairs(context, finest, &state.frames, &(0..count))?;
    let inconsistent = find_inconsistent_frames(&pairs, count);
    let aliases = std::mem::take(&mut state.aliases).into_iter();
    let ambiguous = aliases.map(|(frame, motion)| {
        let pose = &state.frames.estimates[frame].pose;
        let other = motion.apply(pose);
        let separation_m = separation_m(context.surface, &context.camera, pose, &other);
        let ambiguous = RejectionReason::Ambiguous {
            other,
            separation_m,
        };
        (frame, ambiguous)
    });
    let found: Vec<(usize, RejectionReason)> = ambiguous.chain(inconsistent).collect();
    for (frame, rejection) in found {
        state.frames.rejections[frame].get_or_insert(rejection);
    }
    Ok(())
}

/// The report of every frame.
fn report_frames(
    setup: &Setup,
    context: &EstimationContext,
    frames: &FrameStates,
    solution: &Solution,
    uncertainty: &SolutionUncertainty,
) -> Vec<FrameReport> {
    let count = setup.count();
    // Without a covariance there is no step either; its lack is reported already.
    let steps_px = steps_left(solution).unwrap_or_else(|_| vec![0.0; count]);
    let rejections = uncertainty.reject_overdispersed(frames.rejections.clone());
    let reports = rejections.into_iter().enumerate().map(|(k, rejection)| {
        let sigma = uncertainty.frame_sigma(context, k, &frames.estimates[k]);
        let rejection = rejection
            .or_else(|| final_rejection(&setup.input.camera, k, solution, steps_px[k], &sigma));
        let overdispersion_px = uncertainty.overdispersions[k].px;
        report_frame(
            setup.input.frames,
            k,
            solution,
            rejection,
            sigma,
            overdispersion_px,
        )
    });
    let mut reports: Vec<FrameReport> = reports.collect();
    demote_single_frame(&mut reports);
    reports
}

/// The report of the self-calibration, if there was one.
fn report_calibration(
    setup: &Setup,
    calibration: &Calibration,
    kappa: &Kappa,
    uncertainty: &SolutionUncertainty,
    state: &PipelineState,
) -> Option<CalibrationReport> {
    let any = calibration.has_free_parameters() || !state.unobservable.is_empty();
    any.then(|| {
        CalibrationReport::new(
            calibration,
            kappa,
            &uncertainty.shared.unwrap_or_default(),
            &state.unobservable,
            setup.input.nominal_radius_m,
        )
    })
}

/// The refined poses in metres, with the times of the initial ones.
fn trajectory(
    initial: &[StampedPose],
    frames: &FrameStates,
    metric: &Datum,
    motion: &GaugeMotion,
) -> Trajectory {
    let poses = initial.iter().zip(&frames.estimates);
    let poses = poses.map(|(initial, estimate)| StampedPose {
        time_s: initial.time_s,
        pose: metric.to_metres(&motion.apply(&estimate.pose)),
    });
    poses.collect()
}

/// Movement of each frame, pixels on the wall, in the undamped step that is left where the solve
/// ended for want of iterations or of descent.
///
/// # Errors
/// [`ProblemError::Factor`].
fn steps_left(solution: &Solution) -> Result<Vec<f64>, ProblemError> {
    let problem = &solution.problem;
    let linearisation = &solution.linearisation;
    let factor = problem
        .symbolic()
        .factorise(problem.pattern(), &linearisation.normal, 0.0)
        .map_err(|source| problem.factor_error(source))?;
    let step = factor.step(&linearisation.normal.gradient);
    Ok(problem.wall_step_px(&solution.estimates, &step, &Kappa::zeros()))
}

/// The rejection reason of a frame that no other test has rejected, if the solution gives one.
fn final_rejection(
    camera: &Camera,
    k: usize,
    solution: &Solution,
    step_px: f64,
    sigma: &FrameSigma,
) -> Option<RejectionReason> {
    let share: &FrameContribution = &solution.linearisation.frames[k];
    let all =
        f64::from(camera.width) * f64::from(camera.height) * solution.problem.compared_share();
    if share.pixels < MIN_PIXEL_SHARE * all {
        Some(RejectionReason::NoOverlap {
            share: share.pixels / all,
        })
    } else if let Some(rejection) = find_disagreement(share) {
        Some(rejection)
    } else if sigma.wall_px.is_nan() || sigma.wall_px > MAX_SIGMA_PX {
        Some(RejectionReason::Uncertain {
            wall_px: sigma.wall_px,
        })
    } else if step_px > MAX_STEP_PX.max(MAX_STEP_SIGMA * sigma.wall_px) {
        Some(RejectionReason::NotConverged { step_px })
    } else {
        None
    }
}

/// The report of one frame.
fn report_frame(
    frames: &FrameSet,
    k: usize,
    solution: &Solution,
    rejection: Option<RejectionReason>,
    sigma: FrameSigma,
    overdispersion_px: f64,
) -> FrameReport {
    let share: &FrameContribution = &solution.linearisation.frames[k];
    let estimate: &FrameEstimate = &solution.estimates[k];
    FrameReport {
        index: k,
        file: frames[k].name(),
        flag: match &rejection {
            None => FrameFlag::Photometric,
            Some(RejectionReason::Ambiguous { .. }) => FrameFlag::Ambiguous,
            Some(_) => FrameFlag::Prior,
        },
        other_pose: match &rejection {
            Some(RejectionReason::Ambiguous { other, .. }) => Some(PoseReport::from(other)),
            _ => None,
        },
        reason: rejection.map(|rejection| rejection.to_string()),
        points: share.samples,
        residual: (share.square / share.inliers.max(1e-9)).sqrt(),
        inlier_share: share.inliers / share.pixels.max(1e-9),
        gain: estimate.log_gain.exp(),
        bias: estimate.bias,
        sigma,
        overdispersion_px,
    }
}

/// Sets the flag of a single photometric frame to the prior: it agrees with no other.
fn demote_single_frame(reports: &mut [FrameReport]) {
    let photometric = |report: &&mut FrameReport| report.flag == FrameFlag::Photometric;
    let mut left = reports.iter_mut().filter(photometric);
    if let (Some(alone), None) = (left.next(), left.next()) {
        alone.flag = FrameFlag::Prior;
        alone.reason = Some(RejectionReason::Disconnected { frames: 1 }.to_string());
    }
}
