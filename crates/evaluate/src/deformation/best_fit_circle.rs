//! Best-fit circle of a section.
//!
//! A circle of the radius `r + a` about the point (x, z) has, to first order, the displacement
//! `a + x sin θ + z cos θ` from the nominal one, θ from z (twelve o'clock) towards x (three
//! o'clock). So with rows `A_k = (1, sin θ_k, cos θ_k)` the least-squares fit to displacements δ_k
//! is `(a, x, z) = (AᵀA)⁻¹ Aᵀ δ`: a linear function of δ.

use super::functional::Functional;
use nalgebra::{Matrix3, Vector3};

/// Smallest share of a section that must be determined for a fit.
pub(super) const MIN_DETERMINED_SHARE: f64 = 0.5;

/// The best-fit circle as linear functions of the displacements.
#[derive(Clone, Debug)]
pub(super) struct CircleFit {
    /// `a`: the radius, less the nominal one.
    pub(super) radius: Functional,
    /// Offset of the centre towards three o'clock.
    pub(super) x: Functional,
    /// Offset of the centre towards twelve o'clock.
    pub(super) z: Functional,
}

/// `A_k`.
pub(super) fn circle_row(angle_rad: f64) -> Vector3<f64> {
    Vector3::new(1.0, angle_rad.sin(), angle_rad.cos())
}

impl CircleFit {
    /// The fit to the points at the given angles, of those that are `determined`; None if these are
    /// fewer than [`MIN_DETERMINED_SHARE`].
    pub(super) fn new(angles_rad: &[f64], determined: &[bool]) -> Option<Self> {
        let used = determined.iter().filter(|is_used| **is_used).count();
        if (used as f64) < MIN_DETERMINED_SHARE * angles_rad.len() as f64 {
            return None;
        }
        let row = |k: usize| {
            if determined[k] {
                circle_row(angles_rad[k])
            } else {
                Vector3::zeros()
            }
        };
        let rows = 0..angles_rad.len();
        let square: Matrix3<f64> = rows.clone().map(|k| row(k) * row(k).transpose()).sum();
        let inverse = square.try_inverse()?;
        let function = |unknown: usize| Functional {
            offset: 0.0,
            weights: rows
                .clone()
                .map(|k| (inverse.row(unknown) * row(k))[0])
                .collect(),
        };
        Some(Self {
            radius: function(0),
            x: function(1),
            z: function(2),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Displacement of a circle of the radius 3 + a about (x, z), exactly.
    fn displaced(angle_rad: f64, [a, x, z]: [f64; 3]) -> f64 {
        // |t (sin, cos) − (x, z)| = 3 + a.
        let (sin, cos) = angle_rad.sin_cos();
        let along = x * sin + z * cos;
        let across = x * cos - z * sin;
        along + ((3.0 + a).powi(2) - across * across).sqrt() - 3.0
    }

    #[test]
    fn a_shifted_circle_has_its_centre_and_radius_even_if_half_of_it_is_seen() {
        let angles: Vec<f64> = (0..360).map(|k| f64::from(k).to_radians()).collect();
        let truth = [0.004, 0.008, -0.006];
        let delta: Vec<f64> = angles
            .iter()
            .map(|angle| displaced(*angle, truth))
            .collect();
        for seen in [360, 200] {
            let determined: Vec<bool> = (0..360).map(|k| k < seen).collect();
            let fit = CircleFit::new(&angles, &determined).unwrap();
            let value = |function: &Functional| -> f64 {
                let terms = function.weights.iter().zip(&delta);
                terms.map(|(weight, delta)| weight * delta).sum()
            };
            for (found, true_value) in [&fit.radius, &fit.x, &fit.z].into_iter().zip(truth) {
                // e²/(2r) is 0.017 mm.
                let error = value(found) - true_value;
                assert!(error.abs() < 2e-5 * 360.0 / f64::from(seen), "{error}");
            }
        }
        let few: Vec<bool> = (0..360).map(|k| k < 170).collect();
        assert!(CircleFit::new(&angles, &few).is_none());
    }
}
