//! Tracking: placing one frame after another, with a sliding window that keeps the errors from
//! growing.
//!
//! Registering each frame only against those already placed gains error exponentially. Solving the
//! last frames that can overlap again together, every few frames, with the oldest third held, keeps
//! it bounded. When a turn closes, frames may have drifted apart by many pixels, or by next to
//! nothing: the window is solved both from the coarsest level, which reaches far and on a wall that
//! repeats may end at another place that fits, and from the finest, which stays where it is; what
//! fits better in the end is kept.
//!
//! A frame that cannot be placed stays where the prior expects it, and no other is compared with
//! it.

use crate::refine::model::context::EstimationContext;
use crate::refine::model::frame_states::FrameStates;
use crate::refine::model::prior::predict;
use crate::refine::model::problem_error::ProblemError;
use crate::refine::model::rejection::RejectionReason;
use crate::refine::options::RefineOptions;
use crate::refine::parameters::calibration::Kappa;
use crate::refine::parameters::frame_estimate::FrameEstimate;
use crate::refine::problem::photometric_problem::PhotometricProblem;
use crate::refine::samples::footprints::footprint;
use crate::refine::samples::footprints::footprints;
use crate::refine::samples::sampling::Sampling;
use crate::refine::solver::argmin_glue::solve;
use crate::refine::solver::stopping::Stopping;
use crate::refine::thresholds::footprints::MAX_OVERLAP_DISTANCE_FRAMES;
use crate::refine::tracking::registration::{Expectation, Neighbours, register_frame};
use crate::surface::Footprint;
use crate::trajectory::{JitterModel, Pose};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Frames of a long window, and frames placed between two of them: what short windows have bent a
/// little, each a bit farther than the one before, is straightened by a look at several turns.
const LONG_WINDOW: usize = 160;
const LONG_STRIDE: usize = 30;
/// Stopping rule of a window; the global solve does the rest.
const WINDOW_STOPPING: Stopping = Stopping {
    max_iterations: 6,
    step_px: 0.2,
    step_sigma: 0.0,
};

/// Frames being placed, one after another.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Tracking {
    /// Those placed so far; the rejections are of all frames.
    tracked: FrameStates,
    /// What they saw of the wall when they were placed.
    footprints: Vec<Footprint>,
    /// The first frame that the last one may share wall with.
    earliest: usize,
    /// The shared unknowns, the last that made a camera.
    kappa: Kappa,
}

impl Tracking {
    /// Nothing placed yet. `rejections` are frames known to be useless beforehand.
    pub fn begin(rejections: Vec<Option<RejectionReason>>, kappa: Kappa) -> Self {
        Self {
            tracked: FrameStates {
                estimates: Vec::with_capacity(rejections.len()),
                rejections,
                kappa,
            },
            footprints: Vec::new(),
            earliest: 0,
            kappa,
        }
    }

    /// Number of frames placed.
    pub fn placed(&self) -> usize {
        self.tracked.estimates.len()
    }

    /// Whether all frames are placed.
    pub fn is_complete(&self) -> bool {
        self.placed() == self.tracked.rejections.len()
    }

    /// The frames placed so far, as if there were no others.
    pub fn so_far(&self) -> FrameStates {
        let mut tracked = self.tracked.clone();
        tracked.rejections.truncate(tracked.estimates.len());
        tracked
    }

    /// All frames.
    pub fn finish(self) -> FrameStates {
        self.tracked
    }

