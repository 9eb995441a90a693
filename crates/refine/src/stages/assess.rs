//! Stage: states the uncertainty and the verdict of every frame, and writes the report.

use crate::comparison::inconsistent_frames::FrameComparison;
use crate::error::RefineError;
use crate::model::context::EstimationContext;
use crate::model::frame_states::{FrameStates, majority, reject_placed};
use crate::model::problem_error::ProblemError;
use crate::model::rejection::RejectionReason;
use crate::parameters::calibration::{BEND_INDEX, BEND_PARAMETERS, Calibration, Kappa};
use crate::parameters::frame_estimate::FrameEstimate;
use crate::problem::linearisation::FrameContribution;
use crate::refined::Refined;
use crate::report::FrameReport;
use crate::solver::gauss_newton::Solution;
use crate::stages::placement::{Placement, ReportParts};
use crate::stages::session::Session;
use crate::stages::setup::Setup;
use crate::stages::state::{Estimation, LastSolve, PipelineState};
use crate::uncertainty::calibration_report::CalibrationReport;
use crate::uncertainty::covariance::Covariances;
use crate::uncertainty::frame_sigma::FrameSigma;
use crate::uncertainty::rolling_shutter_test::estimate_readout;
use crate::uncertainty::shape_report::{EstimatedShape, ShapeReport};
use crate::uncertainty::solution_uncertainty::SolutionUncertainty;
use crate::verdict::frame_verdict::FrameEvidence;

/// Runs the stage on the last full-size solve.
///
/// # Errors
/// [`RefineError::NoOverlap`] if nothing could be solved at full size; a frame that cannot be read.
pub fn run<'a>(
    setup: &'a Setup<'a>,
    mut estimation: Estimation<'a>,
    session: &mut Session,
) -> Result<Estimation<'a>, RefineError> {
    let last = estimation.solution.take().ok_or(RefineError::NoOverlap)?;
    session.progress.start("covariance", 1);
    let state = &mut estimation.state;
    let context = setup.context(state);
    reject_inconsistent(setup, &context, state)?;
    let readout = estimate_readout(&context, setup.options, &state.frames)?;
    let LastSolve {
        solution,
        uncertainty,
        stopping,
    } = last;
    let sigmas = frame_sigmas(&context, &state.frames, &uncertainty);
    judge(setup, &solution, &sigmas, &mut state.frames.rejections);
    let calibration = setup.calibration_at(state);
    let datum = calibration.datum(&context.kappa);
    let held = setup.wall.as_ref().filter(|_| state.shape.is_none());
    let shape = match held {
        Some(wall) => EstimatedShape::held(&context, &wall.shape.model, wall.error_draws.clone()),
        None => EstimatedShape::new(
            &context,
            state.shape.as_ref(),
            uncertainty.total.as_ref(),
            setup.count(),
        ),
    };
    let shape_of = state.shape.as_ref().or(held.map(|wall| &wall.shape));
    let model = shape_of.map(|shape| &shape.model);
    let shape_report = model.map(|model| ShapeReport::new(model, shape.as_ref()));
    let placement = Placement::new(
        setup,
        &datum,
        (&state.frames.estimates, shape),
        &uncertainty.covariances,
        state.frames.rejections.clone(),
    );
    session.progress.finish();
    session.record_time("covariance");
    let frames = (0..setup.count()).map(|k| FrameReport {
        points: solution.linearisation.frames[k].samples,
        residual: residual(&solution.linearisation.frames[k]),
        inlier_share: inlier_share(&solution.linearisation.frames[k]),
        gain: solution.unknowns.frames[k].log_gain.exp(),
        bias: solution.unknowns.frames[k].bias,
        overdispersion_px: uncertainty.overdispersions[k].px,
        ..placement.report_frame(setup, k, sigmas[k])
    });
    let record = &solution.record;
    let parts = ReportParts {
        frames: frames.collect(),
        stopped_because: record.stop.explain(&stopping, record.last_step_px),
        levels: std::mem::take(&mut state.levels),
        rolling_shutter: readout,
        model_error: uncertainty.model_error,
        shape: shape_report,
        bend_sigma_per_m: bend_sigma_per_m(setup, state, &uncertainty),
        masked: Some(solution.problem.masked_wall()),
        calibration: report_calibration(setup, &calibration, &context.kappa, &uncertainty, state),
        timings: std::mem::take(&mut session.timings),
    };
    estimation.refined = Some(placement.refined(setup, parts));
    Ok(estimation)
}

