//! The Gaussian prior on poses and exposures, and its part of the normal equations.

use crate::linear::bordered_system::SharedBorder;
use crate::linear::normal_equations::{Block, NormalEquations, Pattern};
use crate::model::prior_terms::{
    DatumJacobian, RelativeError, absolute_error, absolute_error_by_datum, relation_error,
    relation_error_by_datum, relative_error, relative_error_by_datum, transferred,
};
use crate::options::RefineOptions;
use crate::parameters::calibration::{DATUM_PARAMETERS, Datum, INTRINSIC_PARAMETERS};
use crate::parameters::frame_estimate::{FrameEstimate, FrameStep};
use nalgebra::{Matrix6, Vector3, Vector6};
use std::ops::Range;
use tunnelstitch_core::survey::PoseGap;
use tunnelstitch_geometry::numerics::median::upper_median;
use tunnelstitch_geometry::surface::{Gauge, GaugeMotion};
use tunnelstitch_geometry::trajectory::{Jitter, JitterModel, Pose, Rig, StampedPose, poses_of};

/// Gaussian prior on poses and exposures.
///
/// Its cost is `½ Σ eᵀ Σ⁻¹ e`, with the errors
///
/// - `independent`: each pose around its initial value, `e = (Log(R̂ᵀR), t − t̂)`;
/// - `random-walk`: each step around its initial value,
///   `e = (Log(ΔR̂ᵀ R_{k−1}ᵀ R_k), (t_k − t_{k−1}) − (t̂_k − t̂_{k−1}))` with
///   `ΔR̂ = R̂_{k−1}ᵀ R̂_k`, and the first frame around its initial pose, which also fixes the two
///   gauge freedoms;
/// - in a rig, where the model of the noise is that of the first frame of each moment: each further
///   frame b of the moment around its place relative to the frame a before it,
///   `e = (Log(M_Rᵀ R_aᵀ R_b), R_aᵀ (t_b − t_a) − M_t)` with the relation `M` of their cameras. A
///   step to the next moment starts at the first camera, where the relation puts it from the last;
/// - log-gain and bias of every frame around 0: without this prior they would absorb misalignment,
///   and the exposures of all frames could drift together.
///
/// `R̂, t̂` are the initial poses transformed to the tunnel, and t is multiplied by the scale, both
/// by the [`Datum`]. Σ is the diagonal variance of the jitter, for a step of a random walk times
/// its [`Prior::step_ratio`], for a pose times its [`Prior::variance_ratios`]; that of a relation
/// is the rig's.
#[derive(Clone, Debug)]
pub struct Prior {
    /// Noise model of the initial poses.
    pub jitter: Jitter,
    /// The initial poses of all frames.
    pub initial: Vec<Pose>,
    /// Their times, seconds. A longer step, as where frames are missing, is less certain.
    pub times_s: Vec<f64>,
    /// Median step between these times, seconds.
    pub median_step_s: f64,
    /// Factors of the variance of each initial pose: 1 if it was given, more if it was interpolated
    /// (the steps of its gap).
    pub variance_ratios: Vec<f64>,
    /// The relation of the cameras, if the frames are those of a rig.
    pub rig: Option<Rig>,
    /// 1-σ of the log-gain.
    pub log_gain_sigma: f64,
    /// 1-σ of the bias, grey levels.
    pub bias_sigma: f64,
}

impl Prior {
    /// The prior of initial poses with this noise, some of them interpolated, and of exposures;
    /// `rig`: of the cameras, if there are several.
    pub fn new(
        jitter: Jitter,
        rig: Option<&Rig>,
        initial: &[StampedPose],
        gaps: &[PoseGap],
        options: &RefineOptions,
    ) -> Self {
        let times_s: Vec<f64> = initial.iter().map(|stamped| stamped.time_s).collect();
        let moments = times_s.iter().step_by(rig.map_or(1, Rig::cameras));
        Self {
            jitter,
            initial: poses_of(initial),
            median_step_s: median_step_s(&moments.copied().collect::<Vec<f64>>()),
            rig: rig.cloned(),
            variance_ratios: variance_ratios(initial.len(), gaps),
            times_s,
            log_gain_sigma: options.log_gain_sigma,
            bias_sigma: options.bias_sigma,
        }
    }
}

