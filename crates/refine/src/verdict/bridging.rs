//! Poses of frames that the pixels do not place: by the prior, between those that they place.
//!
//! A run of such frames between two placed ones is where the prior puts it with both ends
//! held: a random walk bridges the gap, with the error of the initial steps spread over it; with
//! independent errors each frame stays at its initial pose, or where the relation of a rig puts it
//! from another one of its moment. Without placed frames all keep their initial poses. No
//! frame that does not know its place moves another, or is moved.

use crate::linear::factor_error::FactorError;
use crate::linear::normal_equations::{NormalEquations, Pattern};
use crate::linear::selected_inverse::SelectedInverse;
use crate::linear::sparse_cholesky::SymbolicFactorisation;
use crate::model::prior::Prior;
use crate::parameters::calibration::Datum;
use crate::parameters::frame_estimate::FrameEstimate;
use nalgebra::Matrix6;
use std::ops::Range;
use tunnelstitch_geometry::trajectory::JitterModel;

/// Gauss–Newton steps of a bridge: errors of rotations of a few degrees are linear to 10⁻³, and
/// each step squares that.
const STEPS: usize = 4;

/// The prior's bridges over the frames that are not placed.
pub struct Bridging<'b> {
    /// The prior.
    pub prior: &'b Prior,
    /// The transform of the initial poses to the tunnel.
    pub datum: &'b Datum,
    /// Which frames are placed by their pixels.
    pub placed: &'b [bool],
}

impl Bridging<'_> {
    /// Replaces the poses of the frames that are not placed, and their covariances: that of
    /// the bridge, plus that of the nearest end. The `estimates` are aligned with the initial poses
    /// along the gauge.
    ///
    /// # Errors
    /// [`FactorError`] if the prior does not determine a pose: its σ is infinite, or zero.
    pub fn apply(
        &self,
        estimates: &mut [FrameEstimate],
        covariances: &mut [Matrix6<f64>],
    ) -> Result<(), FactorError> {
        for gap in gaps(self.placed) {
            self.predict(&gap, estimates);
            let inverse = self.solve(&gap, estimates)?;
            for k in gap.clone() {
                let own = inverse
                    .block(k - gap.start, k - gap.start)
                    .unwrap_or_default();
                let from_start = k - gap.start;
                let start = gap.start.checked_sub(1);
                let end = Some(gap.end).filter(|end| *end < estimates.len());
                let nearest = match (start, end) {
                    (Some(start), Some(end)) if from_start < end - k => Some(start),
                    (start, end) => end.or(start),
                };
                let of_end = nearest.map_or_else(Matrix6::zeros, |end| covariances[end]);
                covariances[k] = own.fixed_view::<6, 6>(0, 0) + of_end;
            }
        }
        Ok(())
    }

    /// Starts the frames of a gap where the initial steps lead from its end.
    fn predict(&self, gap: &Range<usize>, estimates: &mut [FrameEstimate]) {
        let initial = |k: usize| self.datum.to_nominal_tunnel(&self.prior.initial[k]);
        let step = |from: usize, to: usize, estimates: &[FrameEstimate]| {
            let pose = &estimates[from].pose;
            self.prior.predict_at(self.datum, from, pose, to)
        };
        let is_walk = self.prior.jitter.model == JitterModel::RandomWalk;
        if is_walk && gap.start > 0 {
            for k in gap.clone() {
                estimates[k] = FrameEstimate::at(step(k - 1, k, estimates));
            }
        } else if is_walk && gap.end < estimates.len() {
            for k in gap.clone().rev() {
                estimates[k] = FrameEstimate::at(step(k + 1, k, estimates));
            }
        } else {
            for k in gap.clone() {
                let pose = match self.prior.is_related(k) {
                    true => step(k - 1, k, estimates),
                    false => initial(k),
                };
                estimates[k] = FrameEstimate::at(pose);
            }
        }
    }

    /// Minimises the cost of the prior over the frames of a gap, the others held; returns the
    /// inverse of its normal matrix.
    fn solve(
        &self,
        gap: &Range<usize>,
        estimates: &mut [FrameEstimate],
    ) -> Result<SelectedInverse, FactorError> {
        let participants = gap.start.saturating_sub(1)..(gap.end + 1).min(estimates.len());
        let pattern = Pattern::new(gap.len(), self.prior.pairs(gap));
        let symbolic = SymbolicFactorisation::new(&pattern)?;
        let linearise = |estimates: &[FrameEstimate]| {
            let mut normal = NormalEquations::zeros(&pattern);
            self.prior.add_to(
                &participants,
                &estimates[participants.clone()],
                gap,
                self.datum,
                &pattern,
                &mut normal,
                None,
            );
            normal
        };
        for _ in 0..STEPS {
            let normal = linearise(estimates);
            let factor = symbolic.factorise(&normal, 0.0)?;
            for (k, step) in gap.clone().zip(factor.step(&normal.gradient)) {
                estimates[k] = estimates[k].retract(&step);
            }
        }
        let normal = linearise(estimates);
        let factor = symbolic.factorise(&normal, 0.0)?;
        Ok(SelectedInverse::new(&factor))
    }
}