/// The result where frames have no solution, for this reason if they are not rejected for others:
/// the initial poses.
pub fn without_solution(
    setup: &Setup,
    session: &mut Session,
    reason: &RejectionReason,
    mut rejections: Vec<Option<RejectionReason>>,
) -> Refined {
    let count = setup.count();
    let unknown = Covariances::unknown(count);
    let estimates: Vec<FrameEstimate> = setup
        .prior
        .initial
        .iter()
        .map(|pose| FrameEstimate::at(*pose))
        .collect();
    let datum = setup.calibration.datum(&Kappa::zeros());
    reject_placed(&mut rejections, reason);
    let placement = Placement::new(setup, &datum, (&estimates, None), &unknown, rejections);
    let frames = (0..count).map(|k| placement.report_frame(setup, k, FrameSigma::unknown()));
    let parts = ReportParts {
        frames: frames.collect(),
        stopped_because: reason.to_string(),
        levels: Vec::new(),
        rolling_shutter: None,
        model_error: None,
        shape: None,
        bend_sigma_per_m: None,
        masked: None,
        calibration: None,
        timings: std::mem::take(&mut session.timings),
    };
    placement.refined(setup, parts)
}

/// Rejects frames that the others do not support at full size.
fn reject_inconsistent(
    setup: &Setup,
    context: &EstimationContext,
    state: &mut PipelineState,
) -> Result<(), ProblemError> {
    let comparison = FrameComparison::of(context, setup.handover_level(), &state.frames)?;
    for (frame, rejection) in comparison.inconsistencies() {
        state.frames.rejections[frame].get_or_insert(rejection);
    }
    Ok(())
}

/// 1-σ of every frame.
fn frame_sigmas(
    context: &EstimationContext,
    frames: &FrameStates,
    uncertainty: &SolutionUncertainty,
) -> Vec<FrameSigma> {
    let estimates = frames.estimates.iter().enumerate();
    estimates
        .map(|(k, estimate)| uncertainty.frame_sigma(context, k, estimate))
        .collect()
}

/// Decides about every frame that no earlier test has rejected; none is photometric without a
/// [`majority`].
fn judge(
    setup: &Setup,
    solution: &Solution,
    sigmas: &[FrameSigma],
    rejections: &mut [Option<RejectionReason>],
) {
    let [width, height] = setup.input.cameras.size().map(f64::from);
    // They are counted at the level of the solve.
    let all_pixels = width * height / solution.problem.pixel_px().powi(2);
    for (k, rejection) in rejections.iter_mut().enumerate() {
        let evidence = FrameEvidence {
            rejection: rejection.take(),
            contribution: &solution.linearisation.frames[k],
            all_pixels,
            sigma: sigmas[k],
        };
        *rejection = evidence.judge(setup.options);
    }
    if let Err(reason) = majority(rejections) {
        reject_placed(rejections, &reason);
    }
}

/// 1-σ of the curvature, 1/m, if it was estimated, from frames or from points.
fn bend_sigma_per_m(
    setup: &Setup,
    state: &PipelineState,
    uncertainty: &SolutionUncertainty,
) -> Option<[f64; BEND_PARAMETERS]> {
    let wall = setup.wall.as_ref();
    if let Some((_, sigma_per_m)) = wall.and_then(|wall| wall.bend) {
        return Some(sigma_per_m);
    }
    let covariance = uncertainty.shared.filter(|_| state.free[BEND_INDEX])?;
    Some(std::array::from_fn(|k| {
        covariance[(BEND_INDEX + k, BEND_INDEX + k)].sqrt()
    }))
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

/// Root mean square residual of a frame, grey levels.
fn residual(contribution: &FrameContribution) -> f64 {
    (contribution.square / contribution.inliers.max(1e-9)).sqrt()
}

/// Share of a frame's pixels' weight that the robust loss left.
fn inlier_share(contribution: &FrameContribution) -> f64 {
    contribution.inliers / contribution.pixels.max(1e-9)
}