    /// Places the next frame, and solves the windows that end with it.
    ///
    /// # Errors
    /// [`ProblemError`] if the frame cannot be read, its initial pose stands outside the tunnel, or
    /// an equation has no solution.
    pub fn place_next(
        &mut self,
        scene: &EstimationContext,
        options: &RefineOptions,
    ) -> Result<(), ProblemError> {
        let (k, count) = (self.placed(), self.tracked.rejections.len());
        let scene = &scene.at(self.kappa).at(self.tracked.kappa);
        self.kappa = scene.kappa;
        let tracked = &mut self.tracked;
        let expected = expect(scene, k, tracked);
        tracked.estimates.push(FrameEstimate::at(expected.pose));
        self.footprints
            .push(footprint(scene, &scene.camera, k, &expected.pose)?);
        let first = earliest_overlap(scene, &self.footprints);
        let mut settled = true;
        if tracked.rejections[k].is_none() && first < k {
            let run = first..k + 1;
            let mut placed = tracked.inliers(&run);
            placed[k - first] = false;
            if placed.iter().any(|placed| *placed) {
                let neighbours = Neighbours {
                    estimates: &tracked.estimates[run.clone()],
                    placed: &placed,
                    footprints: &self.footprints[run.clone()],
                    run,
                };
                match register_frame(scene, options, k, &expected, &neighbours)? {
                    Ok(placed) => {
                        tracked.estimates[k] = placed.estimate;
                        settled = placed.settled;
                    }
                    Err(rejection) => tracked.rejections[k] = Some(rejection),
                }
            }
        }
        // The frame looks farther back than the one before it did: a turn has closed on wall that
        // was placed without it, and what has drifted apart meanwhile may be many pixels.
        let closes = first < self.earliest;
        self.earliest = first;
        let side = scene.camera.shorter_side();
        let (finest, coarsest) = (options.handover_level(side), options.coarsest_level(side));
        if k > 0
            && options.windows
            && (closes || !settled || k % options.window_stride == 0 || k + 1 == count)
        {
            let held = if first == 0 { 0 } else { (k + 1 - first) / 3 };
            let window = first..k + 1;
            let start = WindowState::of(tracked, &window);
            let near_cost = solve_window(scene, finest, window.clone(), held, tracked)?;
            if closes || !settled {
                let near = WindowState::of(tracked, &window);
                start.restore(tracked, &window);
                let mut far_cost = f64::INFINITY;
                for level in (finest..=coarsest).rev() {
                    let scene = scene.at(tracked.kappa);
                    far_cost = solve_window(&scene, level, window.clone(), held, tracked)?;
                }
                let far_is_better = far_cost < near_cost;
                if !far_is_better {
                    near.restore(tracked, &window);
                }
            }
        }
        if k > 0 && options.windows && k % LONG_STRIDE == 0 {
            let start = (k + 1).saturating_sub(LONG_WINDOW);
            let held = if start == 0 { 0 } else { LONG_WINDOW / 8 };
            let scene = scene.at(tracked.kappa);
            solve_window(&scene, finest, start..k + 1, held, tracked)?;
        }
        self.footprints[k] = footprint(scene, &scene.camera, k, &tracked.estimates[k].pose)?;
        Ok(())
    }
}

/// What solving a window changes.
struct WindowState {
    estimates: Vec<FrameEstimate>,
    kappa: Kappa,
}

impl WindowState {
    fn of(tracked: &FrameStates, window: &Range<usize>) -> Self {
        Self {
            estimates: tracked.estimates[window.clone()].to_vec(),
            kappa: tracked.kappa,
        }
    }

    fn restore(&self, tracked: &mut FrameStates, window: &Range<usize>) {
        tracked.estimates[window.clone()].copy_from_slice(&self.estimates);
        tracked.kappa = self.kappa;
    }
}

/// Solves the frames of a window together, the oldest `held` of them held; where none is, with the
/// camera's unknowns.
///
/// Returns the cost of an observation at the end, grey levels²; infinity where nothing is seen
/// twice.
fn solve_window(
    scene: &EstimationContext,
    level: usize,
    window: Range<usize>,
    held: usize,
    tracked: &mut FrameStates,
) -> Result<f64, ProblemError> {
    let active = window.start + held..window.end;
    let members = tracked.window_of(window, active.clone());
    let problem =
        PhotometricProblem::new(scene, Sampling::of(level), members)?.with_shared_parameters();
    if problem.tiles() == 0 {
        return Ok(f64::INFINITY);
    }
    let solution = solve(problem, WINDOW_STOPPING)?;
    tracked.kappa = solution.kappa;
    tracked.estimates[active].copy_from_slice(&solution.estimates);
    let record = solution.record;
    // Each problem takes σ from what it starts with; in units of it costs could not be compared.
    Ok(record.cost_end * record.sigma.powi(2) / record.observations as f64)
}

