//! Tracking: placing one frame after another, with a sliding window that keeps the errors from growing.
//!
//! Registering each frame only against those already placed gains error exponentially. Solving the last
//! frames that can overlap again together, every few frames, with the oldest third held, keeps it bounded. When a
//! turn closes, the window is solved from the coarsest level.

use super::estimate::FrameEstimate;
use super::gauss_newton::{Stopping, solve};
use super::options::RefineOptions;
use super::problem::{Problem, ProblemError, Sampling, Scene};
use super::search::FusedWall;
use crate::progress::Progress;
use crate::surface::{Footprint, viewing_distance};
use crate::trajectory::{Jitter, JitterModel, Pose};
use std::ops::Range;

/// Hypotheses refined per frame.
const HYPOTHESES: usize = 5;
/// How far back overlap is looked for, frames.
const FARTHEST: usize = 256;
/// Stopping rules of a single frame and of a window; the global solve does the rest.
const FRAME_STOPPING: Stopping = Stopping {
    max_iterations: 12,
    step_px: 0.1,
    step_sigma: 0.0,
};
const WINDOW_STOPPING: Stopping = Stopping {
    max_iterations: 6,
    step_px: 0.2,
    step_sigma: 0.0,
};

/// Places all frames; returns their estimates.
///
/// # Errors
/// [`ProblemError`] if a pose leaves the tunnel or an equation has no solution.
pub fn track(
    scene: &Scene,
    options: &RefineOptions,
    progress: &dyn Progress,
) -> Result<Vec<FrameEstimate>, ProblemError> {
    let count = scene.frames.len();
    let finest = options.handover_level(scene.camera.shorter_side());
    let mut estimates = vec![FrameEstimate::at(scene.prior.initial[0])];
    let mut footprints = vec![footprint(scene, 0, &estimates)?];
    let mut before = 0;
    progress.start("tracking", count);
    progress.advance(1);
    for k in 1..count {
        estimates.push(FrameEstimate::at(predict(scene, &estimates)));
        footprints.push(footprint(scene, k, &estimates)?);
        let first = earliest_overlap(scene, &footprints);
        if first < k {
            estimates[k] = place(scene, options, first, &estimates)?;
        }
        // The frame looks farther back than the one before it did: a turn has closed on wall that was placed
        // without it, and what has drifted apart meanwhile may be many pixels.
        let closes = first < before;
        before = first;
        if closes || k % options.window_stride == 0 || k + 1 == count {
            let coarsest = match closes {
                true => options.coarsest_level(scene.camera.shorter_side()),
                false => finest,
            };
            let held = if first == 0 { 0 } else { (k + 1 - first) / 3 };
            for level in (finest..=coarsest).rev() {
                solve_window(scene, level, first..k + 1, held, &mut estimates)?;
            }
        }
        footprints[k] = footprint(scene, k, &estimates)?;
        progress.advance(1);
    }
    progress.finish();
    Ok(estimates)
}

/// Solves the frames of a window together, the oldest `held` of them held.
fn solve_window(
    scene: &Scene,
    level: usize,
    window: Range<usize>,
    held: usize,
    estimates: &mut [FrameEstimate],
) -> Result<(), ProblemError> {
    let active = window.start + held..window.end;
    let sampling = Sampling::of(level);
    let problem = Problem::new(scene, sampling, window, active.clone(), estimates)?;
    if problem.tiles() > 0 {
        let solution = solve(problem, WINDOW_STOPPING, None)?;
        estimates[active].copy_from_slice(&solution.estimates);
    }
    Ok(())
}

