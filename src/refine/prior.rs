//! What is known before a pixel is read: how far the initial poses and plain exposures may be off.

use super::estimate::{FrameEstimate, FrameStep};
use super::normal::{Block, NormalEquations, Pattern};
use crate::surface::{Gauge, GaugeMotion};
use crate::trajectory::{Jitter, JitterModel, Pose, so3};
use nalgebra::{Matrix6, Vector6};
use std::ops::Range;

/// Gaussian prior on poses and exposures.
///
/// - `independent`: each pose around its initial value, `e = (Log(R̂ᵀR), t − t̂)`;
/// - `random-walk`: each step around its initial value,
///   `e = (Log(ΔR̂ᵀ R_{k−1}ᵀ R_k), (t_k − t_{k−1}) − (t̂_k − t̂_{k−1}))` with `ΔR̂ = R̂_{k−1}ᵀ R̂_k`, and the
///   first frame around its initial pose, which also fixes the two gauge freedoms;
/// - log-gain and bias of every frame around 0: without it they would swallow misalignment, and all of
///   them together could drift.
#[derive(Clone, Debug)]
pub struct Prior {
    /// Noise model of the initial poses.
    pub jitter: Jitter,
    /// The initial poses of all frames.
    pub initial: Vec<Pose>,
    /// Their times, seconds; where frames are missing, a step is longer and as much less certain.
    pub times_s: Vec<f64>,
    /// The median of the steps between those times, seconds.
    pub usual_step_s: f64,
    /// 1-σ of the log-gain.
    pub log_gain_sigma: f64,
    /// 1-σ of the bias, grey levels.
    pub bias_sigma: f64,
}

/// The median step between times, seconds.
pub fn usual_step_s(times_s: &[f64]) -> f64 {
    let mut steps: Vec<f64> = times_s.windows(2).map(|t| t[1] - t[0]).collect();
    steps.sort_unstable_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(1.0)
}

impl Prior {
    /// How many usual steps lie between two frames, by their times: variances of a random walk grow by so much.
    ///
    /// The usual step is the median one; a step counts for no less than one.
    pub fn steps_between(&self, a: usize, b: usize) -> f64 {
        (a..b).map(|k| self.step_ratio(k)).sum()
    }

    /// The step from frame `k` to the next over the usual one.
    fn step_ratio(&self, k: usize) -> f64 {
        ((self.times_s[k + 1] - self.times_s[k]) / self.usual_step_s).max(1.0)
    }

    /// The pose of frame `to` if frame `from` is at `pose` and the initial steps between them are right.
    pub fn predict(&self, from: usize, pose: &Pose, to: usize) -> Pose {
        let (from, to) = (&self.initial[from], &self.initial[to]);
        Pose::new(
            pose.r_wc * (from.r_wc.inverse() * to.r_wc),
            pose.t_wc + (to.t_wc - from.t_wc),
        )
    }

    /// Pairs of frames that the prior ties together within `active`, counted from its start.
    pub fn pairs(&self, active: &Range<usize>) -> Vec<(usize, usize)> {
        match self.jitter.model {
            JitterModel::RandomWalk => (1..active.len()).map(|k| (k - 1, k)).collect(),
            JitterModel::Independent => Vec::new(),
        }
    }

    /// Adds the prior's cost `½ Σ eᵀ Σ⁻¹ e`, gradient and matrix for the `active` frames.
    ///
    /// `estimates` are those of the frames `participants`, which include the active ones.
    pub fn add(
        &self,
        participants: &Range<usize>,
        estimates: &[FrameEstimate],
        active: &Range<usize>,
        pattern: &Pattern,
        normal: &mut NormalEquations,
    ) -> f64 {
        let mut cost = 0.0;
        for k in active.clone() {
            let estimate = &estimates[k - participants.start];
            cost += self.add_exposure(estimate, k - active.start, pattern, normal);
            if self.jitter.model == JitterModel::Independent || k == 0 {
                cost += self.add_absolute(k, &estimate.pose, active, pattern, normal);
            }
        }
        if self.jitter.model == JitterModel::RandomWalk {
            let last = (active.end + 1).min(participants.end);
            for k in active.start.max(participants.start + 1)..last {
                let before = &estimates[k - 1 - participants.start].pose;
                let pose = &estimates[k - participants.start].pose;
                cost += self.add_relative(k, before, pose, active, pattern, normal);
            }
        }
        cost
    }

