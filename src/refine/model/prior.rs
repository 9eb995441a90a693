//! What is known before a pixel is read: how far the initial poses and plain exposures may be off.

use crate::numerics::median::upper_median;
use crate::refine::linear::bordered_system::SharedBorder;
use crate::refine::linear::normal_equations::{Block, NormalEquations, Pattern};
use crate::refine::parameters::calibration::{LENS, METRIC, Metric};
use crate::refine::parameters::frame_estimate::{FrameEstimate, FrameStep};
use crate::surface::{Gauge, GaugeMotion};
use crate::trajectory::{Jitter, JitterModel, Pose, so3};
use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3, Vector6};
use std::ops::Range;

/// Gaussian prior on poses and exposures.
///
/// - `independent`: each pose around its initial value, `e = (Log(R̂ᵀR), t − t̂)`;
/// - `random-walk`: each step around its initial value,
///   `e = (Log(ΔR̂ᵀ R_{k−1}ᵀ R_k), (t_k − t_{k−1}) − (t̂_k − t̂_{k−1}))` with
///   `ΔR̂ = R̂_{k−1}ᵀ R̂_k`, and the first frame around its initial pose, which also fixes the two
///   gauge freedoms;
/// - where the initial poses' frame and metres lie otherwise to the tunnel ([`Metric`]), `R̂` and
///   `t̂` are the initial poses as placed in the tunnel, and t is multiplied by the scale;
/// - log-gain and bias of every frame around 0: without it they would swallow misalignment, and all
///   of them together could drift.
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
    let steps = times_s.windows(2).map(|t| t[1] - t[0]);
    upper_median(steps.collect()).unwrap_or(1.0)
}

/// The pose after `pose` if the step from `from` to `to` is right.
pub fn predict(pose: &Pose, from: &Pose, to: &Pose) -> Pose {
    Pose::new(
        pose.r_wc * (from.r_wc.inverse() * to.r_wc),
        pose.t_wc + (to.t_wc - from.t_wc),
    )
}

impl Prior {
    /// How many usual steps lie between two frames, by their times: variances of a random walk grow
    /// by so much.
    ///
    /// The usual step is the median one; a step counts for no less than one.
    pub fn steps_between(&self, a: usize, b: usize) -> f64 {
        (a..b).map(|k| self.step_ratio(k)).sum()
    }

    /// The step from frame `k` to the next over the usual one.
    fn step_ratio(&self, k: usize) -> f64 {
        ((self.times_s[k + 1] - self.times_s[k]) / self.usual_step_s).max(1.0)
    }

    /// How far a wrong scale or tilt reaches: the longest step of a random walk, or the distance of
    /// the farthest of independent poses from their middle, metres.
    pub fn arm_m(&self) -> f64 {
        let poses = &self.initial;
        let lengths: Vec<f64> = match self.jitter.model {
            JitterModel::RandomWalk => {
                let steps = poses.windows(2);
                steps.map(|p| (p[1].t_wc - p[0].t_wc).norm()).collect()
            }
            JitterModel::Independent => {
                let sum: Vector3<f64> = poses.iter().map(|pose| pose.t_wc).sum();
                let middle = sum / poses.len().max(1) as f64;
                poses.iter().map(|p| (p.t_wc - middle).norm()).collect()
            }
        };
        lengths.into_iter().fold(0.0, f64::max)
    }

