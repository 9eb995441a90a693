//! Pose errors without alignment: the errors that `evo` prints.

use crate::error::EvaluateError;
use crate::error::check_pairs;
use crate::error_statistics::ErrorStatistics;
use serde::{Deserialize, Serialize};
use tunnelstitch_geometry::trajectory::Pose;

/// Absolute and relative pose errors without alignment, not even along the gauge.
///
/// They equal the output of `evo_ape tum` and `evo_rpe tum` for the two files, without `--align`
/// and with `--delta 1 --delta_unit f`. Relative errors do not depend on the gauge; absolute ones
/// do, and are meaningful only if the gauge is fixed equally in both.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct UnalignedError {
    /// Absolute translation error `|t_est − t_true|`, metres (`evo_ape`).
    pub ape_translation_m: ErrorStatistics,
    /// Absolute rotation error: angle of `R_trueᵀ R_est`, degrees (`evo_ape -r angle_deg`).
    pub ape_rotation_deg: ErrorStatistics,
    /// Relative translation error: that of `(Q_k⁻¹ Q_k+1)⁻¹ (P_k⁻¹ P_k+1)` with Q the true poses
    /// and P the estimated, metres (`evo_rpe`); zeros for a single frame.
    pub rpe_translation_m: ErrorStatistics,
    /// Relative rotation error: the angle of that motion, degrees (`evo_rpe -r angle_deg`).
    pub rpe_rotation_deg: ErrorStatistics,
}

/// Compares poses with the true ones, frame by frame and step by step.
///
/// # Errors
/// [`EvaluateError::Count`], [`EvaluateError::Empty`].
pub fn unaligned_error(
    estimated: &[Pose],
    truth: &[Pose],
) -> Result<UnalignedError, EvaluateError> {
    check_pairs(estimated.len(), truth.len())?;
    let absolute_errors = estimated
        .iter()
        .zip(truth)
        .map(|(p, q)| q.inverse().after(p));
    let steps = |poses: &[Pose]| -> Vec<Pose> {
        let pairs = poses.iter().zip(poses.iter().skip(1));
        pairs
            .map(|(before, after)| before.inverse().after(after))
            .collect()
    };
    let relative_errors = steps(estimated).into_iter().zip(steps(truth));
    let (ape_translation_m, ape_rotation_deg) = motion_statistics(absolute_errors);
    let (rpe_translation_m, rpe_rotation_deg) =
        motion_statistics(relative_errors.map(|(p, q)| q.inverse().after(&p)));
    Ok(UnalignedError {
        ape_translation_m,
        ape_rotation_deg,
        rpe_translation_m,
        rpe_rotation_deg,
    })
}

/// Computes statistics of the lengths (metres) and angles (degrees) of motions.
fn motion_statistics(motions: impl Iterator<Item = Pose>) -> (ErrorStatistics, ErrorStatistics) {
    let (lengths, angles): (Vec<f64>, Vec<f64>) = motions
        .map(|motion| (motion.t_wc.norm(), motion.r_wc.angle().to_degrees()))
        .unzip();
    (ErrorStatistics::of(&lengths), ErrorStatistics::of(&angles))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use tunnelstitch_geometry::surface::GaugeMotion;
    use tunnelstitch_geometry::trajectory::{so3, spiral};

    #[test]
    fn known_errors_are_measured() {
        let truth = spiral(3, 0.1, 0.5);
        let mut estimated = truth.clone();
        estimated[2].t_wc.x += 0.03;
        estimated[2].r_wc *= so3::exp(&(Vector3::z() * 2f64.to_radians()));
        let error = unaligned_error(&estimated, &truth).unwrap();
        assert!((error.ape_translation_m.rms - 0.03 / 3f64.sqrt()).abs() < 1e-12);
        assert!((error.ape_rotation_deg.max - 2.0).abs() < 1e-9);
        assert!((error.rpe_translation_m.rms - 0.03 / 2f64.sqrt()).abs() < 1e-12);
        assert!((error.rpe_rotation_deg.median - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_gauge_counts_for_the_absolute_errors_only() {
        let truth = spiral(5, 0.1, 0.5);
        let motion = GaugeMotion::about_y(0.1, 2.0);
        let error = unaligned_error(&motion.apply_all(&truth), &truth).unwrap();
        assert!((error.ape_translation_m.rms - 2.0).abs() < 1e-12);
        assert!((error.ape_rotation_deg.rms - 0.1f64.to_degrees()).abs() < 1e-9);
        assert!(error.rpe_translation_m.max < 1e-12 && error.rpe_rotation_deg.max < 1e-6);
    }
}
