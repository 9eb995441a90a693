//! From a survey to refined poses: load, track, solve globally coarse to fine, report.

use super::consistency::{blurred, compare_pairs, contradictions};
use super::covariance::{Covariances, covariances, frame_sigma};
use super::doubt::Doubt;
use super::estimate::FrameEstimate;
use super::examine::examine;
use super::gauss_newton::{Solution, StopReason, Stopping, solve};
use super::options::RefineOptions;
use super::prior::{Prior, usual_step_s};
use super::problem::{FrameShare, Problem, ProblemError, Sampling, Scene};
use super::report::{FrameFlag, FrameReport, LevelReport, PoseReport, RefineReport, StageTime};
use super::track::{Tracked, retry, track};
use crate::frames::FrameCache;
use crate::progress::Progress;
use crate::survey::Survey;
use crate::trajectory::{StampedPose, Trajectory};
use std::sync::Arc;
use std::time::Instant;

/// Why a survey cannot be refined.
#[derive(Debug, thiserror::Error)]
pub enum RefineError {
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
    /// How sure it is, in full.
    pub covariances: Covariances,
}

/// All solves but the last end with a step shorter than this, pixels of their level, or this share of the uncertainty.
const CLOSE_PX: f64 = 0.01;
const CLOSE_SIGMA: f64 = 2.0;
/// Share of a frame's pixels that must overlap other frames for its pose to count as photometric.
const LEAST_PIXEL_SHARE: f64 = 0.02;
/// Largest 1-σ on the wall of a pose that counts as photometric, pixels.
const LARGEST_SIGMA_PX: f64 = 1.0;
/// Share of a frame's weight that the robust loss may reject: always, at the most, and as a multiple of the usual.
const MOST_REJECTED: (f64, f64, f64) = (0.1, 0.3, 2.0);

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
    let coarsest = options.coarsest_level(side);
    let mut frames = FrameCache::new(
        &survey.frames,
        &survey.camera,
        coarsest + 1,
        options.cache_bytes,
    );
    let times_s: Vec<f64> = survey
        .initial
        .iter()
        .map(|stamped| stamped.time_s)
        .collect();
    let prior = Prior {
        jitter: survey.prior,
        initial: survey.initial_poses(),
        usual_step_s: usual_step_s(&times_s),
        times_s,
        log_gain_sigma: options.log_gain_sigma,
        bias_sigma: options.bias_sigma,
    };
    let examined = examine(
        &scene(survey, options, &prior, &frames, 0.0),
        coarsest,
        progress.as_ref(),
    )?;
    if examined.shading.is_some() {
        frames.set_shading(examined.shading);
    }
    clock.lap("decode");
    let mut tracked = track(
        &scene(survey, options, &prior, &frames, examined.noise),
        options,
        examined.doubts,
        progress.as_ref(),
    )?;
    clock.lap("track");

    let scene = scene(survey, options, &prior, &frames, examined.noise);
    let mut levels = Vec::new();
    let mut last = None;
    for (k, (sampling, stopping)) in stages(options, side).enumerate() {
        let Sampling {
            level,
            density,
            information,
        } = sampling;
        let problem = Problem::new(&scene, sampling, tracked.members())?;
        // Where no frame can be believed, the prior is all there is to report.
        if problem.tiles() == 0 && tracked.doubts.iter().all(Option::is_none) {
            continue;
        }
        let mut stage = format!("level {level}");
        if density != 1.0 {
            stage += &format!(", {density} samples per pixel");
        }
        if information != 1.0 {
            stage += &format!(", {:.0} % of the information", 100.0 * information);
        }
        progress.start("global", options.max_iterations as usize);
        let solution = solve(problem, stopping, Some((&stage, progress)))?;
        progress.finish();
        tracked.estimates.clone_from(&solution.estimates);
        if level == 0 {
            disagreements(&solution.linearisation.frames, &mut tracked.doubts);
        }
        levels.push(LevelReport {
            level,
            samples_per_pixel: density,
            share_of_wall: solution.problem.share_of_wall(),
            solve: solution.record.clone(),
        });
        last = Some(solution);
        clock.lap(&format!("global {stage}"));
        if k == 0 {
            recheck(&scene, options, &mut tracked)?;
            clock.lap("check");
        }
    }
    let solution = last.ok_or(RefineError::NoOverlap)?;
    let covariances = covariances(
        solution.problem.pattern(),
        &solution.linearisation.normal,
        &solution.linearisation.scatter,
        &solution.problem.prior_information(&solution.estimates),
    )
    // Poses without a covariance are still poses; they are reported as uncertain.
    .unwrap_or_else(|_| Covariances::unknown(count));
    let estimates = &tracked.estimates;
    let most = most_rejected(&solution.linearisation.frames);
    let reports: Vec<FrameReport> = (0..count)
        .map(|k| {
            let sigma = frame_sigma(
                scene.surface,
                scene.camera,
                &estimates[k],
                &covariances.frames[k],
            );
            frame_report(
                survey,
                k,
                &solution,
                tracked.doubts[k].as_ref(),
                most,
                sigma,
            )
        })
        .collect();
    clock.lap("covariance");

    let motion = prior.settle_gauge(&scene.surface.gauge(), estimates);
    let on_prior = reports
        .iter()
        .filter(|f| f.flag != FrameFlag::Photometric)
        .count();
    let trajectory = survey
        .initial
        .iter()
        .zip(estimates)
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
            variance_factor: covariances.variance_factor,
            timings: clock.laps,
        },
        covariances: covariances.moved(&motion),
    })
}

fn scene<'a>(
    survey: &'a Survey,
    options: &RefineOptions,
    prior: &'a Prior,
    frames: &'a FrameCache,
    noise: f64,
) -> Scene<'a> {
    Scene {
        surface: survey.surface.as_ref(),
        camera: &survey.camera,
        frames,
        prior,
        noise,
        fused_gradient: options.fused_gradient,
    }
}