    /// The gauge motion after which the poses agree best with the prior: at the first frame for a random walk,
    /// over all frames for independent errors.
    pub fn settle_gauge(&self, gauge: &Gauge, estimates: &[FrameEstimate]) -> GaugeMotion {
        let count = match self.jitter.model {
            JitterModel::RandomWalk => 1,
            JitterModel::Independent => estimates.len(),
        };
        let poses: Vec<Pose> = estimates[..count].iter().map(|e| e.pose).collect();
        gauge.align(&poses, &self.initial[..count])
    }

    /// Half the squared Mahalanobis distance of a pose from where the prior expects it.
    pub fn deviation_cost(&self, expected: &Pose, pose: &Pose) -> f64 {
        let e = expected.local(pose);
        0.5 * e.component_mul(&e).dot(&self.information())
    }

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

    fn information(&self) -> Vector6<f64> {
        let r = self.jitter.rotation_sigma_rad.powi(-2);
        let t = self.jitter.translation_sigma_m.map(|s| s.powi(-2));
        Vector6::new(r, r, r, t[0], t[1], t[2])
    }

    fn add_absolute(
        &self,
        k: usize,
        pose: &Pose,
        active: &Range<usize>,
        pattern: &Pattern,
        normal: &mut NormalEquations,
    ) -> f64 {
        let (e, j) = absolute(&self.initial[k], pose);
        let weighted = Matrix6::from_diagonal(&self.information());
        let slot = k - active.start;
        add_gradient(normal, slot, &(j.transpose() * weighted * e));
        normal.add_block(pattern, slot, slot, &embed(&(j.transpose() * weighted * j)));
        0.5 * (e.transpose() * weighted * e)[0]
    }

    fn add_relative(
        &self,
        k: usize,
        before: &Pose,
        pose: &Pose,
        active: &Range<usize>,
        pattern: &Pattern,
        normal: &mut NormalEquations,
    ) -> f64 {
        let (e, j_before, j) = relative(&self.initial[k - 1], &self.initial[k], before, pose);
        let weighted = Matrix6::from_diagonal(&(self.information() / self.step_ratio(k - 1)));
        let slot = |k: usize| active.contains(&k).then(|| k - active.start);
        for (frame, j) in [(k - 1, &j_before), (k, &j)] {
            if let Some(slot) = slot(frame) {
                add_gradient(normal, slot, &(j.transpose() * weighted * e));
                normal.add_block(pattern, slot, slot, &embed(&(j.transpose() * weighted * j)));
            }
        }
        if let (Some(a), Some(b)) = (slot(k - 1), slot(k)) {
            let block = j_before.transpose() * weighted * j;
            normal.add_block(pattern, a, b, &embed(&block));
        }
        0.5 * (e.transpose() * weighted * e)[0]
    }
}

/// Error of a pose around its initial value, and its derivative by the pose's step.
fn absolute(initial: &Pose, pose: &Pose) -> (Vector6<f64>, Matrix6<f64>) {
    let e = initial.local(pose);
    let mut j = Matrix6::identity();
    j.fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&so3::right_jacobian_inverse(&e.fixed_rows::<3>(0).into()));
    (e, j)
}

