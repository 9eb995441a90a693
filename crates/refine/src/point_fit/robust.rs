//! Robust weights and the scale of residuals.

use tunnelstitch_geometry::numerics::median::MAD_TO_SIGMA;
use tunnelstitch_geometry::numerics::median::upper_median;

/// Residual from which Huber's weight falls, σ: 95 % of the efficiency of least squares if errors
/// are normal.
const HUBER_SIGMAS: f64 = 1.345;
/// Residual from which Tukey's weight is 0, σ: the same efficiency.
const TUKEY_SIGMAS: f64 = 4.685;
/// Smallest σ, metres: the rounding of coordinates in single precision at 100 m.
const MIN_SIGMA_M: f64 = 1e-5;

/// The weight of a residual, as a function of it and of σ.
pub type Weighting = fn(f64, f64) -> f64;

/// 1-σ of residuals without outliers, metres: 1.48 times the median of the absolute ones, again
/// without those that Tukey's weight leaves out for it, which would raise it. The smallest possible
/// for none.
pub fn robust_sigma_m(residuals_m: impl Iterator<Item = f64>) -> f64 {
    let mut sizes_m: Vec<f64> = residuals_m.map(f64::abs).collect();
    let median = |sizes_m: &[f64]| {
        let median = upper_median(sizes_m.to_vec());
        median.map_or(MIN_SIGMA_M, |median| {
            (MAD_TO_SIGMA * median).max(MIN_SIGMA_M)
        })
    };
    let of_all_m = median(&sizes_m);
    sizes_m.retain(|size_m| *size_m < TUKEY_SIGMAS * of_all_m);
    median(&sizes_m)
}

/// Huber's weight of a residual: `min(1, k σ/|e|)`.
pub fn huber_weight(residual_m: f64, sigma_m: f64) -> f64 {
    (HUBER_SIGMAS * sigma_m / residual_m.abs()).min(1.0)
}

/// Tukey's weight of a residual: `(1 − (e/(c σ))²)²`, 0 beyond `c σ`.
pub fn tukey_weight(residual_m: f64, sigma_m: f64) -> f64 {
    let share = residual_m / (TUKEY_SIGMAS * sigma_m);
    (1.0 - share * share).max(0.0).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scale_and_weights_ignore_outliers() {
        let residuals = (0..100).map(|k| {
            if k < 30 {
                5.0
            } else {
                0.01 * f64::from(k - 65)
            }
        });
        let sigma_m = robust_sigma_m(residuals);
        assert!(sigma_m < 0.5, "{sigma_m}");
        assert_eq!(huber_weight(0.5, 1.0), 1.0);
        assert!((huber_weight(-13.45, 1.0) - 0.1).abs() < 1e-12);
        assert_eq!(tukey_weight(-4.7, 1.0), 0.0);
        assert_eq!(tukey_weight(0.0, 1.0), 1.0);
        assert_eq!(robust_sigma_m(std::iter::empty()), MIN_SIGMA_M);
    }
}
