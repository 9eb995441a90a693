//! From a survey to refined poses: load, track, solve globally coarse to fine, report.

use crate::frames::FrameCache;
use crate::persist::checkpoint::Checkpoint;
use crate::progress::Progress;
use crate::refine::joint::joint_block as joint;
use crate::refine::model::context::{Sampling, Scene};
use crate::refine::model::frame_states::Tracked;
use crate::refine::model::prior::{Prior, usual_step_s};
use crate::refine::model::problem_error::ProblemError;
use crate::refine::model::rejection::Doubt;
use crate::refine::options::RefineOptions;
use crate::refine::parameters::calibration::{Calibration, Kappa};
use crate::refine::parameters::frame_estimate::FrameEstimate;
use crate::refine::pipeline_state::{Keeper, Phase, RunState, Solving};
use crate::refine::problem::linearisation::FrameShare;
use crate::refine::problem::photometric_problem::Problem;
use crate::refine::report::{
    FrameFlag, FrameReport, LevelReport, PoseReport, RefineReport, StageTime,
};
use crate::refine::solver::gauss_newton::{Solution, StopReason, Stopping, go_on};
use crate::refine::solver::neighbourhood::Neighbourhood;
use crate::refine::tiles::interpolation::Interpolation;
use crate::refine::tracking::alternating_calibration::Retracking;
use crate::refine::tracking::prescreening::examine;
use crate::refine::tracking::registration::apart_m;
use crate::refine::tracking::shading_correction::{correct, flatten};
use crate::refine::tracking::track::retry;
use crate::refine::uncertainty::certainty::Certainty;
use crate::refine::uncertainty::covariance::{Covariances, FrameSigma};
use crate::refine::uncertainty::observability::{CalibrationReport, Refusal};
use crate::refine::uncertainty::rolling_shutter_test::row_motion;
use crate::refine::validation::aliasing::Rival;
use crate::refine::validation::inconsistent_frames::unsupported;
use crate::refine::validation::pairwise_lucas_kanade::alignments;
use crate::refine::validation::pairwise_ncc::{blurred, compare_pairs, contradictions};
use crate::refine::validation::repair::repair;
use crate::survey::{CalibrationGroup, Survey};
use crate::trajectory::{Pose, StampedPose, Trajectory};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;

/// Why a survey cannot be refined.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RefineError {
    /// Nothing to compare with.
    #[error(
        "the survey has a single frame; refinement compares frames that overlap on the wall, so it needs two or more"
    )]
    SingleFrame,
    /// Nothing overlaps.
    #[error(
        "no two frames overlap on the wall by as much as a tile; check the initial poses, radius_m and the calibration's focal length, whether the mask or tunnel.ignore leaves anything, or take frames closer together"
    )]
    NoOverlap,
    /// Something that is known by its shape only for a straight round tunnel.
    #[error(
        "{unknown} can be estimated of a straight round tunnel only; leave it out of --calibrate and [calibrate] unknowns"
    )]
    OnlyRound {
        /// What was to be estimated.
        unknown: &'static str,
    },
    /// The equations.
    #[error(transparent)]
    Problem(#[from] ProblemError),
}

/// Result of a refinement.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Refined {
    /// Refined poses with the times of the initial ones.
    pub trajectory: Trajectory,
    /// What was done and how sure it is.
    pub report: RefineReport,
    /// How sure it is, in full.
    pub covariances: Covariances,
}

