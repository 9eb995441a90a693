//! Rolling-shutter test: whether the frames fit better with another readout time than the one
//! given.
//!
//! A camera that moves while rows are read displaces what it sees, more from row to row, in
//! proportion to the time since the middle row. Where this is ignored, poses take up most of it:
//! frames roll, and the whole wall is wound around the axis a little. The rest is the same in all
//! frames, a residual along the rows. It is estimated as one number, the readout time with which
//! the frames fit best, with everything else free ([`crate::linear::bordered_system`]). The
//! intrinsics and the curvature of a straight tunnel are free, too, within their usual uncertainty,
//! so that a wrong lens or a bend does not pass for a wrong time.

use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::options::RefineOptions;
use crate::parameters::calibration::{
    BEND_INDEX, BEND_PARAMETERS, Calibration, INTRINSIC_PARAMETERS, Kappa, READOUT_INDEX,
};
use crate::problem::photometric_problem::PhotometricProblem;
use crate::samples::sampling::Sampling;
use crate::solver::argmin_glue::solve;
use crate::solver::stopping::Stopping;
use crate::thresholds::rolling_shutter_test::MIN_DIFFERENCE_SIGMA;
use crate::uncertainty::observability::Posterior;
use nalgebra::Vector3;
use serde::Serialize;
use tunnelstitch_core::survey::{CalibrateSection, CalibrationGroup};
use tunnelstitch_geometry::numerics::median::upper_median;
use tunnelstitch_geometry::surface::viewing_distance;

/// Number of frames that are used, from the middle of the survey: ten turns of them determine the
/// readout time far better than poses show it.
const MAX_FRAMES: usize = 120;

/// The readout time with which the frames fit best.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct ReadoutEstimate {
    /// Time from reading a frame's first row to reading its last as given, milliseconds; 0 for a
    /// global shutter.
    pub given_ms: f64,
    /// The readout time with which the frames fit best, milliseconds.
    pub estimate_ms: f64,
    /// 1-σ of the estimate, milliseconds.
    pub sigma_ms: f64,
    /// Displacement of the first row against the last by the difference, pixels in the middle of
    /// the median frame.
    pub shift_px: f64,
    /// True if the difference is a systematic error.
    pub systematic: bool,
}

/// Estimates the readout time; None if the frames do not observe it.
///
/// # Errors
/// [`ProblemError`] for a frame that cannot be read.
pub fn estimate_readout(
    context: &EstimationContext,
    options: &RefineOptions,
    states: &FrameStates,
) -> Result<Option<ReadoutEstimate>, ProblemError> {
    // Between neighbouring frames of a rig it is not the camera that moves.
    if context.cameras.is_rig() {
        return Ok(None);
    }
    let count = states.estimates.len();
    let first = count.saturating_sub(MAX_FRAMES) / 2;
    let frame_range = first..(first + MAX_FRAMES).min(count);
    let calibration = free_readout(context);
    let context = &EstimationContext {
        calibration: calibration.clone(),
        ..context.clone()
    };
    let level = options.handover_level(context.cameras.shorter_side());
    let window = states.window_of(frame_range.clone(), frame_range);
    let problem =
        PhotometricProblem::new(context, Sampling::of(level), window)?.with_shared_parameters();
    if problem.tiles() == 0 {
        return Ok(None);
    }
    let stopping = Stopping {
        step_sigma: options.step_tolerance_sigma,
        ..Stopping::intermediate(options, level)
    };
    let solution = match solve(problem, stopping) {
        Ok(solution) => solution,
        Err(ProblemError::Factor { .. }) => return Ok(None),
        Err(error) => return Err(error),
    };
    let scatter = solution.problem.score_scatter(&solution.linearisation);
    let at_end = (&solution.linearisation, &solution.linearised_at);
    let (problem, unknowns) = (&solution.problem, &solution.unknowns);
    let posterior = match Posterior::with_curvature(problem, at_end, unknowns, &scatter) {
        Ok((_, Some(posterior), _)) => posterior,
        Ok((_, None, _)) | Err(ProblemError::Factor { .. }) => return Ok(None),
        Err(error) => return Err(error),
    };
    let Some(covariance) = posterior.covariance(&calibration.free) else {
        return Ok(None);
    };
    let readout_ms = |kappa: &Kappa| 1e3 * calibration.readout_s(kappa);
    let (given_ms, estimate_ms) = (
        readout_ms(&context.kappa),
        readout_ms(&solution.unknowns.kappa),
    );
    let sigma_ms = 1e3 * covariance[(READOUT_INDEX, READOUT_INDEX)].sqrt();
    let difference_ms = estimate_ms - given_ms;
    let shift_px = 1e-3 * difference_ms.abs() * shift_px_per_s(context, states);
    let is_significant = difference_ms.abs() > MIN_DIFFERENCE_SIGMA * sigma_ms;
    Ok(sigma_ms.is_finite().then_some(ReadoutEstimate {
        given_ms,
        estimate_ms,
        sigma_ms,
        shift_px,
        // As far as two frames may be displaced that are registered.
        systematic: is_significant && shift_px > 2.0 * options.max_sigma_px,
    }))
}

/// The calibration with the intrinsics, the readout time and, in a straight tunnel, the curvature
/// free, besides what is free already.
fn free_readout(context: &EstimationContext) -> Calibration {
    use CalibrationGroup::{Centre, Distortion, Focal};
    let mut calibration = context.calibration.clone().intrinsics_only();
    let section = CalibrateSection::default();
    let intrinsics = Calibration::new(
        &[Focal, Centre, Distortion],
        &section,
        &context.cameras,
        &[],
    );
    let is_held = |k: &usize| intrinsics.free[*k] && !context.calibration.free[*k];
    for k in (0..INTRINSIC_PARAMETERS).filter(is_held) {
        (calibration.free[k], calibration.sigma[k]) = (true, intrinsics.sigma[k]);
    }
    let may_bend = context.gauge().shift;
    calibration.free[BEND_INDEX..BEND_INDEX + BEND_PARAMETERS].fill(may_bend);
    // Any time up to that between frames is possible.
    calibration.free[READOUT_INDEX] = true;
    calibration.sigma[READOUT_INDEX] = context.prior.median_step_s;
    calibration
}

/// Displacement of the first row against the last in the middle of the median frame if the readout
/// takes a second, pixels.
fn shift_px_per_s(context: &EstimationContext, states: &FrameStates) -> f64 {
    let all = 0..states.estimates.len();
    let camera = context.cameras.of(0);
    let row_share = 1.0 - 1.0 / f64::from(camera.height);
    let shift = |k: usize| {
        let pose = &states.estimates[k].pose;
        let x_c = Vector3::z() * viewing_distance(context.surface.as_ref(), camera, pose).ok()?;
        let rate = context.sweep_rate(k, &all, &states.estimates);
        let moved = rate.omega_rad.cross(&x_c) + rate.nu_m;
        Some((camera.project_jacobian(&x_c) * moved).norm() * row_share)
    };
    upper_median(all.clone().filter_map(shift).collect()).unwrap_or_default()
}