    /// The pose of frame `to` if frame `from` is at `pose` and the initial steps between them are
    /// right.
    pub fn predict(&self, from: usize, pose: &Pose, to: usize) -> Pose {
        predict(pose, &self.initial[from], &self.initial[to])
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
    /// `estimates` are those of the frames `participants`, which include the active ones. `border`:
    /// what it adds for the shared unknowns, if they are estimated.
    #[expect(
        clippy::too_many_arguments,
        reason = "what is known, then what is added to"
    )]
    pub fn add(
        &self,
        participants: &Range<usize>,
        estimates: &[FrameEstimate],
        active: &Range<usize>,
        metric: &Metric,
        pattern: &Pattern,
        normal: &mut NormalEquations,
        border: Option<&mut SharedBorder>,
    ) -> f64 {
        let mut cost = 0.0;
        let mut sums = Sums {
            active,
            metric,
            pattern,
            normal,
            border,
        };
        for k in active.clone() {
            let estimate = &estimates[k - participants.start];
            cost += self.add_exposure(estimate, k - active.start, pattern, sums.normal);
            if self.jitter.model == JitterModel::Independent || k == 0 {
                cost += self.add_absolute(k, &estimate.pose, &mut sums);
            }
        }
        if self.jitter.model == JitterModel::RandomWalk {
            let last = (active.end + 1).min(participants.end);
            for k in active.start.max(participants.start + 1)..last {
                let before = &estimates[k - 1 - participants.start].pose;
                let pose = &estimates[k - participants.start].pose;
                cost += self.add_relative(k, before, pose, &mut sums);
            }
        }
        cost
    }

    /// The gauge motion after which the poses agree best with the prior: at the first frame for a
    /// random walk, over all frames for independent errors.
    pub fn settle_gauge(
        &self,
        gauge: &Gauge,
        estimates: &[FrameEstimate],
        metric: &Metric,
    ) -> GaugeMotion {
        let count = match self.jitter.model {
            JitterModel::RandomWalk => 1,
            JitterModel::Independent => estimates.len(),
        };
        let poses: Vec<Pose> = estimates[..count].iter().map(|e| e.pose).collect();
        let initial = self.initial[..count].iter();
        let initial: Vec<Pose> = initial.map(|pose| metric.place_nominal(pose)).collect();
        gauge.align(&poses, &initial)
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

    fn add_absolute(&self, k: usize, pose: &Pose, sums: &mut Sums) -> f64 {
        let metric = sums.metric;
        let initial = metric.place(&self.initial[k]);
        let (e, j) = absolute(&initial, pose, metric.scale);
        let weighted = Matrix6::from_diagonal(&self.information());
        let slot = k - sums.active.start;
        add_gradient(sums.normal, slot, &(j.transpose() * weighted * e));
        let block = embed(&(j.transpose() * weighted * j));
        sums.normal.add_block(sums.pattern, slot, slot, &block);
        if let Some(border) = &mut sums.border {
            let j_shared = absolute_by_metric(metric, &initial, pose, &e);
            add_shared(border, &j_shared, &weighted, &e, [(Some(slot), &j)]);
        }
        0.5 * (e.transpose() * weighted * e)[0]
    }

    fn add_relative(&self, k: usize, before: &Pose, pose: &Pose, sums: &mut Sums) -> f64 {
        let metric = sums.metric;
        let [initial_before, initial] = [k - 1, k].map(|k| metric.place(&self.initial[k]));
        let (e, j_before, j) = relative(&initial_before, &initial, before, pose, metric.scale);
        let weighted = Matrix6::from_diagonal(&(self.information() / self.step_ratio(k - 1)));
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
            let j_shared = relative_by_metric(metric, (&initial_before, &initial), (before, pose));
            let frames = [(slot_before, &j_before), (slot, &j)];
            add_shared(border, &j_shared, &weighted, &e, frames);
        }
        0.5 * (e.transpose() * weighted * e)[0]
    }
}

/// What the prior adds to, and for which frames.
struct Sums<'s> {
    active: &'s Range<usize>,
    metric: &'s Metric,
    pattern: &'s Pattern,
    normal: &'s mut NormalEquations,
    border: Option<&'s mut SharedBorder>,
}

/// Derivative of an error by `(ln r, τ_x, τ_z, o_x, o_z)`.
type ByMetric = SMatrix<f64, 6, METRIC>;

