//! Several readings of one thing: how far each is from what most say, and what weight it deserves.

/// Cut of the biweight, standard deviations.
const CUT: f64 = 5.0;

/// Distances of readings from their middle, and weights by them.
pub struct Agreement {
    /// Distances from the median, as large as those of independent readings from the true value.
    pub sizes: Vec<f64>,
    /// Tukey's biweight, 0 to 1.
    pub weights: Vec<f64>,
    /// Their sum.
    pub total: f64,
}

impl Agreement {
    /// The agreement of at least one reading, whose errors have the given variance.
    pub fn of(readings: &[f64], variance: f64) -> Self {
        let mut sorted = readings.to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        let middle = 0.5 * (sorted[(readings.len() - 1) / 2] + sorted[readings.len() / 2]);
        // The median has fitted itself to one of the values.
        let freedom = (1.0 - 1.0 / readings.len() as f64).sqrt();
        let weight = |e: f64| (1.0 - e * e / (CUT * CUT * variance)).max(0.0).powi(2);
        let weights: Vec<f64> = readings.iter().map(|e| weight(e - middle)).collect();
        Self {
            sizes: readings
                .iter()
                .map(|e| (e - middle).abs() / freedom)
                .collect(),
            total: weights.iter().sum(),
            weights,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_out_counts_for_nothing() {
        let agreement = Agreement::of(&[1.0, 1.1, 0.9, 9.0], 0.01);
        assert_eq!(agreement.weights[3], 0.0);
        assert!(agreement.weights[..3].iter().all(|w| *w > 0.8));
        assert!((agreement.total - agreement.weights.iter().sum::<f64>()).abs() < 1e-12);
        assert!(agreement.sizes[3] > 7.0);
        // Not yet known how exact they are: all count alike.
        let unknown = Agreement::of(&[1.0, 9.0], f64::INFINITY);
        assert_eq!(unknown.weights, [1.0, 1.0]);
    }
}