/// The first frame that may share wall with the last one.
fn earliest_overlap(scene: &EstimationContext, footprints: &[Footprint]) -> usize {
    let last = footprints.len() - 1;
    let perimeter = scene.surface.perimeter_m();
    (last.saturating_sub(MAX_OVERLAP_DISTANCE_FRAMES)..last)
        .find(|k| footprints[*k].overlaps(&footprints[last], perimeter))
        .unwrap_or(last)
}

/// Where the prior expects frame `k`, given the inliers frames.
///
/// Random walk: the nearest inliers pose and the initial steps from there. Independent: the
/// initial pose, moved by the gauge (turn about the axis, shift along it) that the inliers frames
/// have taken on.
///
/// Where that lies outside the tunnel: the initial pose.
pub fn expect(scene: &EstimationContext, k: usize, tracked: &FrameStates) -> Expectation {
    let expected = expect_anywhere(scene, k, tracked);
    match scene.surface.check_inside(&expected.pose.t_wc) {
        Ok(()) => expected,
        Err(_) => Expectation {
            pose: scene.prior.initial[k],
            ..expected
        },
    }
}

fn expect_anywhere(scene: &EstimationContext, k: usize, tracked: &FrameStates) -> Expectation {
    let metric = scene.calibration.datum(&scene.kappa);
    let initial = |k: usize| metric.to_nominal_tunnel(&scene.prior.initial[k]);
    let around = k.saturating_sub(MAX_OVERLAP_DISTANCE_FRAMES)
        ..(k + MAX_OVERLAP_DISTANCE_FRAMES).min(tracked.estimates.len());
    let inliers = around.filter(|i| *i != k && tracked.rejections[*i].is_none());
    match scene.prior.jitter.model {
        JitterModel::RandomWalk => match inliers.min_by_key(|i| i.abs_diff(k)) {
            Some(near) => {
                let pose = &tracked.estimates[near].pose;
                let steps = scene.prior.steps_between(near.min(k), near.max(k));
                Expectation {
                    pose: predict(pose, &initial(near), &initial(k)),
                    widened: steps.sqrt(),
                }
            }
            None => Expectation {
                pose: initial(k),
                widened: 1.0,
            },
        },
        JitterModel::Independent => {
            let (from, to): (Vec<Pose>, Vec<Pose>) = inliers
                .map(|i| (initial(i), tracked.estimates[i].pose))
                .unzip();
            let motion = scene.surface.gauge().align(&from, &to);
            Expectation {
                pose: motion.apply(&initial(k)),
                widened: 1.0,
            }
        }
    }
}

/// Tries once more to place the frames in rejection, now that there are frames on both sides of them;
/// returns how many it has placed. Those that show nothing are not tried.
///
/// # Errors
/// [`ProblemError`].
pub fn register_rejected(
    scene: &EstimationContext,
    options: &RefineOptions,
    tracked: &mut FrameStates,
) -> Result<usize, ProblemError> {
    let count = tracked.estimates.len();
    let mut won = 0;
    let mut footprints = footprints(scene, tracked)?;
    for k in 0..count {
        if !tracked.rejections[k]
            .as_ref()
            .is_some_and(RejectionReason::is_retriable)
        {
            continue;
        }
        let run = k.saturating_sub(MAX_OVERLAP_DISTANCE_FRAMES)
            ..(k + MAX_OVERLAP_DISTANCE_FRAMES).min(count);
        let expected = expect(scene, k, tracked);
        let placed = tracked.inliers(&run);
        let neighbours = Neighbours {
            estimates: &tracked.estimates[run.clone()],
            placed: &placed,
            footprints: &footprints[run.clone()],
            run,
        };
        tracked.estimates[k] = match register_frame(scene, options, k, &expected, &neighbours)? {
            Ok(placed) => {
                tracked.rejections[k] = None;
                won += 1;
                placed.estimate
            }
            Err(_) => FrameEstimate::at(expected.pose),
        };
        footprints[k] = footprint(scene, &scene.camera, k, &tracked.estimates[k].pose)?;
    }
    Ok(won)
}
