//! Registration of one frame on the wall that its neighbours show.
//!
//! ```text
//! correlation search → hypotheses → Gauss–Newton → candidates → choice
//! ```

use crate::comparison::mosaic_grid::pixel_size_m;
use crate::comparison::unexplained::Unexplained;
use crate::comparison::unwrapped_frame::UnwrappedFrame;
use crate::model::context::{EstimationContext, FrameWindow};
use crate::model::problem_error::ProblemError;
use crate::model::rejection::RejectionReason;
use crate::options::RefineOptions;
use crate::parameters::frame_estimate::FrameEstimate;
use crate::problem::photometric_problem::PhotometricProblem;
use crate::samples::sampling::Sampling;
use crate::solver::argmin_glue::solve;
use crate::solver::stopping::Stopping;
use crate::thresholds::registration::{MAX_HYPOTHESES, MEAN_HYPOTHESES};
use crate::tracking::candidate::{Candidate, choose_candidate, sort_candidates};
use crate::tracking::correlation_search::{
    Found, Hypothesis, log_likelihood, log_likelihood_by_chance, min_samples, search_poses,
};
use crate::tracking::neighbours::Neighbours;
use crate::tracking::pose_prediction::PosePrediction;
use crate::tracking::reference_mosaic::ReferenceMosaic;
use crate::tracking::search_grid::MAX_DEVIATION_SIGMA;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use tunnelstitch_geometry::surface::viewing_distance;
use tunnelstitch_geometry::trajectory::Pose;

/// Largest deficit of a hypothesis to the best one with which it is refined, nats: log-posterior
/// odds of `ln(MAX_HYPOTHESES/0.001)`. Of ten hypotheses, a right one is dismissed at most once in
/// a thousand frames.
///
/// The probability that a hypothesis is right whose log-posterior is Δ lower is no more than
/// `exp(−Δ)`. The search underestimates log-posteriors by its steps, in proportion to the number of
/// samples. So the deficit is between the upper bound for the hypothesis after refinement
/// ([`crate::tracking::correlation_search::attainable_log_likelihood`]) and the lower bound for the
/// best one, its score before refinement.
const MAX_SCORE_DEFICIT_NATS: f64 = 9.2;

/// Deviation `½ eᵀΣ⁻¹e` of a pose from the prior's prediction up to which the prior allows it: all
/// six unknowns of the pose as far off as the search reaches.
pub const MAX_DEVIATION_COST: f64 = 0.5 * 6.0 * MAX_DEVIATION_SIGMA * MAX_DEVIATION_SIGMA;

/// The estimate of a registered frame.
#[derive(Clone, Copy, Debug)]
pub struct Registered {
    /// The estimate.
    pub estimate: FrameEstimate,
    /// True if the frame matches the wall as well as it should; otherwise the wall itself may be
    /// bent.
    pub is_reliable: bool,
    /// Deviation from the prior's prediction, `½ eᵀΣ⁻¹e`.
    pub deviation: f64,
    /// Log-likelihood of its correlation with the wall, nats; 0 where there is none.
    pub log_likelihood: f64,
}

/// The effort that registering frames may take: hypotheses that are refined.
///
/// A frame that fits at once leaves its share to later ones that do not.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Effort {
    left: usize,
}

impl Effort {
    /// The effort of refining so many hypotheses.
    pub fn of(hypotheses: usize) -> Self {
        Self { left: hypotheses }
    }

    /// Adds the share of one frame.
    pub fn grant(&mut self) {
        self.left += MEAN_HYPOTHESES;
    }

    /// Takes one hypothesis; false if none is left.
    fn take(&mut self) -> bool {
        let has_any = self.left > 0;
        self.left = self.left.saturating_sub(1);
        has_any
    }
}