/// Median step between times, seconds; 1 for fewer than two times.
fn median_step_s(times_s: &[f64]) -> f64 {
    let steps = times_s.windows(2).map(|t| t[1] - t[0]);
    upper_median(steps.collect()).unwrap_or(1.0)
}

/// Factors of the variance of the initial poses of `count` frames: 1, but the steps of the gap for
/// frames whose poses were interpolated.
fn variance_ratios(count: usize, gaps: &[PoseGap]) -> Vec<f64> {
    let mut ratios = vec![1.0; count];
    for gap in gaps {
        for ratio in ratios
            .iter_mut()
            .take(gap.frames.end)
            .skip(gap.frames.start)
        {
            *ratio = gap.steps() as f64;
        }
    }
    ratios
}

/// Applies the step from `from` to `to` to a pose.
pub fn predict(pose: &Pose, from: &Pose, to: &Pose) -> Pose {
    Pose::new(
        pose.r_wc * (from.r_wc.inverse() * to.r_wc),
        pose.t_wc + (to.t_wc - from.t_wc),
    )
}

impl Prior {
    /// Number of median steps between two frames, by their times: the factor by which the variance
    /// of a random walk grows. Each step counts at least once, and one of an interpolated pose as
    /// often as the gap has steps.
    pub fn steps_between(&self, a: usize, b: usize) -> f64 {
        (a..b).map(|k| self.step_ratio(k)).sum()
    }

    /// Step from frame `k` to the next over the median step, at least 1, times the larger of the
    /// variance ratios of both; within a moment of a rig, the largest ratio of a variance of the
    /// relation to that of a step.
    fn step_ratio(&self, k: usize) -> f64 {
        if let Some(rig) = self.rig_of_link(k + 1) {
            let of_translation = |sigma: &f64| rig.translation_sigma_m / sigma;
            let ratios = self.jitter.translation_sigma_m.iter().map(of_translation);
            let of_rotation = rig.rotation_sigma_rad / self.jitter.rotation_sigma_rad;
            return ratios.fold(of_rotation, f64::max).powi(2);
        }
        let time_ratio = ((self.times_s[k + 1] - self.times_s[k]) / self.median_step_s).max(1.0);
        time_ratio * self.variance_ratios[k].max(self.variance_ratios[k + 1])
    }

    /// Lever arm of an error of scale or tilt, metres: the longest step of a random walk, or the
    /// largest distance of independent poses from their mean.
    pub fn lever_arm_m(&self) -> f64 {
        let cameras = self.rig.as_ref().map_or(1, Rig::cameras);
        let poses: Vec<Pose> = self.initial.iter().step_by(cameras).copied().collect();
        let lengths: Vec<f64> = match self.jitter.model {
            JitterModel::RandomWalk => {
                let steps = poses.windows(2);
                steps.map(|p| (p[1].t_wc - p[0].t_wc).norm()).collect()
            }
            JitterModel::Independent => {
                let sum: Vector3<f64> = poses.iter().map(|pose| pose.t_wc).sum();
                let mean = sum / poses.len().max(1) as f64;
                poses.iter().map(|p| (p.t_wc - mean).norm()).collect()
            }
        };
        lengths.into_iter().fold(0.0, f64::max)
    }

    /// The rig, if frame `k` is of the same moment as the frame before it.
    fn rig_of_link(&self, k: usize) -> Option<&Rig> {
        self.rig.as_ref().filter(|rig| rig.camera_of(k) > 0)
    }

    /// True if frame `k` follows another one of the same moment of a rig.
    pub fn is_related(&self, k: usize) -> bool {
        self.rig_of_link(k).is_some()
    }

    /// True if two frames are of the same moment of a rig.
    pub fn is_same_moment(&self, a: usize, b: usize) -> bool {
        let of_moment = |rig: &Rig| rig.first_of_moment(a) == rig.first_of_moment(b);
        self.rig.as_ref().is_some_and(of_moment)
    }

    /// True if frame `k` and the frame before it have a common error.
    fn is_linked(&self, k: usize) -> bool {
        self.jitter.model == JitterModel::RandomWalk || self.is_related(k)
    }

    /// The first frame of the moment of frame `k`, and the pose of its camera where the relation
    /// puts it from frame `k` at `pose`, whose positions are metres over `scale`; the frame itself
    /// without a rig.
    pub fn first_of_moment(&self, k: usize, pose: &Pose, scale: f64) -> (usize, Pose) {
        match self.rig_of_link(k) {
            Some(rig) => {
                let first = rig.first_of_moment(k);
                (first, transferred(pose, &rig.relation(k, first), scale).0)
            }
            None => (k, *pose),
        }
    }

