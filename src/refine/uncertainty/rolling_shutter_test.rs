//! Do the frames look as if their rows were read in another time than given?
//!
//! A camera that moves while rows are read puts what it sees ever farther off from row to row, by
//! the time since the middle row. Poses take up most of that where it is ignored: frames roll, and
//! the whole wall is wound around the axis a little. What they cannot take up is the same in all
//! frames, a residual along the rows. It is asked for in one number: the readout time with which
//! the frames fit best, with everything else free ([`crate::refine::linear::bordered_system`]), and how sure it is. The lens
//! is free, too, as far as it usually may be off: a wrong one must not pass for a wrong time.

use crate::refine::model::context::EstimationContext;
use crate::refine::model::frame_states::FrameStates;
use crate::refine::model::problem_error::ProblemError;
use crate::refine::options::RefineOptions;
use crate::refine::parameters::calibration::{
    Calibration, INTRINSIC_PARAMETERS, Kappa, READOUT_INDEX,
};
use crate::refine::problem::photometric_problem::PhotometricProblem;
use crate::refine::samples::sampling::Sampling;
use crate::refine::solver::argmin_glue::solve;
use crate::refine::solver::stopping::Stopping;
use crate::refine::uncertainty::observability::Posterior;
use crate::surface::viewing_distance;
use crate::survey::{CalibrateSection, CalibrationGroup};
use nalgebra::Vector3;
use serde::Serialize;

/// Frames that are asked, at the most: those in the middle of the survey.
const MOST_FRAMES: usize = 120;
/// Steps at the most, and when one is the last; where the given time is right, the first is.
const STOPPING: Stopping = Stopping {
    max_iterations: 4,
    step_px: 0.02,
    step_sigma: 1.0,
};
/// A difference of the time is systematic if it is this many times its 1-σ, ...
const SURE: f64 = 6.0;
/// ... and shifts the picture's rows against one another by this much from the first to the last,
/// pixels.
const LEAST_SHIFT_PX: f64 = 0.5;

/// The readout time that the frames want.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct ReadoutEstimate {
    /// Time from reading a frame's first row to reading its last as given, milliseconds; 0 for a
    /// global shutter.
    pub given_ms: f64,
    /// The same with which the frames fit best.
    pub estimate_ms: f64,
    /// 1-σ of that.
    pub sigma_ms: f64,
    /// How far the difference shifts the first row against the last, pixels in the middle of the
    /// median frame.
    pub shift_px: f64,
    /// True if that is a systematic error.
    pub systematic: bool,
}

/// Asks the frames for their readout time; None if they cannot tell.
///
/// # Errors
/// [`ProblemError`] for a frame that cannot be read.
pub fn estimate_readout(
    scene: &EstimationContext,
    options: &RefineOptions,
    tracked: &FrameStates,
) -> Result<Option<ReadoutEstimate>, ProblemError> {
    let count = tracked.estimates.len();
    let first = count.saturating_sub(MOST_FRAMES) / 2;
    let run = first..(first + MOST_FRAMES).min(count);
    let calibration = with_readout(scene);
    let scene = &EstimationContext {
        calibration,
        ..*scene
    };
    let sampling = Sampling {
        information: options.intermediate_information,
        ..Sampling::of(options.handover_level(scene.camera.shorter_side()))
    };
    let members = tracked.window_of(run.clone(), run.clone());
    let problem = PhotometricProblem::new(scene, sampling, members)?.with_shared_parameters();
    if problem.tiles() == 0 {
        return Ok(None);
    }
    let solution = match solve(problem, STOPPING) {
        Ok(solution) => solution,
        Err(ProblemError::Factor { .. }) => return Ok(None),
        Err(error) => return Err(error),
    };
    let Ok(Some(posterior)) = Posterior::at(&solution) else {
        return Ok(None);
    };
    let Some(covariance) = posterior.covariance(&calibration.free) else {
        return Ok(None);
    };
    let found = |kappa: &Kappa| 1e3 * calibration.readout_s(kappa);
    let (given_ms, estimate_ms) = (found(&scene.kappa), found(&solution.kappa));
    let sigma_ms = 1e3 * covariance[(READOUT_INDEX, READOUT_INDEX)].sqrt();
    let off_ms = estimate_ms - given_ms;
    let shift_px = 1e-3 * off_ms.abs() * shift_px_per_s(scene, tracked);
    let sure = off_ms.abs() > SURE * sigma_ms;
    Ok(sigma_ms.is_finite().then_some(ReadoutEstimate {
        given_ms,
        estimate_ms,
        sigma_ms,
        shift_px,
        systematic: sure && shift_px > LEAST_SHIFT_PX,
    }))
}

/// What is estimated of the scene's calibration, the lens, and the readout time.
fn with_readout(scene: &EstimationContext) -> Calibration {
    use CalibrationGroup::{Centre, Distortion, Focal};
    let mut calibration = scene.calibration.intrinsics_only();
    let section = CalibrateSection::default();
    let usual = Calibration::new(&[Focal, Centre, Distortion], &section, &scene.camera, &[]);
    for k in (0..INTRINSIC_PARAMETERS).filter(|k| !scene.calibration.free[*k]) {
        (calibration.free[k], calibration.sigma[k]) = (true, usual.sigma[k]);
    }
    // Any time between frames is possible.
    calibration.free[READOUT_INDEX] = true;
    calibration.sigma[READOUT_INDEX] = scene.prior.median_step_s;
    calibration
}

/// How far the first row is shifted against the last in the middle of the median frame if the
/// readout takes a second, pixels.
fn shift_px_per_s(scene: &EstimationContext, tracked: &FrameStates) -> f64 {
    let all = 0..tracked.estimates.len();
    let between = 1.0 - 1.0 / f64::from(scene.camera.height);
    let shift = |k: usize| {
        let pose = &tracked.estimates[k].pose;
        let x_c = Vector3::z() * viewing_distance(scene.surface, pose).ok()?;
        let rate = scene.sweep_rate(k, &all, &tracked.estimates);
        let moved = rate.omega_rad.cross(&x_c) + rate.nu_m;
        Some((scene.camera.project_jacobian(&x_c) * moved).norm() * between)
    };
    let mut shifts: Vec<f64> = all.clone().filter_map(shift).collect();
    shifts.sort_unstable_by(f64::total_cmp);
    shifts.get(shifts.len() / 2).copied().unwrap_or_default()
}