/// All solves but the last end with a step shorter than this, pixels of their level, or this share
/// of the uncertainty.
const CLOSE_PX: f64 = 0.01;
const CLOSE_SIGMA: f64 = 2.0;
/// Share of a frame's pixels that must overlap other frames for its pose to count as photometric.
const LEAST_PIXEL_SHARE: f64 = 0.02;
/// Largest step left of a pose that counts as photometric: pixels on the wall, or multiples of σ if
/// that is more.
const LARGEST_STEP: (f64, f64) = (0.25, 2.0);
/// Largest 1-σ on the wall of a pose that counts as photometric, pixels: twice that is half a
/// pixel.
const LARGEST_SIGMA_PX: f64 = 0.25;
/// Share of a frame's weight that the robust loss may reject. Things before the wall, glints and
/// oblique views cost a right frame some; whether its pose is right is asked of its alignment with
/// others.
const MOST_REJECTED: f64 = 0.3;

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
    refine_keeping(survey, options, None, progress)
}

/// The same, with what is done kept in a checkpoint; goes on from the state that is in it.
///
/// The result has the same bytes however often the run was interrupted, but for the times that
/// stages took.
///
/// # Errors
/// [`RefineError`].
pub fn refine_keeping(
    survey: &Survey,
    options: &RefineOptions,
    checkpoint: Option<&mut Checkpoint>,
    progress: &Arc<dyn Progress>,
) -> Result<Refined, RefineError> {
    let count = survey.frames.len();
    if count < 2 {
        return Err(RefineError::SingleFrame);
    }
    let mut keeper = Keeper(checkpoint);
    let state: Option<RunState> = keeper.state()?;
    let side = survey.camera.shorter_side();
    let coarsest = options.coarsest_level(side);
    let frames = FrameCache::new(
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
    let shutter = survey.shutter();
    let mut calibration = calibration_of(survey, options, &prior.initial)?;
    let mut scene = Scene {
        surface: survey.surface.as_ref(),
        ignored: &survey.ignored,
        camera: survey.camera,
        shutter: &shutter,
        calibration,
        kappa: Kappa::zeros(),
        frames: &frames,
        prior: &prior,
        noise: 0.0,
        fused_gradient: options.fused_gradient,
    };
    let mut clock = Clock::new(Vec::new(), 0.0);
    let (noise, phase) = match state {
        Some(state) => {
            if let Some(shading) = state.shading {
                frames.set_shading(shading);
            }
            clock = Clock::new(state.laps, state.lap_s);
            (state.noise, state.phase)
        }
        None => {
            let examined = examine(&scene, coarsest, progress.as_ref())?;
            if let Some(shading) = examined.shading {
                frames.set_shading(shading);
            }
            clock.lap("decode");
            let tracking = Retracking::begin(examined.doubts);
            (examined.noise, Phase::Tracking(Box::new(tracking)))
        }
    };
    scene.noise = noise;
    let keep = |phase: Phase, clock: &Clock| RunState {
        noise,
        shading: frames.shading().as_deref().cloned(),
        phase,
        laps: clock.laps.clone(),
        lap_s: clock.lap_s(),
    };

    let mut solving = match phase {
        Phase::Solving(solving) => *solving,
        Phase::Tracking(tracking) => {
            let rough = Prior {
                jitter: calibration.widened(&prior.jitter, prior.arm_m()),
                ..prior.clone()
            };
            let scene_of_rough = Scene {
                prior: &rough,
                ..scene
            };
            let stopping = close(options, options.handover_level(side));
            let between = |tracking: &Retracking| {
                keeper.if_due(|| keep(Phase::Tracking(Box::new(tracking.clone())), &clock))?;
                Ok(())
            };
            let mut tracked = tracking.finish(
                &scene_of_rough,
                options,
                stopping,
                progress.as_ref(),
                between,
            )?;
            clock.lap("track");
            flatten(&scene.at(tracked.kappa), options, &mut tracked)?;
            clock.lap("shading");
            let kappa = scene.at(tracked.kappa).kappa;
            Solving::begin(tracked, kappa, &calibration, stages(options, side))
        }
    };
    calibration.free = solving.free;
    scene.calibration = calibration;
    scene = scene.at(solving.kappa);

    let mut last = None;
    while let Some((sampling, stopping)) = solving.stages.front().copied() {
        // Not between a solve and the one with the wall: that may turn out to be for nothing, and
        // then the solution before it is wanted.
        if !sampling.joint {
            keeper.if_due(|| keep(Phase::Solving(Box::new(solving.clone())), &clock))?;
        }
        // Once the frames are aligned, before the first of the solves at the end.
        let at_the_end = sampling.by_variance && !sampling.joint;
        if at_the_end && !solving.levels.is_empty() && solving.rivals.is_none() {
            solving.rivals = Some(repair(
                &scene,
                options,
                &mut solving.tracked,
                solving.solved.clone(),
                progress.as_ref(),
            )?);
            clock.lap("repair");
            keeper.if_due(|| keep(Phase::Solving(Box::new(solving.clone())), &clock))?;
        }
        let before = solving.clone();
        let begun = solving.solve.take();
        solving.stages.pop_front();
        let tracked = &mut solving.tracked;
        let Sampling {
            level,
            density,
            information,
            ..
        } = sampling;
        let mut problem = Problem::new(&scene, sampling, tracked.members())?.calibrating();
        if sampling.joint && !problem.is_joint() {
            clock.lap("look at the wall");
            continue;
        }
        // Before the frames are aligned at full size, residuals are mostly misalignment.
        if level == 0 {
            let density = if sampling.joint {
                Some(joint::FOREIGN_DENSITY)
            } else {
                options.foreign_density.filter(|_| sampling.by_variance)
            };
            problem = problem.without_foreign(density)?;
        }
        // Where no frame can be believed, the prior is all there is to report.
        if problem.tiles() == 0 && tracked.doubts.iter().all(Option::is_none) {
            solving.checked = true;
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
        let mut between = |solve| {
            keeper.if_due(|| {
                let solve = Some(solve);
                let solving = Solving {
                    solve,
                    ..before.clone()
                };
                keep(Phase::Solving(Box::new(solving)), &clock)
            })?;
            Ok(())
        };
        let announce = Some((stage.as_str(), progress));
        let solution = go_on(problem, stopping, announce, begun, Some(&mut between))?;
        progress.finish();
        tracked.estimates.clone_from(&solution.estimates);
        let refused = if level == 0 && calibration.any() {
            let solved = scene.at(solution.kappa);
            let certainty = Certainty::at(&solved, &solution, &calibration)?;
            certainty.refused(&solved, &calibration, &solution.estimates, &tracked.doubts)
        } else {
            Vec::new()
        };
        adopt(&mut scene, &mut calibration, solution.kappa, &refused);
        (solving.kappa, solving.free) = (scene.kappa, calibration.free);
        if !refused.is_empty() && !more_for_certain(&solving.stages) {
            solving.stages.push_front((sampling, stopping));
            // Without the unknown the wall may look smooth, and then a solution without it is
            // wanted.
            if sampling.joint {
                solving.stages.push_front(finest(options));
            }
        }
        solving.refusals.extend(refused);
        solving.solved.clone_from(tracked);
        if level == 0 {
            disagreements(&solution.linearisation.frames, &mut tracked.doubts);
        }
        solving.levels.push(LevelReport {
            level,
            samples_per_pixel: density,
            share_of_wall: solution.problem.share_of_wall(),
            joint: solution.problem.is_joint(),
            solve: solution.record.clone(),
        });
        last = Some((solution, stopping));
        if more_for_certain(&solving.stages) && frames.shading().is_some() {
            correct(&scene, options, tracked)?;
        }
        clock.lap(&format!("global {stage}"));
        if !std::mem::replace(&mut solving.checked, true) {
            recheck(&scene, options, tracked, progress.as_ref())?;
            clock.lap("check");
        }
    }
    let Solving {
        mut tracked,
        levels,
        refusals,
        rivals,
        ..
    } = solving;
    let (solution, stopping) = last.ok_or(RefineError::NoOverlap)?;
    progress.start("covariance", 1);
    let finest = options.handover_level(side);
    let late = unsupported(&alignments(&scene, finest, &tracked, &(0..count))?, count);
    let rivals = rivals.unwrap_or_default();
    let ambiguous = rivals.into_iter().map(|(frame, motion): Rival| {
        let pose = &tracked.estimates[frame].pose;
        let other = motion.apply(pose);
        let apart_m = apart_m(&scene, pose, &other);
        (frame, Doubt::Ambiguous { other, apart_m })
    });
    let late: Vec<(usize, Doubt)> = ambiguous.chain(late).collect();
    for (frame, doubt) in late {
        tracked.doubts[frame].get_or_insert(doubt);
    }
    let rows = row_motion(&scene, options, &tracked)?;
    let certainty = Certainty::at(&scene, &solution, &calibration)?;
    let estimates = &tracked.estimates;
    let metric = calibration.metric(&scene.kappa);
    let motion = prior.settle_gauge(&scene.surface.gauge(), estimates, &metric);
    for doubt in tracked.doubts.iter_mut().flatten() {
        if let Doubt::Ambiguous { other, .. } = doubt {
            *other = metric.in_metres(&motion.apply(other));
        }
    }
    // No step without a covariance, whose lack is told already.
    let steps_px = steps_left(&solution).unwrap_or_else(|_| vec![0.0; count]);
    let doubts = certainty.with_strain(tracked.doubts);
    let mut reports: Vec<FrameReport> = (0..count)
        .map(|k| {
            let sigma = certainty.of_frame(&scene, k, &estimates[k]);
            let late = || late_doubt(survey, k, &solution, steps_px[k], &sigma);
            let doubt = doubts[k].clone().or_else(late);
            frame_report(survey, k, &solution, doubt, sigma, certainty.strains[k].px)
        })
        .collect();
    leave_none_alone(&mut reports);
    progress.finish();
    clock.lap("covariance");

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
            pose: metric.in_metres(&motion.apply(&estimate.pose)),
        })
        .collect();
    Ok(Refined {
        trajectory,
        report: RefineReport {
            stopped_because: explain(&solution, &stopping),
            levels,
            frames: reports,
            frames_on_prior: on_prior,
            rows,
            variance_factor: certainty.covariances.variance_factor,
            calibration: (calibration.any() || !refusals.is_empty()).then(|| {
                CalibrationReport::new(
                    &calibration,
                    &scene.kappa,
                    &certainty.shared.unwrap_or_default(),
                    &refusals,
                    survey.file.tunnel.nominal_m(),
                )
            }),
            timings: clock.laps,
        },
        covariances: certainty.covariances.moved(&motion).scaled(metric.scale),
    })
}

