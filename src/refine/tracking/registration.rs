//! Placing one frame on the wall that others show: search, brief refinement of the hypotheses,
//! verdict.

use crate::camera::{Camera, Sweep};
use crate::refine::model::context::{EstimationContext, FrameWindow, Sampling};
use crate::refine::model::problem_error::ProblemError;
use crate::refine::model::rejection::RejectionReason;
use crate::refine::options::RefineOptions;
use crate::refine::parameters::frame_estimate::FrameEstimate;
use crate::refine::problem::photometric_problem::Problem;
use crate::refine::samples::footprints::footprint;
use crate::refine::solver::argmin_glue::solve;
use crate::refine::solver::stopping::Stopping;
use crate::refine::thresholds::registration::{MAX_SCORE_DEFICIT_NATS, MIN_SCORE_GAIN_NATS};
use crate::refine::tracking::correlation_search::{
    Hypothesis, REACH, least_samples, log_likelihood, search,
};
use crate::refine::tracking::reference_mosaic::{
    NccScore, ReferenceMosaic, UnwrappedFrame, pixel_size_m,
};
use crate::surface::{Footprint, Surface, shortest_arc, viewing_distance};
use crate::trajectory::{Jitter, Pose};
use std::borrow::Cow;
use std::ops::Range;

/// Hypotheses refined per frame, at the most.
const HYPOTHESES: usize = 10;
/// Stopping rule of a single frame; the global solve does the rest.
const STOPPING: Stopping = Stopping {
    max_iterations: 12,
    step_px: 0.1,
    step_sigma: 0.0,
};
/// Correlation of local contrast with the wall, noise aside, that a placed frame must reach.
const LEAST_QUALITY: f64 = 0.5;
/// Share of the texture that even the right pose leaves unexplained: blur, interpolation.
pub const LEAST_UNEXPLAINED: f64 = 0.05;
/// Correlation from which on a pose is settled and is not looked for any closer.
const SETTLED: f64 = 0.9;
/// Closer looks at the most, and half their σ, radians.
const CLOSER_LOOKS: usize = 4;
const CLOSE_RAD: f64 = 0.05;
/// Two places are told apart by the pixels if what they leave unexplained, `1 − c²`, differs by
/// this factor, ...
pub const UNEXPLAINED: f64 = 2.0;
/// ... or else by the prior if its log-densities differ by this (3 σ).
const PRIOR_MARGIN: f64 = 4.5;
/// `½ eᵀΣ⁻¹e` beyond which a pose is not what the prior allows: all six unknowns 3.5 σ off.
pub const MOST_DEVIATION: f64 = 0.5 * 6.0 * REACH * REACH;
/// Places closer than this are one, samples of the search level.
const APART: f64 = 2.0;

/// What is known of a frame before it is placed.
#[derive(Clone, Copy, Debug)]
pub struct Expectation {
    /// Pose that the prior predicts.
    pub pose: Pose,
    /// σ of that prediction over that of the prior's single step.
    pub widened: f64,
}

/// A frame that has found its place.
#[derive(Clone, Copy, Debug)]
pub struct Registered {
    /// Its estimate.
    pub estimate: FrameEstimate,
    /// False if it matches the wall less well than it should: the wall itself may be bent.
    pub settled: bool,
}

/// A candidate after its refinement.
struct Candidate {
    estimate: FrameEstimate,
    /// `1 − c²`.
    unexplained: f64,
    /// Correlation c with the wall, noise aside.
    quality: f64,
    likelihood: f64,
    /// `½ eᵀΣ⁻¹e` of the prior.
    deviation: f64,
}

impl Candidate {
    fn score(&self) -> f64 {
        self.likelihood - self.deviation
    }
}

/// The frames around the one that is placed.
pub struct Neighbours<'s> {
    /// A run of frames that includes the one to be placed.
    pub run: Range<usize>,
    /// Their estimates.
    pub estimates: &'s [FrameEstimate],
    /// Which of them show the wall: those placed already.
    pub placed: &'s [bool],
    /// What they see of it.
    pub footprints: &'s [Footprint],
}

impl Neighbours<'_> {
    /// How the camera of one of the run moves while its rows are read.
    pub fn sweep(&self, scene: &EstimationContext, frame: usize) -> Sweep {
        scene.sweep(frame, &self.run, self.estimates)
    }
}

