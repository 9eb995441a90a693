//! From a survey to refined poses: load, track, solve globally coarse to fine, report.

use super::covariance::{frame_covariances, frame_sigma};
use super::estimate::FrameEstimate;
use super::gauss_newton::{Solution, StopReason, Stopping, solve};
use super::options::RefineOptions;
use super::prior::Prior;
use super::problem::{FrameShare, Problem, ProblemError, Sampling, Scene};
use super::report::{FrameFlag, FrameReport, LevelReport, RefineReport, StageTime};
use super::track::track;
use crate::frames::{FrameError, Pyramid, load_grey};
use crate::progress::Progress;
use crate::survey::Survey;
use crate::trajectory::{StampedPose, Trajectory};
use nalgebra::Matrix6;
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Instant;

/// Why a survey cannot be refined.
#[derive(Debug, thiserror::Error)]
pub enum RefineError {
    /// A frame cannot be used.
    #[error(transparent)]
    Frames(#[from] FrameError),
    /// Nothing to compare with.
    #[error(
        "the survey has a single frame; refinement compares frames that overlap on the wall, so it needs two or more"
    )]
    SingleFrame,
    /// Nothing overlaps.
    #[error(
        "no two frames overlap on the wall by as much as a tile; check the initial poses, radius_m and the calibration's focal length, or take frames closer together"
    )]
    NoOverlap,
    /// The equations.
    #[error(transparent)]
    Problem(#[from] ProblemError),
}

/// Result of a refinement.
#[derive(Clone, Debug)]
pub struct Refined {
    /// Refined poses with the times of the initial ones.
    pub trajectory: Trajectory,
    /// What was done and how sure it is.
    pub report: RefineReport,
}

/// How much coarser the tolerances of all solves but the last are.
const CLOSE: f64 = 20.0;
/// Share of a frame's pixels that must overlap other frames for its pose to count as photometric.
const LEAST_PIXEL_SHARE: f64 = 0.02;
/// Largest 1-σ on the wall of a pose that counts as photometric, pixels.
const LARGEST_SIGMA_PX: f64 = 1.0;
/// Least share of a frame's weight that the robust loss must leave.
const LEAST_INLIER_SHARE: f64 = 0.8;

/// Refines the poses of `survey`.
///
/// The same input gives the same bytes whatever the number of threads.
///
/// # Errors
/// [`RefineError`].
pub fn refine(
    survey: &Survey,
    options: &RefineOptions,
    progress: &Arc<dyn Progress>,
) -> Result<Refined, RefineError> {
    let count = survey.frames.len();
    if count < 2 {
        return Err(RefineError::SingleFrame);
    }
    let mut clock = Clock::default();
    let side = survey.camera.shorter_side();
    let frames = load(survey, options.coarsest_level(side) + 1, progress.as_ref())?;
    clock.lap("decode");
    let prior = Prior {
        jitter: survey.prior,
        initial: survey.initial_poses(),
        log_gain_sigma: options.log_gain_sigma,
        bias_sigma: options.bias_sigma,
    };
    let scene = Scene {
        surface: survey.surface.as_ref(),
        camera: &survey.camera,
        frames: &frames,
        prior: &prior,
    };
    let mut estimates = track(&scene, options, progress.as_ref())?;
    clock.lap("track");

    let mut levels = Vec::new();
    let mut last = None;
    for (sampling, stopping) in stages(options, side) {
        let Sampling { level, density } = sampling;
        let problem = Problem::new(&scene, sampling, 0..count, 0..count, &estimates)?;
        if problem.tiles() == 0 {
            continue;
        }
        let stage = match sampling == Sampling::of(level) {
            true => format!("level {level}"),
            false => format!("level {level}, {density} samples per pixel"),
        };
        progress.start("global", options.max_iterations as usize);
        let solution = solve(problem, stopping, Some((&stage, progress)))?;
        progress.finish();
        estimates.clone_from(&solution.estimates);
        levels.push(LevelReport {
            level,
            samples_per_pixel: density,
            solve: solution.record.clone(),
        });
        last = Some(solution);
        clock.lap(&format!("global {stage}"));
    }
    let solution = last.ok_or(RefineError::NoOverlap)?;
    let covariances = frame_covariances(
        solution.problem.pattern(),
        solution.problem.symbolic(),
        &solution.linearisation.normal,
    )
    // Poses without a covariance are still poses; they are reported as uncertain.
    .unwrap_or_else(|_| vec![Matrix6::from_element(f64::NAN); count]);
    let reports: Vec<FrameReport> = (0..count)
        .map(|k| {
            let sigma = frame_sigma(scene.surface, scene.camera, &estimates[k], &covariances[k]);
            frame_report(survey, k, &solution, sigma)
        })
        .collect();
    clock.lap("covariance");

    let motion = prior.settle_gauge(&scene.surface.gauge(), &estimates);
    let on_prior = reports
        .iter()
        .filter(|f| f.flag == FrameFlag::Prior)
        .count();
    let trajectory = survey
        .initial
        .iter()
        .zip(&estimates)
        .map(|(initial, estimate)| StampedPose {
            time_s: initial.time_s,
            pose: motion.apply(&estimate.pose),
        })
        .collect();
    Ok(Refined {
        trajectory,
        report: RefineReport {
            stopped_because: explain(&solution, options),
            levels,
            frames: reports,
            frames_on_prior: on_prior,
            timings: clock.laps,
        },
    })
}