/// What is to be estimated of the survey's calibration.
///
/// # Errors
/// [`RefineError::OnlyRound`].
fn calibration_of(
    survey: &Survey,
    options: &RefineOptions,
    initial: &[Pose],
) -> Result<Calibration, RefineError> {
    let section = survey.file.calibrate.clone().unwrap_or_default();
    let groups = options.calibrate.as_ref().unwrap_or(&section.unknowns);
    let calibration = if groups.is_empty() {
        Calibration::none(&survey.camera)
    } else {
        Calibration::new(groups, &section, &survey.camera, initial)
    };
    for (group, unknown) in [
        (CalibrationGroup::Radius, "the radius"),
        (CalibrationGroup::Axis, "the axis"),
    ] {
        if groups.contains(&group) && !survey.file.tunnel.is_straight_and_round() {
            return Err(RefineError::OnlyRound { unknown });
        }
    }
    Ok(Calibration {
        readout_s: survey.shutter().readout_s(),
        ..calibration
    })
}

/// Goes on with the shared unknowns `kappa`, those refused at the values given.
fn adopt(scene: &mut Scene, calibration: &mut Calibration, mut kappa: Kappa, refused: &[Refusal]) {
    for refusal in refused {
        kappa[refusal.unknown] = 0.0;
        calibration.free[refusal.unknown] = false;
    }
    scene.calibration = *calibration;
    *scene = scene.at(kappa);
}