/// Places frame `frame` on the wall that the placed frames around it show.
///
/// # Errors
/// [`ProblemError`]: a frame that cannot be read, equations without a solution.
pub fn register_frame(
    scene: &EstimationContext,
    options: &RefineOptions,
    frame: usize,
    expected: &Expectation,
    neighbours: &Neighbours,
) -> Result<Result<Registered, RejectionReason>, ProblemError> {
    let side = scene.camera.shorter_side();
    let (coarsest, finest) = (options.coarsest_level(side), options.handover_level(side));
    let level = finest.max(coarsest.saturating_sub(1));
    let camera = scene.camera.at_level(level);
    let no_match = |correlation| Ok(Err(RejectionReason::NoMatch { correlation }));
    let Ok(distance) = viewing_distance(scene.surface, &expected.pose) else {
        return no_match(0.0);
    };
    let sigma = picture_sigma(&scene.prior.jitter, distance).map(|s| s * expected.widened);
    // Beyond half a turn there is no more wall to look at.
    let widest = 0.5 * scene.surface.perimeter_m();
    let margin = (REACH * sigma[1].max(sigma[0]) * distance).min(widest);
    let near = near(scene, frame, &expected.pose, margin, neighbours)?;
    let mut unwrapped_frames = Vec::new();
    for (k, _) in near.iter().enumerate().filter(|(_, near)| **near) {
        let sweep = neighbours.sweep(scene, neighbours.run.start + k);
        let unwrapped = UnwrappedFrame::new(scene, level, neighbours.run.start + k, &sweep)?;
        unwrapped_frames.push((unwrapped, neighbours.estimates[k]));
    }
    let sweep = neighbours.sweep(scene, frame);
    let unwrapped = UnwrappedFrame::new(scene, level, frame, &sweep)?;
    let wall = ReferenceMosaic::new(
        scene,
        &unwrapped_frames,
        &camera,
        (frame, &expected.pose),
        margin,
    )?;
    let found = if options.search {
        search(scene, &wall, &unwrapped, &expected.pose, sigma, HYPOTHESES)
    } else {
        vec![Hypothesis {
            pose: expected.pose,
            score: 0.0,
            attainable_score: 0.0,
        }]
    };
    let best_score = found.first().map_or(0.0, |hypothesis| hypothesis.score);

    let refine_at = |level: usize, estimate: FrameEstimate| {
        let own = frame - neighbours.run.start;
        let mut estimates = neighbours.estimates.to_vec();
        estimates[own] = estimate;
        let mut compared = near.clone();
        compared[own] = true;
        let members = FrameWindow {
            participants: neighbours.run.clone(),
            active: frame..frame + 1,
            estimates: &estimates,
            compared: Cow::Owned(compared),
        };
        let problem = Problem::new(scene, Sampling::of(level), members)?;
        if problem.tiles() == 0 {
            return Ok(estimate);
        }
        Ok(solve(problem, STOPPING)?.estimates[0])
    };
    // Gauss–Newton from a pose; None if it leads out of the tunnel or off the wall.
    let refined = |pose: &Pose| -> Result<Option<Candidate>, ProblemError> {
        let mut estimate = wall.exposed(&unwrapped, pose);
        for level in (level..=coarsest).rev() {
            estimate = match refine_at(level, estimate) {
                Ok(refined) => refined,
                Err(ProblemError::Placement { .. } | ProblemError::Factor { .. }) => {
                    return Ok(None);
                }
                Err(error) => return Err(error),
            };
        }
        let ncc_score = wall.ncc_score(scene, &unwrapped, &estimate.pose);
        let correlation = ncc_score.correlation();
        let Some(unexplained) = unexplained(&ncc_score, &unwrapped) else {
            return Ok(None);
        };
        let deviation =
            scene.prior.deviation_cost(&expected.pose, &estimate.pose) / expected.widened.powi(2);
        if deviation > MOST_DEVIATION {
            return Ok(None);
        }
        Ok(Some(Candidate {
            estimate,
            unexplained: unexplained.max(LEAST_UNEXPLAINED),
            quality: (1.0 - unexplained).sqrt(),
            likelihood: log_likelihood(correlation, ncc_score.samples),
            deviation,
        }))
    };
    let mut candidates: Vec<Candidate> = Vec::new();
    let worth_refining = found
        .iter()
        .filter(|one| is_worth_refining(one, best_score));
    for hypothesis in worth_refining {
        candidates.extend(refined(&hypothesis.pose)?);
    }
    // A half-right pose has stretched and sheared what it unrolled; from there the search sees
    // better.
    let close = sigma.map(|s| s.min(CLOSE_RAD));
    let looks = if options.search { CLOSER_LOOKS } else { 0 };
    for _ in 0..looks {
        candidates.sort_by(|a, b| b.score().total_cmp(&a.score()));
        let Some(first) = candidates.first().filter(|c| c.quality < SETTLED) else {
            break;
        };
        let from = first.estimate.pose;
        let before = first.score();
        for hypothesis in search(scene, &wall, &unwrapped, &from, close, 2) {
            candidates.extend(refined(&hypothesis.pose)?);
        }
        if !candidates.iter().any(|c| has_gained(before, c.score())) {
            break;
        }
    }
    candidates.sort_by(|a, b| b.score().total_cmp(&a.score()));
    let Some(first) = candidates.first() else {
        return no_match(0.0);
    };
    if first.quality < LEAST_QUALITY {
        return no_match(first.quality);
    }
    // Those that the pixels alone cannot tell from the best.
    let pixel = pixel_size_m(scene, &camera, &first.estimate.pose);
    let rivals: Vec<&Candidate> = candidates
        .iter()
        .filter(|c| c.unexplained < UNEXPLAINED * first.unexplained)
        .collect();
    let best = rivals
        .iter()
        .min_by(|a, b| a.deviation.total_cmp(&b.deviation))
        .unwrap_or(&first);
    for rival in &rivals {
        let (a, b) = (&best.estimate.pose, &rival.estimate.pose);
        let separation_m = separation_m(scene.surface, &scene.camera, a, b);
        if separation_m > APART * pixel && rival.deviation - best.deviation < PRIOR_MARGIN {
            return Ok(Err(RejectionReason::Ambiguous {
                other: rival.estimate.pose,
                separation_m,
            }));
        }
    }
    let mut estimate = best.estimate;
    for level in (finest..level).rev() {
        estimate = refine_at(level, estimate)?;
    }
    Ok(Ok(Registered {
        estimate,
        settled: best.quality >= SETTLED,
    }))
}