/// The global solves: coarse to fine, and the finest once more with a denser look at the wall.
///
/// One sample per pixel is too sparse to end with: the products of residual and gradient vary faster than either,
/// and where the wall repeats in step with the samples (courses of bricks run along them) what falls between
/// them does not average out. On brick this alone is 0.05 px of wall error over two turns.
///
/// All but the last only have to bring the estimate close for the next.
fn stages(
    options: &RefineOptions,
    side: u32,
) -> impl Iterator<Item = (Sampling, Stopping)> + use<> {
    let last = Stopping {
        max_iterations: options.max_iterations,
        step_px: options.step_tolerance_px,
        step_sigma: options.step_tolerance_sigma,
    };
    let close = move |level: usize| Stopping {
        step_px: CLOSE * last.step_px * 2f64.powi(level as i32),
        step_sigma: CLOSE * last.step_sigma,
        ..last
    };
    let finest = Sampling {
        level: 0,
        density: options.final_density,
    };
    (0..=options.handover_level(side))
        .rev()
        .map(move |level| (Sampling::of(level), close(level)))
        .chain([(finest, last)])
}

fn load(
    survey: &Survey,
    levels: usize,
    progress: &dyn Progress,
) -> Result<Vec<Pyramid>, FrameError> {
    progress.start("decoding", survey.frames.len());
    let (width, height) = (survey.camera.width, survey.camera.height);
    let frames = survey
        .frames
        .par_iter()
        .map(|file| {
            let grey = load_grey(file, width, height)?;
            progress.advance(1);
            Ok(Pyramid::new(grey, levels))
        })
        .collect();
    progress.finish();
    frames
}

fn frame_report(
    survey: &Survey,
    k: usize,
    solution: &Solution,
    sigma: super::covariance::FrameSigma,
) -> FrameReport {
    let share: &FrameShare = &solution.linearisation.frames[k];
    let estimate: &FrameEstimate = &solution.estimates[k];
    let all = f64::from(survey.camera.width) * f64::from(survey.camera.height);
    let inlier_share = share.inliers / share.pixels.max(1e-9);
    let reason = if share.samples == 0 {
        Some("it overlaps no other frame on the wall".to_owned())
    } else if share.pixels < LEAST_PIXEL_SHARE * all {
        Some(format!(
            "only {:.1} % of its pixels overlap other frames",
            100.0 * share.pixels / all
        ))
    } else if inlier_share < LEAST_INLIER_SHARE {
        Some(format!(
            "{:.0} % of its pixels disagree with the other frames",
            100.0 * (1.0 - inlier_share)
        ))
    } else if sigma.wall_px.is_nan() || sigma.wall_px > LARGEST_SIGMA_PX {
        Some(format!(
            "its place on the wall is uncertain by {:.1} px: too little texture, or frames that do not match",
            sigma.wall_px
        ))
    } else {
        None
    };
    FrameReport {
        index: k,
        file: survey.frames[k]
            .path
            .file_name()
            .map(|name| name.to_string_lossy().into_owned())
            .unwrap_or_default(),
        flag: if reason.is_some() {
            FrameFlag::Prior
        } else {
            FrameFlag::Photometric
        },
        reason,
        points: share.samples,
        residual: (share.square / share.inliers.max(1e-9)).sqrt(),
        inlier_share,
        gain: estimate.log_gain.exp(),
        bias: estimate.bias,
        sigma,
    }
}

fn explain(solution: &Solution, options: &RefineOptions) -> String {
    match solution.record.stop {
        StopReason::StepBelowTolerance => format!(
            "the last step moved no wall point by more than {} px",
            options.step_tolerance_px
        ),
        StopReason::StepBelowUncertainty => format!(
            "the last step was shorter than {} of the estimate's uncertainty",
            options.step_tolerance_sigma
        ),
        StopReason::NoFurtherDescent => {
            "no step, however damped, lowers the robust cost any more".to_owned()
        }
        StopReason::MaxIterations => format!(
            "the {} steps allowed were used up; the last moved the wall by {:.4} px",
            options.max_iterations, solution.record.last_step_px
        ),
    }
}

/// Stopwatch of the stages.
struct Clock {
    since: Instant,
    laps: Vec<StageTime>,
}

impl Default for Clock {
    fn default() -> Self {
        Self {
            since: Instant::now(),
            laps: Vec::new(),
        }
    }
}

impl Clock {
    fn lap(&mut self, stage: &str) {
        let now = Instant::now();
        self.laps.push(StageTime {
            stage: stage.to_owned(),
            seconds: (now - self.since).as_secs_f64(),
        });
        self.since = now;
    }
}