/// The global solves: coarse to fine, the finest once more with a denser look at the wall, and, if
/// asked for, jointly with the wall. Those between only bring the estimate close for the next, and
/// a share of the information is enough for that.
///
/// One sample per pixel is too sparse to end with: the products of residual and gradient vary
/// faster than either, and where the wall repeats in step with the samples (courses of bricks run
/// along them) what falls between them does not average out. On brick this alone is 0.05 px of wall
/// error over two turns.
fn stages(options: &RefineOptions, side: u32) -> impl Iterator<Item = (Sampling, Stopping)> + '_ {
    let (finest, last) = finest(options);
    let with_wall = Sampling {
        density: joint::DENSITY,
        joint: true,
        ..finest
    };
    let with_wall_stopping = Stopping {
        step_sigma: joint::STEP_SIGMA,
        ..last
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
        .chain(options.joint.then_some((with_wall, with_wall_stopping)))
}

/// The solve at full size with a denser look.
fn finest(options: &RefineOptions) -> (Sampling, Stopping) {
    let sampling = Sampling {
        density: options.final_density,
        interpolation: Interpolation::Bicubic,
        by_variance: true,
        ..Sampling::of(0)
    };
    let stopping = Stopping {
        max_iterations: options.max_iterations,
        step_px: options.step_tolerance_px,
        step_sigma: options.step_tolerance_sigma,
    };
    (sampling, stopping)
}