/// Registers frame `frame` on the wall that the registered frames around it show; returns the
/// reason if it must be rejected.
///
/// # Errors
/// [`ProblemError`]: a frame that cannot be read, equations without a solution.
pub fn register_frame(
    context: &EstimationContext,
    options: &RefineOptions,
    frame: usize,
    predicted: &PosePrediction,
    neighbours: &Neighbours,
    effort: &mut Effort,
) -> Result<Result<Registered, RejectionReason>, ProblemError> {
    let Ok(distance_m) = viewing_distance(
        context.surface.as_ref(),
        context.cameras.of(frame),
        &predicted.pose,
    ) else {
        return Ok(Err(RejectionReason::NoMatch { correlation: 0.0 }));
    };
    let registration =
        Registration::new(context, options, frame, predicted, neighbours, distance_m)?;
    let found = registration.search();
    let mut candidates = registration.refine_hypotheses(&found.hypotheses, effort)?;
    sort_candidates(&mut candidates);
    let camera = context
        .cameras
        .of(frame)
        .at_level(registration.search_level);
    let pixel_size =
        |candidate: &Candidate| pixel_size_m(context, &camera, &candidate.estimate.pose);
    let chosen = choose_candidate(
        &candidates,
        log_likelihood_by_chance(found.maxima, options.false_alarm_rate),
        context.surface.as_ref(),
        context.cameras.of(frame),
        pixel_size,
    );
    match chosen {
        Ok(candidate) => registration.finish(candidate).map(Ok),
        Err(reason) => Ok(Err(reason)),
    }
}

/// The registration of one frame: the frame, unwrapped, and the reference mosaic around it.
struct Registration<'r> {
    context: &'r EstimationContext<'r>,
    frame: usize,
    predicted: &'r PosePrediction,
    neighbours: &'r Neighbours<'r>,
    /// Pyramid level of the first solves.
    coarsest_level: usize,
    /// Pyramid level of the search and the candidates.
    search_level: usize,
    /// Pyramid level of the estimate.
    finest_level: usize,
    /// σ of pitch, yaw and roll of the search, radians.
    sigma_rad: [f64; 3],
    /// Which neighbours may share wall with the frame.
    overlapping: Vec<bool>,
    mosaic: ReferenceMosaic,
    unwrapped: UnwrappedFrame,
}

impl<'r> Registration<'r> {
    /// Fuses the reference mosaic wherever the frame may look; `distance_m`: of the wall at its
    /// predicted pose.
    fn new(
        context: &'r EstimationContext<'r>,
        options: &RefineOptions,
        frame: usize,
        predicted: &'r PosePrediction,
        neighbours: &'r Neighbours<'r>,
        distance_m: f64,
    ) -> Result<Self, ProblemError> {
        let side = context.cameras.shorter_side();
        let coarsest_level = options.coarsest_level(side);
        let finest_level = options.handover_level(side);
        let search_level = finest_level.max(coarsest_level.saturating_sub(1));
        let camera = context.cameras.of(frame).at_level(search_level);
        let jitter = &context.prior.jitter;
        let sigma_rad = jitter.search_sigma_rad(distance_m, predicted.sigma_scale);
        // Beyond half a turn there is no more wall to look at.
        let widest_m = 0.5 * context.surface.perimeter_m();
        let reach_m = MAX_DEVIATION_SIGMA * sigma_rad[1].max(sigma_rad[0]) * distance_m;
        let margin_m = reach_m.min(widest_m);
        let overlapping = neighbours.find_overlapping(context, frame, &predicted.pose, margin_m)?;
        let unwrapped_frames = neighbours.unwrap_frames(context, search_level, &overlapping)?;
        let sweep = neighbours.sweep(context, frame);
        let unwrapped = UnwrappedFrame::new(context, search_level, frame, &sweep)?;
        let target = (frame, &predicted.pose);
        let mosaic = ReferenceMosaic::new(context, &unwrapped_frames, &camera, target, margin_m)?;
        Ok(Self {
            context,
            frame,
            predicted,
            neighbours,
            coarsest_level,
            search_level,
            finest_level,
            sigma_rad,
            overlapping,
            mosaic,
            unwrapped,
        })
    }

    /// Searches around the predicted pose; see [`search_poses`].
    fn search(&self) -> Found {
        let (context, predicted) = (self.context, &self.predicted.pose);
        let (mosaic, unwrapped) = (&self.mosaic, &self.unwrapped);
        search_poses(
            context,
            mosaic,
            unwrapped,
            predicted,
            self.sigma_rad,
            MAX_HYPOTHESES,
        )
    }

    /// Refines the hypotheses that may turn out to be right.
    fn refine_hypotheses(
        &self,
        hypotheses: &[Hypothesis],
        effort: &mut Effort,
    ) -> Result<Vec<Candidate>, ProblemError> {
        let best_score = hypotheses
            .first()
            .map_or(0.0, |hypothesis| hypothesis.score);
        let promising = hypotheses
            .iter()
            .filter(|one| is_worth_refining(one, best_score));
        let mut candidates = Vec::new();
        for hypothesis in promising.take_while(|_| effort.take()) {
            candidates.extend(self.refine_pose(&hypothesis.pose)?);
        }
        Ok(candidates)
    }