/// The global solves: coarse to fine, and the finest once more with a denser look at the wall.
/// Those between only bring the estimate close for the next, and a share of the information is enough for that.
///
/// One sample per pixel is too sparse to end with: the products of residual and gradient vary faster than either,
/// and where the wall repeats in step with the samples (courses of bricks run along them) what falls between
/// them does not average out. On brick this alone is 0.05 px of wall error over two turns.
fn stages(options: &RefineOptions, side: u32) -> impl Iterator<Item = (Sampling, Stopping)> + '_ {
    let last = Stopping {
        max_iterations: options.max_iterations,
        step_px: options.step_tolerance_px,
        step_sigma: options.step_tolerance_sigma,
    };
    let finest = Sampling {
        level: 0,
        density: options.final_density,
        information: 1.0,
    };
    let first = options.handover_level(side);
    let sampling = move |level| Sampling {
        information: if level == first {
            1.0
        } else {
            options.close_information
        },
        ..Sampling::of(level)
    };
    (0..=first)
        .rev()
        .map(move |level| (sampling(level), close(options, level)))
        .chain([(finest, last)])
}

/// When a solve has come close enough for the next.
fn close(options: &RefineOptions, level: usize) -> Stopping {
    Stopping {
        max_iterations: options.max_iterations,
        step_px: CLOSE_PX * 2f64.powi(level as i32),
        step_sigma: CLOSE_SIGMA,
    }
}

/// Compares all frames pair by pair, takes out those that contradict the rest, tries once more to place what is not
/// placed, and solves again.
fn recheck(
    scene: &Scene,
    options: &RefineOptions,
    tracked: &mut Tracked,
) -> Result<(), ProblemError> {
    let side = scene.camera.shorter_side();
    let count = tracked.estimates.len();
    let (coarsest, finest) = (options.coarsest_level(side), options.handover_level(side));
    for round in 0..ROUNDS {
        let pairs = compare_pairs(scene, finest, tracked)?;
        let mut doubts = contradictions(&pairs, count);
        doubts.extend(blurred(&pairs, count));
        for (frame, doubt) in doubts {
            tracked.doubts[frame] = Some(doubt);
        }
        if round + 1 == ROUNDS || retry(scene, options, tracked)? == 0 {
            break;
        }
        for level in (finest..=coarsest).rev() {
            let problem = Problem::new(scene, Sampling::of(level), tracked.members())?;
            let stopping = close(options, level);
            tracked.estimates = solve(problem, stopping, None)?.estimates;
        }
    }
    Ok(())
}

/// Times that contradictions are looked for, and frames in doubt tried again between.
const ROUNDS: usize = 3;
/// Doubts the frames that the robust loss has mostly rejected at full size, so that the last solve does without them.
fn disagreements(shares: &[FrameShare], doubts: &mut [Option<Doubt>]) {
    let most = most_rejected(shares);
    for (share, doubt) in shares.iter().zip(doubts) {
        if doubt.is_none() && share.pixels > 0.0 {
            *doubt = disagreement(share, most);
        }
    }
}

/// Share of its pixels that a believable frame may have rejected: a few times the usual, within limits.
fn most_rejected(shares: &[FrameShare]) -> f64 {
    let compared = shares.iter().filter(|share| share.pixels > 0.0);
    let mut rejected: Vec<f64> = compared.map(rejected).collect();
    rejected.sort_unstable_by(f64::total_cmp);
    let usual = rejected.get(rejected.len() / 2).copied().unwrap_or(0.0);
    (MOST_REJECTED.2 * usual).clamp(MOST_REJECTED.0, MOST_REJECTED.1)
}

fn rejected(share: &FrameShare) -> f64 {
    1.0 - share.inliers / share.pixels.max(1e-9)
}

fn disagreement(share: &FrameShare, most: f64) -> Option<Doubt> {
    let share = rejected(share);
    (share > most).then_some(Doubt::Disagrees { share })
}

fn frame_report(
    survey: &Survey,
    k: usize,
    solution: &Solution,
    doubt: Option<&Doubt>,
    most_rejected: f64,
    sigma: super::covariance::FrameSigma,
) -> FrameReport {
    let share: &FrameShare = &solution.linearisation.frames[k];
    let estimate: &FrameEstimate = &solution.estimates[k];
    let all = f64::from(survey.camera.width)
        * f64::from(survey.camera.height)
        * solution.problem.share_of_wall();
    let inlier_share = share.inliers / share.pixels.max(1e-9);
    let late = if share.pixels < LEAST_PIXEL_SHARE * all {
        Some(Doubt::NoOverlap {
            share: share.pixels / all,
        })
    } else if let Some(doubt) = disagreement(share, most_rejected) {
        Some(doubt)
    } else if sigma.wall_px.is_nan() || sigma.wall_px > LARGEST_SIGMA_PX {
        Some(Doubt::Uncertain {
            wall_px: sigma.wall_px,
        })
    } else {
        None
    };
    let doubt = doubt.cloned().or(late);
    FrameReport {
        index: k,
        file: survey.frames[k]
            .path
            .file_name()
            .map(|name| name.to_string_lossy().into_owned())
            .unwrap_or_default(),
        flag: match &doubt {
            None => FrameFlag::Photometric,
            Some(Doubt::Ambiguous { .. }) => FrameFlag::Ambiguous,
            Some(_) => FrameFlag::Prior,
        },
        other_pose: match &doubt {
            Some(Doubt::Ambiguous { other, .. }) => Some(PoseReport::from(other)),
            _ => None,
        },
        reason: doubt.map(|doubt| doubt.to_string()),
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
