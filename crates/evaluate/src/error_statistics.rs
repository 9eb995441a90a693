//! Summary statistics of errors: root mean square, median and maximum.

use serde::{Deserialize, Serialize};

/// Root mean square, median and maximum of a list of errors, in the errors' unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ErrorStatistics {
    /// Root mean square, `√(Σ e² / n)`.
    pub rms: f64,
    /// Median (the mean of the middle two of an even number).
    pub median: f64,
    /// Maximum.
    pub max: f64,
}

impl ErrorStatistics {
    /// Statistics of `errors` (not negative); zeros if there are none.
    pub fn of(errors: &[f64]) -> Self {
        if errors.is_empty() {
            return Self::default();
        }
        let mut sorted = errors.to_vec();
        sorted.sort_by(f64::total_cmp);
        let middle = sorted.len() / 2;
        let median = if sorted.len() % 2 == 1 {
            sorted[middle]
        } else {
            0.5 * (sorted[middle - 1] + sorted[middle])
        };
        Self {
            rms: root_mean_square(errors),
            median,
            max: sorted[sorted.len() - 1],
        }
    }

    /// Converts the statistics to another unit.
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            rms: self.rms * factor,
            median: self.median * factor,
            max: self.max * factor,
        }
    }
}

/// Root mean square, `√(Σ e² / n)`; zero for an empty list.
pub(super) fn root_mean_square(errors: &[f64]) -> f64 {
    let squares: f64 = errors.iter().map(|e| e * e).sum();
    (squares / errors.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_of_a_list() {
        let statistics = ErrorStatistics::of(&[4.0, 0.0, 3.0]);
        assert!((statistics.rms - (25.0f64 / 3.0).sqrt()).abs() < 1e-12);
        assert_eq!((statistics.median, statistics.max), (3.0, 4.0));
        assert_eq!(ErrorStatistics::of(&[1.0, 2.0]).median, 1.5);
        assert_eq!(ErrorStatistics::of(&[]), ErrorStatistics::default());
    }
}