    /// Refines a pose by Gauss–Newton down to the level of the search; None if that leads out of
    /// the tunnel, off the wall, or beyond what the prior allows.
    fn refine_pose(&self, pose: &Pose) -> Result<Option<Candidate>, ProblemError> {
        let log_gain_sigma = self.context.prior.log_gain_sigma;
        let mut estimate = self
            .mosaic
            .fit_exposure(&self.unwrapped, pose, log_gain_sigma);
        for level in (self.search_level..=self.coarsest_level).rev() {
            estimate = match self.solve_at(level, estimate) {
                Ok(refined) => refined,
                Err(ProblemError::Placement { .. } | ProblemError::Factor { .. }) => {
                    return Ok(None);
                }
                Err(error) => return Err(error),
            };
        }
        let ncc_score = self
            .mosaic
            .compute_ncc(self.context, &self.unwrapped, &estimate.pose);
        let unexplained = Unexplained::of(&ncc_score, min_samples(&self.unwrapped));
        let Some(unexplained) = unexplained else {
            return Ok(None);
        };
        let deviation = self.deviation(&estimate.pose);
        if deviation > MAX_DEVIATION_COST {
            return Ok(None);
        }
        Ok(Some(Candidate {
            estimate,
            unexplained,
            log_likelihood: log_likelihood(ncc_score.correlation(), ncc_score.samples),
            deviation,
        }))
    }

    /// Refines the chosen candidate down to the finest level.
    fn finish(&self, candidate: &Candidate) -> Result<Registered, ProblemError> {
        let mut estimate = candidate.estimate;
        for level in (self.finest_level..self.search_level).rev() {
            estimate = self.solve_at(level, estimate)?;
        }
        Ok(Registered {
            estimate,
            is_reliable: candidate.unexplained.is_of_right_poses(),
            deviation: self.deviation(&estimate.pose),
            log_likelihood: candidate.log_likelihood,
        })
    }

    /// Deviation of a pose from the prior's prediction, `½ eᵀΣ⁻¹e`.
    fn deviation(&self, pose: &Pose) -> f64 {
        let deviation = (self.context.prior).deviation_cost(&self.predicted.pose, pose);
        deviation / self.predicted.sigma_scale.powi(2)
    }

    /// Solves for the frame's estimate at one pyramid level, with all other frames held; returns
    /// the estimate unchanged where it shares no wall with them.
    fn solve_at(
        &self,
        level: usize,
        estimate: FrameEstimate,
    ) -> Result<FrameEstimate, ProblemError> {
        let own = self.frame - self.neighbours.frame_range.start;
        let mut estimates = self.neighbours.estimates.to_vec();
        estimates[own] = estimate;
        let mut compared = self.overlapping.clone();
        compared[own] = true;
        let window = FrameWindow {
            participants: self.neighbours.frame_range.clone(),
            active: self.frame..self.frame + 1,
            estimates: &estimates,
            compared: Cow::Owned(compared),
        };
        let problem = PhotometricProblem::new(self.context, Sampling::of(level), window)?;
        if problem.tiles() == 0 {
            return Ok(estimate);
        }
        Ok(solve(problem, Stopping::TRACKING)?.unknowns.frames[0])
    }
}

/// True if refinement may bring a hypothesis close enough to the best one, whose log-posterior is
/// `best_score`, for it to be the right one.
fn is_worth_refining(hypothesis: &Hypothesis, best_score: f64) -> bool {
    hypothesis.attainable_score >= best_score - MAX_SCORE_DEFICIT_NATS
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracking::correlation_search::attainable_log_likelihood;
    use nalgebra::{UnitQuaternion, Vector3};

    fn hypothesis(correlation: f64, samples: f64, prior: f64) -> Hypothesis {
        Hypothesis {
            pose: Pose::new(UnitQuaternion::identity(), Vector3::zeros()),
            score: log_likelihood(correlation, samples) - prior,
            attainable_score: attainable_log_likelihood(correlation, samples) - prior,
        }
    }

    /// The prior makes every log-posterior negative if hardly anything correlates.
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
}