    /// Predicts the pose of frame `to` from that of frame `from` by the initial steps.
    pub fn predict(&self, from: usize, pose: &Pose, to: usize) -> Pose {
        self.predict_by(&|k| self.initial[k], 1.0, (from, pose), to)
    }

    /// Predicts the pose of frame `to`, in the tunnel of the given radius, from that of frame
    /// `from` by the initial steps as `datum` has them.
    pub fn predict_at(&self, datum: &Datum, from: usize, pose: &Pose, to: usize) -> Pose {
        let initial = |k: usize| datum.to_nominal_tunnel(&self.initial[k]);
        self.predict_by(&initial, datum.scale, (from, pose), to)
    }

    /// Predicts the pose of frame `to` from that of frame `from` by the steps of these initial
    /// poses, whose positions are metres over `scale`: in a rig, from the first camera of the one
    /// moment to that of the other.
    fn predict_by(
        &self,
        initial: &dyn Fn(usize) -> Pose,
        scale: f64,
        (from, pose): (usize, &Pose),
        to: usize,
    ) -> Pose {
        let (start, pose) = self.first_of_moment(from, pose, scale);
        let Some(rig) = &self.rig else {
            return predict(&pose, &initial(start), &initial(to));
        };
        let end = rig.first_of_moment(to);
        let first = predict(&pose, &initial(start), &initial(end));
        transferred(&first, &rig.relation(end, to), scale).0
    }

    /// Pairs of frames within `active` with a common error, counted from its start.
    pub fn pairs(&self, active: &Range<usize>) -> Vec<(usize, usize)> {
        let linked = (1..active.len()).filter(|k| self.is_linked(active.start + k));
        linked.map(|k| (k - 1, k)).collect()
    }

