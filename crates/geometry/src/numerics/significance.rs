//! Quantiles for tests whose false-alarm rates add up to one of the whole survey.

use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor, Normal};

/// Probability of a false alarm in a whole survey, unless another is asked for.
pub const FALSE_ALARM_RATE: f64 = 1e-3;

/// The one-sided quantile z of the standard normal distribution that `tests` independent tests
/// exceed with the probability `alpha` at the most (Bonferroni).
pub fn normal_quantile(alpha: f64, tests: usize) -> f64 {
    let rate = alpha / tests.max(1) as f64;
    Normal::standard().inverse_cdf(1.0 - rate)
}

/// Bounds between which a χ² variable with `freedoms` degrees of freedom lies but for the
/// probability `alpha`, half of it on either side.
pub fn chi_squared_bounds(alpha: f64, freedoms: f64) -> Option<(f64, f64)> {
    let chi_squared = ChiSquared::new(freedoms).ok()?;
    let bound = |probability| chi_squared.inverse_cdf(probability);
    Some((bound(0.5 * alpha), bound(1.0 - 0.5 * alpha)))
}

/// The value that an F variable with `freedoms` (numerator) and `freedoms_below` degrees of freedom
/// exceeds with the probability `alpha`; None without freedoms.
pub fn f_bound(alpha: f64, freedoms: f64, freedoms_below: f64) -> Option<f64> {
    let f = FisherSnedecor::new(freedoms, freedoms_below).ok()?;
    Some(f.inverse_cdf(1.0 - alpha))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of tables.
    #[test]
    fn quantiles_are_those_of_tables() {
        assert!((normal_quantile(0.025, 1) - 1.959_964).abs() < 1e-5);
        assert!((normal_quantile(0.001, 1000) - 4.753_424).abs() < 1e-3);
        let (low, high) = chi_squared_bounds(0.05, 10.0).unwrap();
        assert!((low - 3.246_973).abs() < 1e-3 && (high - 20.483_177).abs() < 1e-3);
        assert!(chi_squared_bounds(0.05, 0.0).is_none());
        assert!((f_bound(0.05, 2.0, 10.0).unwrap() - 4.102_821).abs() < 1e-3);
        assert!(f_bound(0.05, 2.0, 0.0).is_none());
    }
}
