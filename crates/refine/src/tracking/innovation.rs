//! The displacement of a frame from its prior's prediction, as the pictures measure it.
//!
//! Pictures measure the pose of a frame with an information J that is small, or zero, in weak
//! directions: a small rotation looks like a small translation. There the estimate stays where the
//! prior predicts it, whatever the prior. So the estimate's deviation `½ eᵀΣ⁻¹e` does not tell
//! priors apart, but the innovation does: the displacement `m = e + J⁻¹Σ⁻¹e` that the pictures
//! alone ask for has the covariance `Σ + J⁻¹`.
//!
//! Source: Y. Bar-Shalom, X. R. Li, T. Kirubarajan, "Estimation with Applications to Tracking and
//! Navigation", 2001, 5.2.3 (innovation and its covariance).

use crate::model::context::{EstimationContext, FrameWindow};
use crate::model::problem_error::ProblemError;
use crate::problem::photometric_problem::PhotometricProblem;
use crate::samples::sampling::Sampling;
use nalgebra::{Matrix6, SMatrix, Vector6};
use tunnelstitch_geometry::trajectory::Pose;

/// Information of the pictures over that of the prior below which a direction is not measured:
/// rounding errors of the equations.
const MIN_INFORMATION: f64 = 1e-9;

/// The innovation of a frame, in units of its prior's 1-σ.
#[derive(Clone, Copy, Debug)]
pub struct Innovation {
    /// Deviation of the estimate from the prediction, rotation and translation.
    error: Vector6<f64>,
    /// Information J of the pictures about the pose, with any exposure.
    information: Matrix6<f64>,
}

impl Innovation {
    /// The innovation of the only active frame of `window` against `predicted`, from the equations
    /// at one pyramid level; None where the frame shares no wall with the others.
    ///
    /// # Errors
    /// [`ProblemError`]: a frame that cannot be read.
    pub fn of(
        context: &EstimationContext,
        level: usize,
        window: FrameWindow,
        predicted: &Pose,
    ) -> Result<Option<Self>, ProblemError> {
        let problem = PhotometricProblem::new(context, Sampling::of(level), window)?;
        if problem.tiles() == 0 {
            return Ok(None);
        }
        let unknowns = problem.initial_unknowns();
        let at = problem.linearise_at(&unknowns)?;
        let (prior, _) = problem.prior_information(&unknowns);
        let normal = at.normal.blocks[0];
        let Some(factor) = normal.cholesky() else {
            return Ok(None);
        };
        // What is left to the minimum of the quadratic model.
        let step = -factor.solve(&at.normal.gradient[0]);
        let left: Vector6<f64> = step.fixed_rows::<6>(0).into();
        let error = predicted.local(&unknowns.frames[0].pose) + left;
        let sigma = prior[0].fixed_view::<6, 6>(0, 0).diagonal();
        let sigma = sigma.map(|information| information.sqrt().recip());
        let whitening = Matrix6::from_diagonal(&sigma);
        Ok(Some(Self {
            error: error.component_div(&sigma),
            information: whitening * of_pose(&(normal - prior[0])) * whitening,
        }))
    }

    /// Half the squared Mahalanobis distance of the measured displacement from the prediction,
    /// `½ mᵀ(Σ + J⁻¹)⁻¹m = ½ eᵀ(Σ⁻¹ + Σ⁻¹J⁻¹Σ⁻¹)e`: half a χ² variable of six freedoms.
    pub fn cost(&self) -> f64 {
        let directions = self.information.symmetric_eigen();
        let errors = directions.eigenvectors.tr_mul(&self.error);
        let measured = errors.iter().zip(&directions.eigenvalues);
        let measured = measured.filter(|(_, information)| **information > MIN_INFORMATION);
        0.5 * measured
            .map(|(error, information)| error * error * (1.0 + information.recip()))
            .sum::<f64>()
    }
}

/// The information about the pose that is left when the exposure is estimated, too, from the
/// pixels' part of the normal matrix of a frame.
fn of_pose(pixels: &SMatrix<f64, 8, 8>) -> Matrix6<f64> {
    let pose: Matrix6<f64> = pixels.fixed_view::<6, 6>(0, 0).into();
    let exposure = pixels.fixed_view::<2, 2>(6, 6).try_inverse();
    let mixed = pixels.fixed_view::<6, 2>(0, 6);
    match exposure {
        Some(inverse) => pose - mixed * inverse * mixed.transpose(),
        None => pose,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An estimate by pictures with this information about the first axis of translation, which
    /// measure a displacement of `measured` σ.
    fn along_x(measured: f64, information: f64) -> Innovation {
        let at = |value: f64| Vector6::new(0.0, 0.0, 0.0, value, 0.0, 0.0);
        Innovation {
            error: at(measured * information / (1.0 + information)),
            information: Matrix6::from_diagonal(&at(information)),
        }
    }

    /// The cost is that of the measurement, `½ m²/(σ² + 1/J)`, however far the prior pulls the
    /// estimate back.
    #[test]
    fn the_measurement_counts_by_its_own_covariance() {
        for information in [0.01, 1.0, 100.0] {
            let expected = 0.5 * 3.0 * 3.0 / (1.0 + 1.0 / information);
            let cost = along_x(3.0, information).cost();
            assert!((cost - expected).abs() < 1e-9, "{information}: {cost}");
        }
        assert_eq!(along_x(3.0, 0.0).cost(), 0.0);
    }

    /// A pose whose effect an exposure has as well is not measured.
    #[test]
    fn the_exposure_takes_its_part() {
        let mut pixels = SMatrix::<f64, 8, 8>::identity();
        pixels[(0, 6)] = 1.0;
        pixels[(6, 0)] = 1.0;
        let information = of_pose(&pixels);
        assert_eq!(information[(0, 0)], 0.0);
        assert_eq!(information[(1, 1)], 1.0);
    }
}