/// True if refinement may bring a hypothesis close enough to the best one, whose log-posterior is
/// `best_score`, for it to be the right one.
fn is_worth_refining(hypothesis: &Hypothesis, best_score: f64) -> bool {
    hypothesis.attainable_score >= best_score - MAX_SCORE_DEFICIT_NATS
}

/// True if a closer look has raised the log-posterior by more than noise does.
fn has_gained(before: f64, after: f64) -> bool {
    after - before >= MIN_SCORE_GAIN_NATS
}

/// `1 − c²`, c the correlation with the wall, noise aside; none if too little is shared, or the two
/// do not correlate.
///
/// Where noise drowns the texture, nothing speaks against the pose; its σ will tell.
pub fn unexplained(ncc_score: &NccScore, unwrapped: &UnwrappedFrame) -> Option<f64> {
    let compared = ncc_score.samples >= least_samples(unwrapped) && ncc_score.correlation() > 0.0;
    let quality = ncc_score.match_quality().unwrap_or(1.0);
    compared.then_some(1.0 - quality * quality)
}

/// Which placed frames may show wall that `pose` sees, or would see `margin_m` farther.
pub fn near(
    scene: &EstimationContext,
    frame: usize,
    pose: &Pose,
    margin_m: f64,
    neighbours: &Neighbours,
) -> Result<Vec<bool>, ProblemError> {
    let perimeter = scene.surface.perimeter_m();
    let own = footprint(scene, &scene.camera, frame, pose)?.widened(margin_m);
    let frames = neighbours.footprints.iter().zip(neighbours.placed);
    let near = frames.enumerate().map(|(k, (footprint, placed))| {
        *placed && neighbours.run.start + k != frame && footprint.overlaps(&own, perimeter)
    });
    Ok(near.collect())
}

/// σ of pitch, yaw and roll as they appear in the picture: a shift across the view looks like a
/// turn.
fn picture_sigma(jitter: &Jitter, distance_m: f64) -> [f64; 3] {
    let turn = jitter.rotation_sigma_rad;
    let [x, y, z] = jitter.translation_sigma_m;
    let (along, across) = (y / distance_m, x.max(z) / distance_m);
    [turn.hypot(along), turn.hypot(across), turn]
}