/// Error of a pose around its initial value (as placed in the tunnel), and its derivative by the
/// pose's step.
fn absolute(initial: &Pose, pose: &Pose, scale: f64) -> (Vector6<f64>, Matrix6<f64>) {
    let e = initial.local(&Pose::new(pose.r_wc, pose.t_wc * scale));
    let mut j = Matrix6::identity() * scale;
    j.fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&so3::right_jacobian_inverse(&e.fixed_rows::<3>(0).into()));
    (e, j)
}

/// Derivative of [`absolute`] by how the initial pose is placed.
fn absolute_by_metric(metric: &Metric, initial: &Pose, pose: &Pose, e: &Vector6<f64>) -> ByMetric {
    // The initial attitude turns by exp(Jδτ) on the left, so the error turns by exp(−RᵀJδτ) on the
    // right.
    let tilt = metric.tilt_jacobian();
    let r_cw = pose.r_wc.inverse().to_rotation_matrix();
    let right = so3::right_jacobian_inverse(&e.fixed_rows::<3>(0).into());
    let turned = -(right * r_cw.matrix() * tilt);
    let mut j = by_metric(metric, &metric.arm(initial), &pose.t_wc);
    for (column, axis) in [(1, 0), (2, 2)] {
        j.fixed_view_mut::<3, 1>(0, column)
            .copy_from(&turned.column(axis));
    }
    (j[(3, 3)], j[(5, 4)]) = (-1.0, -1.0);
    j
}

/// What scale and tilt do to `scale · t − R_G t̂`, with `arm = R_G t̂`.
fn by_metric(metric: &Metric, arm: &Vector3<f64>, t: &Vector3<f64>) -> ByMetric {
    let moved: Matrix3<f64> = so3::skew(arm) * metric.tilt_jacobian();
    let mut j = ByMetric::zeros();
    j.fixed_view_mut::<3, 1>(3, 0)
        .copy_from(&(t * metric.scale));
    for (column, axis) in [(1, 0), (2, 2)] {
        j.fixed_view_mut::<3, 1>(3, column)
            .copy_from(&moved.column(axis));
    }
    j
}

/// Error of the step between two poses, and its derivatives by the earlier and the later pose's
/// step.
fn relative(
    initial_before: &Pose,
    initial: &Pose,
    before: &Pose,
    pose: &Pose,
    scale: f64,
) -> (Vector6<f64>, Matrix6<f64>, Matrix6<f64>) {
    let planned = initial_before.r_wc.inverse() * initial.r_wc;
    let turned = before.r_wc.inverse() * pose.r_wc;
    let omega = so3::log(&(planned.inverse() * turned));
    let rho = (pose.t_wc - before.t_wc) * scale - (initial.t_wc - initial_before.t_wc);
    let e = Vector6::new(omega.x, omega.y, omega.z, rho.x, rho.y, rho.z);
    let right = so3::right_jacobian_inverse(&omega);
    let mut j = Matrix6::identity() * scale;
    j.fixed_view_mut::<3, 3>(0, 0).copy_from(&right);
    let mut j_before = -Matrix6::identity() * scale;
    j_before
        .fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&(-right * turned.inverse().to_rotation_matrix().matrix()));
    (e, j_before, j)
}

/// Derivative of [`relative`] by how the initial poses are placed: steps turn with them, and
/// offsets cancel.
fn relative_by_metric(
    metric: &Metric,
    (initial_before, initial): (&Pose, &Pose),
    (before, pose): (&Pose, &Pose),
) -> ByMetric {
    by_metric(
        metric,
        &(initial.t_wc - initial_before.t_wc),
        &(pose.t_wc - before.t_wc),
    )
}