/// Places the last of `estimates` (its predicted pose) on the wall that the frames from `first` on show:
/// search, brief refinement of every hypothesis, full refinement of the best.
fn place(
    scene: &Scene,
    options: &RefineOptions,
    first: usize,
    estimates: &[FrameEstimate],
) -> Result<FrameEstimate, ProblemError> {
    let k = estimates.len() - 1;
    let predicted = estimates[k];
    let coarsest = options.coarsest_level(scene.camera.shorter_side());
    let finest = options.handover_level(scene.camera.shorter_side());
    let distance = viewing_distance(scene.surface, &predicted.pose)
        .map_err(|source| ProblemError::Placement { frame: k, source })?;
    let sigma = picture_sigma(&scene.prior.jitter, distance);
    // Beyond half a turn there is no more wall to look at.
    let widest = 0.5 * scene.surface.perimeter_m();
    let margin = (3.0 * sigma[1].max(sigma[0]) * distance).min(widest);
    let placed: Vec<_> = (first..k).map(|i| (i, estimates[i])).collect();
    let wall = |level| FusedWall::new(scene, level, &placed, k, &predicted.pose, margin);
    let hypotheses = wall(coarsest)?.search(k, &predicted.pose, sigma, HYPOTHESES);

    let refine_at = |level: usize, estimate: FrameEstimate| {
        let mut trial = estimates.to_vec();
        trial[k] = estimate;
        let problem = Problem::new(scene, Sampling::of(level), first..k + 1, k..k + 1, &trial)?;
        if problem.tiles() == 0 {
            return Ok(estimate);
        }
        Ok(solve(problem, FRAME_STOPPING, None)?.estimates[0])
    };
    let judged = finest.max(coarsest.saturating_sub(1));
    let judge = wall(judged)?;
    let mut best = (f64::NEG_INFINITY, predicted);
    for hypothesis in hypotheses {
        let mut estimate = hypothesis.estimate;
        for level in (judged..=coarsest).rev() {
            // A hypothesis that runs out of the tunnel is no hypothesis.
            match refine_at(level, estimate) {
                Ok(refined) => estimate = refined,
                Err(ProblemError::Placement { .. }) => break,
                Err(error) => return Err(error),
            }
        }
        let cost = scene.prior.deviation_cost(&predicted.pose, &estimate.pose);
        if let Some(scored) = judge.score(k, &estimate.pose, cost)
            && scored.score > best.0
        {
            best = (scored.score, estimate);
        }
    }
    let mut estimate = best.1;
    for level in (finest..judged).rev() {
        estimate = refine_at(level, estimate)?;
    }
    Ok(estimate)
}

/// σ of pitch, yaw and roll as they appear in the picture: a shift across the view looks like a turn.
fn picture_sigma(jitter: &Jitter, distance_m: f64) -> [f64; 3] {
    let turn = jitter.rotation_sigma_rad;
    let [x, y, z] = jitter.translation_sigma_m;
    let (along, across) = (y / distance_m, x.max(z) / distance_m);
    [turn.hypot(along), turn.hypot(across), turn]
}

fn footprint(
    scene: &Scene,
    k: usize,
    estimates: &[FrameEstimate],
) -> Result<Footprint, ProblemError> {
    Footprint::trace(scene.surface, scene.camera, &estimates[k].pose)
        .map_err(|source| ProblemError::Placement { frame: k, source })
}

/// The first frame that may share wall with the last one.
fn earliest_overlap(scene: &Scene, footprints: &[Footprint]) -> usize {
    let last = footprints.len() - 1;
    let perimeter = scene.surface.perimeter_m();
    (last.saturating_sub(FARTHEST)..last)
        .find(|k| footprints[*k].overlaps(&footprints[last], perimeter))
        .unwrap_or(last)
}

/// Where the prior expects the next frame, given the frames already placed.
///
/// Random walk: the last pose and the initial step. Independent: the initial pose, moved by the gauge (turn
/// about the axis, shift along it) that the placed frames have taken on.
fn predict(scene: &Scene, placed: &[FrameEstimate]) -> Pose {
    let initial = &scene.prior.initial;
    let k = placed.len();
    match scene.prior.jitter.model {
        JitterModel::RandomWalk => {
            let last = &placed[k - 1].pose;
            let (before, next) = (&initial[k - 1], &initial[k]);
            Pose::new(
                last.r_wc * (before.r_wc.inverse() * next.r_wc),
                last.t_wc + (next.t_wc - before.t_wc),
            )
        }
        JitterModel::Independent => {
            let first = k.saturating_sub(FARTHEST);
            let poses: Vec<Pose> = placed[first..].iter().map(|e| e.pose).collect();
            let motion = scene.surface.gauge().align(&initial[first..k], &poses);
            motion.apply(&initial[k])
        }
    }
}