/// Runs of frames that are not placed.
fn gaps(placed: &[bool]) -> Vec<Range<usize>> {
    let mut gaps: Vec<Range<usize>> = Vec::new();
    for (k, _) in placed.iter().enumerate().filter(|(_, is)| !**is) {
        match gaps.last_mut() {
            Some(gap) if gap.end == k => gap.end = k + 1,
            _ => gaps.push(k..k + 1),
        }
    }
    gaps
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::calibration::{Calibration, Kappa};
    use nalgebra::Vector3;
    use tunnelstitch_geometry::camera::Camera;
    use tunnelstitch_geometry::trajectory::{Jitter, Pose, spiral};

    fn prior(model: JitterModel) -> Prior {
        Prior {
            jitter: Jitter {
                model,
                rotation_sigma_rad: 0.03,
                translation_sigma_m: [0.02; 3],
            },
            initial: spiral(9, 0.1, 30f64.to_radians()),
            times_s: (0..9).map(f64::from).collect(),
            median_step_s: 1.0,
            variance_ratios: vec![1.0; 9],
            rig: None,
            log_gain_sigma: 0.3,
            bias_sigma: 10.0,
        }
    }

    fn bridge(prior: &Prior, placed: [bool; 9]) -> (Vec<Pose>, Vec<Matrix6<f64>>) {
        let calibration = Calibration::none(Camera::from_vertical_fov(160, 120, 1.0));
        // Photometric frames lie 1 cm more to the side with each step, the others anywhere.
        let mut estimates: Vec<_> = (0..9)
            .map(|k| {
                let shift = Vector3::x() * if placed[k] { 0.01 * k as f64 } else { 7.0 };
                let initial = &prior.initial[k];
                FrameEstimate::at(Pose::new(initial.r_wc, initial.t_wc + shift))
            })
            .collect();
        let mut covariances = vec![Matrix6::identity() * 1e-8; 9];
        let bridging = Bridging {
            prior,
            datum: &calibration.datum(&Kappa::zeros()),
            placed: &placed,
        };
        bridging.apply(&mut estimates, &mut covariances).unwrap();
        (estimates.iter().map(|e| e.pose).collect(), covariances)
    }

    #[test]
    fn a_walk_bridges_a_gap_and_goes_on_from_an_end() {
        let prior = prior(JitterModel::RandomWalk);
        let mut placed = [true; 9];
        placed[3..6].fill(false);
        placed[8] = false;
        let (poses, covariances) = bridge(&prior, placed);
        for (k, pose) in poses.iter().enumerate() {
            let expected = if k == 8 { 0.07 } else { 0.01 * k as f64 };
            let error = pose.t_wc - prior.initial[k].t_wc - Vector3::x() * expected;
            assert!(error.norm() < 1e-9, "{k}: {error}");
        }
        // A bridge of n steps has the variance i (n − i)/n at its step i.
        let of_step = |k: usize| covariances[k][(3, 3)] / 4e-4;
        assert!((of_step(3) - 0.75).abs() < 1e-3 && (of_step(4) - 1.0).abs() < 1e-3);
        assert!((of_step(8) - 1.0).abs() < 1e-3 && of_step(1) < 1e-3);
    }

    #[test]
    fn nothing_placed_and_independent_errors_keep_the_initial_poses() {
        for model in [JitterModel::RandomWalk, JitterModel::Independent] {
            let prior = prior(model);
            let (poses, _) = bridge(&prior, [false; 9]);
            for (pose, initial) in poses.iter().zip(&prior.initial) {
                assert!(initial.local(pose).norm() < 1e-12);
            }
        }
        let mut placed = [true; 9];
        placed[4] = false;
        let prior = prior(JitterModel::Independent);
        let (poses, _) = bridge(&prior, placed);
        assert!(prior.initial[4].local(&poses[4]).norm() < 1e-12);
    }
}
