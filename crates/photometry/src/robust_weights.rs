//! Robust weights of several readings of one quantity.

/// Distance from the median beyond which a reading has no weight, standard deviations.
const BIWEIGHT_CUT_SIGMA: f64 = 5.0;

/// Residuals of readings from their median, and weights by them.
pub struct RobustWeights {
    /// Sizes of the residuals, scaled to those of independent readings from the true value.
    pub sizes: Vec<f64>,
    /// Weights of the readings: the squared slope times Tukey's biweight, 0 to 1.
    pub weights: Vec<f64>,
    /// Sum of the weights.
    pub total: f64,
}

impl RobustWeights {
    /// Weights of at least two readings `s_i` with the median `middle`. Measurements of equal
    /// `variance`, infinite if it is unknown, depend on what is read with the `slopes` `g_i`.
    ///
    /// `w_i = g_i² (1 − e_i²/(5σ)²)²` for a residual `e_i = g_i (s_i − median)` below 5 σ, else 0.
    ///
    /// Source: A. E. Beaton and J. W. Tukey, "The fitting of power series", Technometrics 16, 1974.
    pub fn of(readings: &[f64], middle: f64, slopes: &[f64], variance: f64) -> Self {
        // The median has fitted itself to one of the values.
        let freedom = (1.0 - 1.0 / readings.len() as f64).sqrt();
        let cut = BIWEIGHT_CUT_SIGMA * BIWEIGHT_CUT_SIGMA * variance;
        let biweight = |e: f64| (1.0 - e * e / cut).max(0.0).powi(2);
        let pairs = readings.iter().zip(slopes);
        let residuals: Vec<f64> = pairs.map(|(s, slope)| slope * (s - middle)).collect();
        let pairs = residuals.iter().zip(slopes);
        let weights: Vec<f64> = pairs
            .map(|(e, slope)| slope * slope * biweight(*e))
            .collect();
        Self {
            sizes: residuals.iter().map(|e| e.abs() / freedom).collect(),
            total: weights.iter().sum(),
            weights,
        }
    }
}

/// The median of at least one reading: of an even number, the mean of the middle two.
pub fn median(readings: &[f64]) -> f64 {
    let mut sorted = readings.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    0.5 * (sorted[(sorted.len() - 1) / 2] + sorted[sorted.len() / 2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outliers_have_no_weight() {
        let readings = [1.0, 1.1, 0.9, 9.0];
        let robust = RobustWeights::of(&readings, median(&readings), &[1.0; 4], 0.01);
        assert_eq!(robust.weights[3], 0.0);
        assert!(robust.weights[..3].iter().all(|w| *w > 0.8));
        assert!((robust.total - robust.weights.iter().sum::<f64>()).abs() < 1e-12);
        assert!(robust.sizes[3] > 7.0);
        // Not yet known how exact they are: no outliers.
        let unknown = RobustWeights::of(&[1.0, 9.0], 5.0, &[1.0, 2.0], f64::INFINITY);
        assert_eq!(unknown.weights, [1.0, 4.0]);
    }
}