    /// Adds gradient and normal matrix of the `active` frames, and returns the cost `½ Σ eᵀ Σ⁻¹ e`.
    ///
    /// `estimates` are those of the frames `participants`, which include the active ones. `border`
    /// receives the part of the shared parameters, if they are estimated.
    #[expect(
        clippy::too_many_arguments,
        reason = "the estimates first, then the sums"
    )]
    pub fn add_to(
        &self,
        participants: &Range<usize>,
        estimates: &[FrameEstimate],
        active: &Range<usize>,
        datum: &Datum,
        pattern: &Pattern,
        normal: &mut NormalEquations,
        border: Option<&mut SharedBorder>,
    ) -> f64 {
        let mut cost = 0.0;
        let mut sums = PriorSums {
            active,
            datum,
            pattern,
            normal,
            border,
        };
        for k in active.clone() {
            let estimate = &estimates[k - participants.start];
            cost += self.add_exposure(estimate, k - active.start, pattern, sums.normal);
            // A frame whose moment begins before the window has its initial pose all the same.
            let is_first = !self.is_related(k) || k == participants.start;
            if k == 0 || (is_first && self.jitter.model == JitterModel::Independent) {
                cost += self.add_absolute(k, &estimate.pose, &mut sums);
            }
        }
        let last = (active.end + 1).min(participants.end);
        let links = active.start.max(participants.start + 1)..last;
        for k in links.filter(|k| self.is_linked(*k)) {
            let before = &estimates[k - 1 - participants.start].pose;
            let pose = &estimates[k - participants.start].pose;
            cost += self.add_relative(k, before, pose, &mut sums);
        }
        cost
    }

    /// Motion along the gauge that minimises the cost of the prior: that of the first frame for a
    /// random walk, led there from the first of the frames `placed` by the initial steps; of
    /// all of these frames for independent errors.
    pub fn align_gauge(
        &self,
        gauge: &Gauge,
        estimates: &[FrameEstimate],
        datum: &Datum,
        placed: &[bool],
    ) -> GaugeMotion {
        let initial = |k: usize| datum.to_nominal_tunnel(&self.initial[k]);
        let chosen = (0..estimates.len()).filter(|k| placed[*k]);
        let pairs = chosen.map(|k| (k, estimates[k].pose));
        let (poses, initial): (Vec<Pose>, Vec<Pose>) = match self.jitter.model {
            JitterModel::RandomWalk => pairs
                .take(1)
                .map(|(k, pose)| (self.predict_at(datum, k, &pose, 0), initial(0)))
                .unzip(),
            JitterModel::Independent => pairs.map(|(k, pose)| (pose, initial(k))).unzip(),
        };
        gauge.align(&poses, &initial)
    }

    /// Half the squared Mahalanobis distance of a pose from the expected pose.
    pub fn deviation_cost(&self, expected: &Pose, pose: &Pose) -> f64 {
        self.jitter.deviation_cost(expected, pose)
    }

    /// Adds the errors of gain and bias.
    fn add_exposure(
        &self,
        estimate: &FrameEstimate,
        slot: usize,
        pattern: &Pattern,
        normal: &mut NormalEquations,
    ) -> f64 {
        let (gain, bias) = (self.log_gain_sigma.powi(-2), self.bias_sigma.powi(-2));
        let mut block = Block::zeros();
        block[(6, 6)] = gain;
        block[(7, 7)] = bias;
        normal.add_block(pattern, slot, slot, &block);
        normal.gradient[slot][6] += gain * estimate.log_gain;
        normal.gradient[slot][7] += bias * estimate.bias;
        0.5 * (gain * estimate.log_gain.powi(2) + bias * estimate.bias.powi(2))
    }

    /// Adds the error of a pose around its initial value.
    fn add_absolute(&self, k: usize, pose: &Pose, sums: &mut PriorSums) -> f64 {
        let datum = sums.datum;
        let initial = datum.to_tunnel(&self.initial[k]);
        let (e, j) = absolute_error(&initial, pose, datum.scale);
        let weighted =
            Matrix6::from_diagonal(&(self.jitter.information() / self.variance_ratios[k]));
        let slot = k - sums.active.start;
        add_gradient(sums.normal, slot, &(j.transpose() * weighted * e));
        let block = embed(&(j.transpose() * weighted * j));
        sums.normal.add_block(sums.pattern, slot, slot, &block);
        if let Some(border) = &mut sums.border {
            let j_shared = absolute_error_by_datum(datum, &initial, pose, &e);
            add_shared(border, &j_shared, &weighted, &e, [(Some(slot), &j)]);
        }
        0.5 * (e.transpose() * weighted * e)[0]
    }

    /// The error of the step, or within a moment of the relation, that leads to frame `k`, and its
    /// derivative by the datum.
    fn relative_error(
        &self,
        k: usize,
        (before, pose): (&Pose, &Pose),
        datum: &Datum,
    ) -> (RelativeError, DatumJacobian) {
        if let Some(rig) = self.rig_of_link(k) {
            let error = relation_error(&rig.relation(k - 1, k), before, pose, datum.scale);
            return (error, relation_error_by_datum(datum, (before, pose)));
        }
        let in_tunnel = |k: usize| datum.to_tunnel(&self.initial[k]);
        let initial = in_tunnel(k);
        let Some(rig) = self.rig_of_link(k - 1) else {
            let initial_before = in_tunnel(k - 1);
            return (
                relative_error(&initial_before, &initial, before, pose, datum.scale),
                relative_error_by_datum(datum, (&initial_before, &initial), (before, pose)),
            );
        };
        // From the last camera of a moment to the first of the next.
        let first = rig.first_of_moment(k - 1);
        let initial_before = in_tunnel(first);
        let (moved, by_before) = transferred(before, &rig.relation(k - 1, first), datum.scale);
        let error = relative_error(&initial_before, &initial, &moved, pose, datum.scale);
        (
            (error.0, error.1 * by_before, error.2),
            relative_error_by_datum(datum, (&initial_before, &initial), (before, pose)),
        )
    }

    /// Diagonal of the inverse covariance of the error that leads to frame `k`.
    fn relative_information(&self, k: usize) -> Vector6<f64> {
        match self.rig_of_link(k) {
            Some(rig) => {
                let r = rig.rotation_sigma_rad.powi(-2);
                let t = rig.translation_sigma_m.powi(-2);
                Vector6::new(r, r, r, t, t, t)
            }
            None => self.jitter.information() / self.step_ratio(k - 1),
        }
    }

    /// Adds the error of the step or the relation that leads to frame `k`.
    fn add_relative(&self, k: usize, before: &Pose, pose: &Pose, sums: &mut PriorSums) -> f64 {
        let ((e, j_before, j), j_shared) = self.relative_error(k, (before, pose), sums.datum);
        let weighted = Matrix6::from_diagonal(&self.relative_information(k));
        let slot = |k: usize| sums.active.contains(&k).then(|| k - sums.active.start);
        let (slot_before, slot) = (slot(k - 1), slot(k));
        for (slot, j) in [(slot_before, &j_before), (slot, &j)] {
            if let Some(slot) = slot {
                add_gradient(sums.normal, slot, &(j.transpose() * weighted * e));
                let block = embed(&(j.transpose() * weighted * j));
                sums.normal.add_block(sums.pattern, slot, slot, &block);
            }
        }
        if let (Some(a), Some(b)) = (slot_before, slot) {
            let block = j_before.transpose() * weighted * j;
            sums.normal.add_block(sums.pattern, a, b, &embed(&block));
        }
        if let Some(border) = &mut sums.border {
            let frames = [(slot_before, &j_before), (slot, &j)];
            add_shared(border, &j_shared, &weighted, &e, frames);
        }
        0.5 * (e.transpose() * weighted * e)[0]
    }
}