/// Error of the step between two poses, and its derivatives by the earlier and the later pose's step.
fn relative(
    initial_before: &Pose,
    initial: &Pose,
    before: &Pose,
    pose: &Pose,
) -> (Vector6<f64>, Matrix6<f64>, Matrix6<f64>) {
    let planned = initial_before.r_wc.inverse() * initial.r_wc;
    let turned = before.r_wc.inverse() * pose.r_wc;
    let omega = so3::log(&(planned.inverse() * turned));
    let rho = (pose.t_wc - before.t_wc) - (initial.t_wc - initial_before.t_wc);
    let e = Vector6::new(omega.x, omega.y, omega.z, rho.x, rho.y, rho.z);
    let right = so3::right_jacobian_inverse(&omega);
    let mut j = Matrix6::identity();
    j.fixed_view_mut::<3, 3>(0, 0).copy_from(&right);
    let mut j_before = -Matrix6::identity();
    j_before
        .fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&(-right * turned.inverse().to_rotation_matrix().matrix()));
    (e, j_before, j)
}

fn embed(pose_block: &Matrix6<f64>) -> Block {
    let mut block = Block::zeros();
    block.fixed_view_mut::<6, 6>(0, 0).copy_from(pose_block);
    block
}

fn add_gradient(normal: &mut NormalEquations, slot: usize, gradient: &Vector6<f64>) {
    let target: &mut FrameStep = &mut normal.gradient[slot];
    for k in 0..6 {
        target[k] += gradient[k];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn pose(seed: f64) -> Pose {
        Pose::new(
            so3::exp(&Vector3::new(0.3 * seed, -0.7 + seed, 0.2 * seed)),
            Vector3::new(0.1 * seed, seed, -0.2),
        )
    }

    fn numeric(error: impl Fn(&Vector6<f64>) -> Vector6<f64>) -> Matrix6<f64> {
        let step = 1e-6;
        let mut j = Matrix6::zeros();
        for k in 0..6 {
            let mut xi = Vector6::zeros();
            xi[k] = step;
            j.set_column(k, &((error(&xi) - error(&-xi)) / (2.0 * step)));
        }
        j
    }

    #[test]
    fn jacobians_match_central_differences() {
        let (a, b, c, d) = (pose(0.1), pose(0.5), pose(0.2), pose(0.8));
        let (_, j) = absolute(&a, &c);
        assert!((numeric(|xi| absolute(&a, &c.retract(xi)).0) - j).norm() < 1e-7);
        let (_, j_before, j) = relative(&a, &b, &c, &d);
        assert!((numeric(|xi| relative(&a, &b, &c, &d.retract(xi)).0) - j).norm() < 1e-7);
        let expected = numeric(|xi| relative(&a, &b, &c.retract(xi), &d).0);
        assert!((expected - j_before).norm() < 1e-7);
    }

    /// The assembled gradient is the derivative of the assembled cost, for both models.
    #[test]
    fn the_gradient_is_the_derivative_of_the_cost() {
        for model in [JitterModel::RandomWalk, JitterModel::Independent] {
            let prior = Prior {
                jitter: Jitter {
                    model,
                    rotation_sigma_rad: 0.03,
                    translation_sigma_m: [0.02, 0.02, 0.03],
                },
                initial: (0..5).map(|k| pose(0.1 * f64::from(k))).collect(),
                times_s: vec![0.0, 1.0, 2.0, 5.0, 6.0],
                usual_step_s: 1.0,
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
            let evaluate = |estimates: &[FrameEstimate]| {
                let mut normal = NormalEquations::zeros(&pattern);
                let cost = prior.add(&participants, estimates, &active, &pattern, &mut normal);
                (cost, normal)
            };
            let (_, normal) = evaluate(&estimates);
            for slot in 0..3 {
                for k in 0..8 {
                    let cost_at = |amount: f64| {
                        let mut moved = estimates.clone();
                        let mut step = FrameStep::zeros();
                        step[k] = amount;
                        moved[slot + 1] = moved[slot + 1].retract(&step);
                        evaluate(&moved).0
                    };
                    let slope = (cost_at(1e-6) - cost_at(-1e-6)) / 2e-6;
                    let analytic = normal.gradient[slot][k];
                    assert!((slope - analytic).abs() < 1e-4 * (1.0 + analytic.abs()));
                }
            }
        }
    }
}