/// Adds an error's part in the border; its derivatives by poses belong to the slots.
fn add_shared<const N: usize>(
    border: &mut SharedBorder,
    j_shared: &ByMetric,
    weighted: &Matrix6<f64>,
    e: &Vector6<f64>,
    frames: [(Option<usize>, &Matrix6<f64>); N],
) {
    let scaled = weighted * j_shared;
    for (slot, j) in frames {
        if let Some(slot) = slot {
            let mut target = border.frames[slot].fixed_view_mut::<6, METRIC>(0, LENS);
            target += j.transpose() * scaled;
        }
    }
    let mut own = border.own.fixed_view_mut::<METRIC, METRIC>(LENS, LENS);
    own += j_shared.transpose() * scaled;
    let mut gradient = border.gradient.fixed_rows_mut::<METRIC>(LENS);
    gradient += scaled.transpose() * e;
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
    use crate::camera::Camera;
    use crate::refine::parameters::calibration::{Calibration, Kappa};

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

    /// A tilted, shifted frame in metres that are not the tunnel's.
    fn kappa() -> Kappa {
        let mut kappa = Kappa::zeros();
        let metric = [0.03, 0.05, -0.08, 0.2, -0.1];
        kappa.fixed_rows_mut::<5>(LENS).copy_from_slice(&metric);
        kappa
    }

    fn calibration() -> Calibration {
        Calibration {
            middle_h_m: 0.4,
            ..Calibration::none(&Camera::from_vertical_fov(16, 16, 1.0))
        }
    }

    #[test]
    fn jacobians_match_central_differences() {
        let (a, b, c, d) = (pose(0.1), pose(0.5), pose(0.2), pose(0.8));
        let s = 1.1;
        let (_, j) = absolute(&a, &c, s);
        assert!((numeric(|xi| absolute(&a, &c.retract(xi), s).0) - j).norm() < 1e-7);
        let (_, j_before, j) = relative(&a, &b, &c, &d, s);
        assert!((numeric(|xi| relative(&a, &b, &c, &d.retract(xi), s).0) - j).norm() < 1e-7);
        let expected = numeric(|xi| relative(&a, &b, &c.retract(xi), &d, s).0);
        assert!((expected - j_before).norm() < 1e-7);
    }

    #[test]
    fn jacobians_by_the_metric_match_central_differences() {
        let (a, b, c, d) = (pose(0.1), pose(0.5), pose(0.2), pose(0.8));
        let at = |kappa: &Kappa| {
            let metric = calibration().metric(kappa);
            let (a, b) = (metric.place(&a), metric.place(&b));
            let alone = absolute(&a, &c, metric.scale).0;
            (alone, relative(&a, &b, &c, &d, metric.scale).0)
        };
        let metric = calibration().metric(&kappa());
        let (e, _) = at(&kappa());
        let (placed_a, placed_b) = (metric.place(&a), metric.place(&b));
        let alone = absolute_by_metric(&metric, &placed_a, &c, &e);
        let step = relative_by_metric(&metric, (&placed_a, &placed_b), (&c, &d));
        for k in 0..METRIC {
            let moved = |amount: f64| {
                let mut kappa = kappa();
                kappa[LENS + k] += amount;
                at(&kappa)
            };
            let (plus, minus) = (moved(1e-6), moved(-1e-6));
            let numeric = [(plus.0, minus.0), (plus.1, minus.1)].map(|(p, m)| (p - m) / 2e-6);
            assert!((numeric[0] - alone.column(k)).norm() < 1e-7, "absolute {k}");
            assert!((numeric[1] - step.column(k)).norm() < 1e-7, "relative {k}");
        }
    }

    /// The assembled gradient is the derivative of the assembled cost, for both models and for what
    /// is shared, too.
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
            let evaluate = |estimates: &[FrameEstimate], kappa: &Kappa| {
                let mut normal = NormalEquations::zeros(&pattern);
                let mut border = SharedBorder::zeros(3);
                let metric = calibration().metric(kappa);
                let cost = prior.add(
                    &participants,
                    estimates,
                    &active,
                    &metric,
                    &pattern,
                    &mut normal,
                    Some(&mut border),
                );
                (cost, normal, border)
            };
            let (_, normal, border) = evaluate(&estimates, &kappa());
            for k in LENS..LENS + METRIC {
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
}