/// The sums that the prior adds to, and the frames they are for.
struct PriorSums<'s> {
    active: &'s Range<usize>,
    datum: &'s Datum,
    pattern: &'s Pattern,
    normal: &'s mut NormalEquations,
    border: Option<&'s mut SharedBorder>,
}

/// Adds an error to the border; `frames` are the slots of its poses with their Jacobians.
fn add_shared<const N: usize>(
    border: &mut SharedBorder,
    j_shared: &DatumJacobian,
    weighted: &Matrix6<f64>,
    e: &Vector6<f64>,
    frames: [(Option<usize>, &Matrix6<f64>); N],
) {
    let scaled = weighted * j_shared;
    for (slot, j) in frames {
        if let Some(slot) = slot {
            let mut target =
                border.frames[slot].fixed_view_mut::<6, DATUM_PARAMETERS>(0, INTRINSIC_PARAMETERS);
            target += j.transpose() * scaled;
        }
    }
    let mut own = border
        .own
        .fixed_view_mut::<DATUM_PARAMETERS, DATUM_PARAMETERS>(
            INTRINSIC_PARAMETERS,
            INTRINSIC_PARAMETERS,
        );
    own += j_shared.transpose() * scaled;
    let mut gradient = border
        .gradient
        .fixed_rows_mut::<DATUM_PARAMETERS>(INTRINSIC_PARAMETERS);
    gradient += scaled.transpose() * e;
}

/// Embeds a block of poses in one of frames.
fn embed(pose_block: &Matrix6<f64>) -> Block {
    let mut block = Block::zeros();
    block.fixed_view_mut::<6, 6>(0, 0).copy_from(pose_block);
    block
}