/// Whether solves are to come; one jointly with the wall may turn out to be for nothing.
fn more_for_certain(stages: &VecDeque<(Sampling, Stopping)>) -> bool {
    stages.front().is_some_and(|(next, _)| !next.joint)
}

/// When a solve has come close enough for the next.
pub fn close(options: &RefineOptions, level: usize) -> Stopping {
    Stopping {
        max_iterations: options.max_iterations,
        step_px: CLOSE_PX * 2f64.powi(level as i32),
        step_sigma: CLOSE_SIGMA,
    }
}

/// Compares all frames pair by pair, takes out those that contradict the rest, tries once more to
/// place what is not placed, and solves again.
fn recheck(
    scene: &Scene,
    options: &RefineOptions,
    tracked: &mut Tracked,
    progress: &dyn Progress,
) -> Result<(), ProblemError> {
    let side = scene.camera.shorter_side();
    let count = tracked.estimates.len();
    let (coarsest, finest) = (options.coarsest_level(side), options.handover_level(side));
    progress.start("check", ROUNDS);
    for round in 0..ROUNDS {
        let pairs = compare_pairs(scene, finest, tracked, &(0..count))?;
        let mut doubts = contradictions(&pairs, count);
        doubts.extend(blurred(&pairs, count));
        for (frame, doubt) in doubts {
            tracked.doubts[frame] = Some(doubt);
        }
        if round + 1 == ROUNDS || retry(scene, options, tracked)? == 0 {
            break;
        }
        Neighbourhood::of_all(tracked).solve(scene, options, finest..=coarsest, tracked)?;
        progress.advance(1);
    }
    progress.finish();
    Ok(())
}

/// Times that contradictions are looked for, and frames in doubt tried again between.
const ROUNDS: usize = 3;

/// Doubts the frames that the robust loss has mostly rejected at full size, so that the last solve
/// does without them.
pub fn disagreements(shares: &[FrameShare], doubts: &mut [Option<Doubt>]) {
    for (share, doubt) in shares.iter().zip(doubts) {
        if doubt.is_none() && share.pixels > 0.0 {
            *doubt = disagreement(share);
        }
    }
}

/// How far an undamped step of the poses would still move each frame, for want of steps or of
/// descent, pixels on the wall.
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

fn rejected(share: &FrameShare) -> f64 {
    1.0 - share.inliers / share.pixels.max(1e-9)
}