/// Distance on the wall between what two poses of a frame show, metres: the mean over the middle
/// and the corners of the picture, as far as the lens shows them and both poses see the wall there.
///
/// Infinity if no such point is left: two poses that see no wall through a common pixel cannot be
/// taken for one, so the ambiguity test must find them apart.
pub fn separation_m(surface: &dyn Surface, camera: &Camera, a: &Pose, b: &Pose) -> f64 {
    let perimeter = surface.perimeter_m();
    let (mut sum_m, mut count) = (0.0, 0.0);
    for ray_c in camera.probes() {
        let hit = |pose: &Pose| surface.hit(&pose.t_wc, &(pose.r_wc * ray_c)).ok();
        if let (Some(a), Some(b)) = (hit(a), hit(b)) {
            let (a, b) = (a.wall, b.wall);
            sum_m += shortest_arc(a.s_m - b.s_m, perimeter).hypot(a.h_m - b.h_m);
            count += 1.0;
        }
    }
    if count > 0.0 {
        sum_m / count
    } else {
        f64::INFINITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{KannalaBrandt, Lens};
    use crate::refine::tracking::correlation_search::attainable_log_likelihood;
    use crate::surface::Circle;
    use nalgebra::{UnitQuaternion, Vector3};

    fn hypothesis(correlation: f64, samples: f64, prior: f64) -> Hypothesis {
        Hypothesis {
            pose: Pose::new(UnitQuaternion::identity(), Vector3::zeros()),
            score: log_likelihood(correlation, samples) - prior,
            attainable_score: attainable_log_likelihood(correlation, samples) - prior,
        }
    }

    /// Where hardly anything correlates, the prior makes every log-posterior negative.
    #[test]
    fn best_hypothesis_is_worth_refining_at_a_negative_log_posterior() {
        let best = hypothesis(0.05, 200.0, 3.0);
        assert!(best.score < 0.0);
        assert!(is_worth_refining(&best, best.score));
        assert!(is_worth_refining(&hypothesis(0.05, 200.0, 5.0), best.score));
    }

    /// A hypothesis that the search's steps explain may be right, however many samples there are;
    /// one that is less likely by the prior alone is judged by its odds, however few.
    #[test]
    fn hypotheses_are_judged_by_their_odds() {
        for samples in [100.0, 1000.0, 10_000.0] {
            let best = hypothesis(0.8, samples, 0.0).score;
            assert!(is_worth_refining(&hypothesis(0.6, samples, 0.0), best));
        }
        let best = hypothesis(0.8, 10_000.0, 0.0).score;
        assert!(!is_worth_refining(&hypothesis(0.5, 10_000.0, 0.0), best));
        for samples in [0.0, 100.0, 10_000.0] {
            let best = hypothesis(0.0, samples, 1.0).score;
            assert!(is_worth_refining(&hypothesis(0.0, samples, 10.0), best));
            assert!(!is_worth_refining(&hypothesis(0.0, samples, 10.5), best));
        }
    }

    #[test]
    fn gain_is_a_difference_of_log_posteriors() {
        for before in [-50.0, 0.0, 50.0, 5000.0] {
            assert!(!has_gained(before, before));
            assert!(!has_gained(before, before + 2.9));
            assert!(has_gained(before, before + 3.1));
        }
    }

    /// A fisheye of which the lens shows the middle, but not the corners of the picture.
    #[test]
    fn separation_counts_only_pixels_that_the_lens_shows() {
        let circle = Circle::new(3.0).unwrap();
        let fisheye = KannalaBrandt::new([0.0; 4]).limited_to(0.3);
        let camera = Camera {
            lens: Lens::KannalaBrandt(fisheye),
            ..Camera::from_vertical_fov(160, 120, 60f64.to_radians())
        };
        assert_eq!(camera.probes().len(), 1);
        let pose = |h_m: f64| Pose::new(UnitQuaternion::identity(), Vector3::new(0.0, h_m, 0.0));
        let separation_m = |b: &Pose| separation_m(&circle, &camera, &pose(0.0), b);
        assert!((separation_m(&pose(0.25)) - 0.25).abs() < 1e-12);
        let outside = Pose::new(UnitQuaternion::identity(), Vector3::new(0.0, 0.0, 9.0));
        assert_eq!(separation_m(&outside), f64::INFINITY);
    }
}