/// Adds the gradient of a pose.
fn add_gradient(normal: &mut NormalEquations, slot: usize, gradient: &Vector6<f64>) {
    let target: &mut FrameStep = &mut normal.gradient[slot];
    for k in 0..6 {
        target[k] += gradient[k];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::prior_terms::tests::{calibration, kappa, pose};
    use crate::parameters::calibration::Kappa;

    /// A rig of three cameras.
    fn rig() -> Rig {
        let mounts = [0.3, -0.4, 1.1].map(|seed| Pose::new(pose(seed).r_wc, 0.1 * pose(seed).t_wc));
        Rig::new(mounts.to_vec(), 0.004, 0.002).unwrap()
    }

    /// Central differences, for both jitter models, one camera and a rig, frames and datum.
    #[test]
    fn gradient_is_the_derivative_of_the_cost() {
        for (model, rig) in [
            (JitterModel::RandomWalk, None),
            (JitterModel::Independent, None),
            (JitterModel::RandomWalk, Some(rig())),
            (JitterModel::Independent, Some(rig())),
        ] {
            let prior = Prior {
                jitter: Jitter {
                    model,
                    rotation_sigma_rad: 0.03,
                    translation_sigma_m: [0.02, 0.02, 0.03],
                },
                initial: (0..5).map(|k| pose(0.1 * f64::from(k))).collect(),
                times_s: vec![0.0, 1.0, 2.0, 5.0, 6.0],
                median_step_s: 1.0,
                variance_ratios: vec![1.0, 3.0, 3.0, 1.0, 1.0],
                rig,
                log_gain_sigma: 0.3,
                bias_sigma: 10.0,
            };
            let (participants, active) = (0..5, 1..4);
            let pattern = Pattern::new(3, prior.pairs(&active));
            let estimates: Vec<_> = (0..5)
                .map(|k| FrameEstimate {
                    pose: pose(0.13 * f64::from(k)),
                    log_gain: 0.1,
                    bias: 2.0,
                })
                .collect();
            let evaluate = |estimates: &[FrameEstimate], kappa: &Kappa| {
                let mut normal = NormalEquations::zeros(&pattern);
                let mut border = SharedBorder::zeros(3);
                let datum = calibration().datum(kappa);
                let cost = prior.add_to(
                    &participants,
                    estimates,
                    &active,
                    &datum,
                    &pattern,
                    &mut normal,
                    Some(&mut border),
                );
                (cost, normal, border)
            };
            let (_, normal, border) = evaluate(&estimates, &kappa());
            for k in INTRINSIC_PARAMETERS..INTRINSIC_PARAMETERS + DATUM_PARAMETERS {
                let cost_at = |amount: f64| {
                    let mut moved = kappa();
                    moved[k] += amount;
                    evaluate(&estimates, &moved).0
                };
                let slope = (cost_at(1e-6) - cost_at(-1e-6)) / 2e-6;
                let analytic = border.gradient[k];
                assert!((slope - analytic).abs() < 1e-4 * (1.0 + analytic.abs()));
            }
            for slot in 0..3 {
                for k in 0..8 {
                    let cost_at = |amount: f64| {
                        let mut moved = estimates.clone();
                        let mut step = FrameStep::zeros();
                        step[k] = amount;
                        moved[slot + 1] = moved[slot + 1].retract(&step);
                        evaluate(&moved, &kappa()).0
                    };
                    let slope = (cost_at(1e-6) - cost_at(-1e-6)) / 2e-6;
                    let analytic = normal.gradient[slot][k];
                    assert!((slope - analytic).abs() < 1e-4 * (1.0 + analytic.abs()));
                }
            }
        }
    }

    /// A rig's frames are where its relation puts them, one from another and over a step.
    #[test]
    fn frames_of_a_rig_are_predicted_through_their_first_camera() {
        let rig = rig();
        let place = |body: &Pose| -> Vec<Pose> {
            let mounts = rig.mounts().iter();
            mounts.map(|mount| body.after(mount)).collect()
        };
        let bodies = [pose(0.1), pose(0.4)];
        let initial: Vec<Pose> = bodies.iter().flat_map(place).collect();
        let turned = |body: &Pose| pose(2.0).after(body);
        let poses = place(&turned(&bodies[0]));
        let prior = Prior {
            rig: Some(rig.clone()),
            ..crate::test_scene::independent_prior(&initial)
        };
        assert!(prior.predict(0, &poses[0], 2).local(&poses[2]).norm() < 1e-12);
        assert!(prior.predict(2, &poses[2], 1).local(&poses[1]).norm() < 1e-12);
        // A step is that of the first cameras, along the world's axes.
        let next = predict(&poses[0], &initial[0], &initial[3]);
        let last = next.after(&rig.relation(3, 5));
        assert!(prior.predict(1, &poses[1], 5).local(&last).norm() < 1e-12);
        // 1-σ of the relation over that of a step: 0.002 m and 0.004 rad over 0.05.
        assert!((prior.steps_between(0, 2) - 2.0 * 0.08f64.powi(2)).abs() < 1e-12);
        assert!((prior.steps_between(2, 3) - 1.0).abs() < 1e-12);
        assert!(prior.is_same_moment(0, 2) && !prior.is_same_moment(2, 3));
        assert_eq!(prior.pairs(&(1..6)), [(0, 1), (2, 3), (3, 4)]);
    }

    /// A step into, within and out of a gap counts as often as the gap has steps.
    #[test]
    fn steps_of_a_gap_are_less_certain() {
        let gaps = [PoseGap { frames: 2..4 }];
        let ratios = variance_ratios(6, &gaps);
        assert_eq!(ratios, [1.0, 1.0, 3.0, 3.0, 1.0, 1.0]);
        let prior = Prior {
            variance_ratios: ratios,
            ..crate::test_scene::independent_prior(&[pose(0.0); 6])
        };
        let steps: Vec<f64> = (0..5).map(|k| prior.steps_between(k, k + 1)).collect();
        assert_eq!(steps, [1.0, 3.0, 3.0, 3.0, 1.0]);
        assert_eq!(prior.steps_between(0, 5), 11.0);
    }
}