fn disagreement(share: &FrameShare) -> Option<Doubt> {
    let share = rejected(share);
    (share > MOST_REJECTED).then_some(Doubt::Disagrees { share })
}

/// What speaks against a frame of which nothing else does.
fn late_doubt(
    survey: &Survey,
    k: usize,
    solution: &Solution,
    step_px: f64,
    sigma: &FrameSigma,
) -> Option<Doubt> {
    let share: &FrameShare = &solution.linearisation.frames[k];
    let all = f64::from(survey.camera.width)
        * f64::from(survey.camera.height)
        * solution.problem.share_of_wall();
    if share.pixels < LEAST_PIXEL_SHARE * all {
        Some(Doubt::NoOverlap {
            share: share.pixels / all,
        })
    } else if let Some(doubt) = disagreement(share) {
        Some(doubt)
    } else if sigma.wall_px.is_nan() || sigma.wall_px > LARGEST_SIGMA_PX {
        Some(Doubt::Uncertain {
            wall_px: sigma.wall_px,
        })
    } else if step_px > LARGEST_STEP.0.max(LARGEST_STEP.1 * sigma.wall_px) {
        Some(Doubt::Unsettled { step_px })
    } else {
        None
    }
}

fn frame_report(
    survey: &Survey,
    k: usize,
    solution: &Solution,
    doubt: Option<Doubt>,
    sigma: FrameSigma,
    strain_px: f64,
) -> FrameReport {
    let share: &FrameShare = &solution.linearisation.frames[k];
    let estimate: &FrameEstimate = &solution.estimates[k];
    FrameReport {
        index: k,
        file: survey.frames[k].name(),
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
        inlier_share: share.inliers / share.pixels.max(1e-9),
        gain: estimate.log_gain.exp(),
        bias: estimate.bias,
        sigma,
        strain_px,
    }
}

/// One frame by itself agrees with nobody.
fn leave_none_alone(reports: &mut [FrameReport]) {
    let photometric = |report: &&mut FrameReport| report.flag == FrameFlag::Photometric;
    let mut left = reports.iter_mut().filter(photometric);
    if let (Some(alone), None) = (left.next(), left.next()) {
        alone.flag = FrameFlag::Prior;
        alone.reason = Some(Doubt::Apart { frames: 1 }.to_string());
    }
}

fn explain(solution: &Solution, stopping: &Stopping) -> String {
    match solution.record.stop {
        StopReason::StepBelowTolerance => format!(
            "the last step moved no wall point by more than {} px",
            stopping.step_px
        ),
        StopReason::StepBelowUncertainty => format!(
            "the last step was shorter than {} of the estimate's uncertainty",
            stopping.step_sigma
        ),
        StopReason::NoFurtherDescent => {
            "no step, however damped, lowers the robust cost any more".to_owned()
        }
        StopReason::MaxIterations => format!(
            "the {} steps allowed were used up; the last moved the wall by {:.4} px",
            stopping.max_iterations, solution.record.last_step_px
        ),
    }
}

/// Stopwatch of the stages.
struct Clock {
    since: Instant,
    /// Time spent on the present stage before, seconds.
    before_s: f64,
    laps: Vec<StageTime>,
}

impl Clock {
    /// Goes on after `laps` and `before_s` seconds of the next.
    fn new(laps: Vec<StageTime>, before_s: f64) -> Self {
        Self {
            since: Instant::now(),
            before_s,
            laps,
        }
    }

    /// Time spent on the present stage, seconds.
    fn lap_s(&self) -> f64 {
        self.before_s + self.since.elapsed().as_secs_f64()
    }

    fn lap(&mut self, stage: &str) {
        self.laps.push(StageTime {
            stage: stage.to_owned(),
            seconds: self.lap_s(),
        });
        (self.since, self.before_s) = (Instant::now(), 0.0);
    }
}
