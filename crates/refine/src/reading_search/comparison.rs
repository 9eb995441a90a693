//! Comparison of a reading with the one given, by pairs of neighbouring frames.

use crate::tracking::registration::MAX_DEVIATION_COST;

/// Deviations of the second frames from their prior, `½ eᵀΣ⁻¹e`; None where a frame does not fit.
pub type Registrations = Vec<Option<f64>>;

/// The reading given, with which others are compared.
pub struct Comparison {
    /// The pairs in the reading given.
    pub of_given: Registrations,
    /// True for pairs that must speak for a reading: those with another step in it than as given.
    pub telling: Vec<bool>,
    /// Natural logarithm of the odds that a reading must exceed.
    pub least_nats: f64,
    /// Evidence of a pair above which it speaks for a reading, nats.
    pub min_pair_nats: f64,
}

impl Comparison {
    /// Evidence of the first pairs for a reading against the one given, nats. A frame that does not
    /// fit deviates by as much as the prior allows.
    pub fn evidence(&self, reading: &[Option<f64>]) -> Vec<f64> {
        let deviation = |registered: &Option<f64>| registered.unwrap_or(MAX_DEVIATION_COST);
        let pairs = reading.iter().zip(&self.of_given);
        pairs
            .map(|(reading, given)| deviation(given) - deviation(reading))
            .collect()
    }

    /// True if a reading is taken whose first pairs are `reading` and in which all others fit
    /// without any deviation: if its odds suffice, three quarters of the pairs fit, and three
    /// quarters of those that tell it from the one given speak for it.
    pub fn may_take(&self, reading: &[Option<f64>]) -> bool {
        let at_best = vec![Some(0.0); self.of_given.len() - reading.len()];
        let pairs = [reading, &at_best].concat();
        let evidence = self.evidence(&pairs);
        let fitting = pairs.iter().flatten().count();
        let telling = evidence
            .iter()
            .zip(&self.telling)
            .filter(|(_, tells)| **tells);
        let all = telling.clone().count();
        let for_it = telling
            .filter(|(nats, _)| **nats > self.min_pair_nats)
            .count();
        evidence.iter().sum::<f64>() > self.least_nats
            && 4 * fitting >= 3 * pairs.len()
            && 4 * for_it >= 3 * all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reading_is_given_up_once_the_other_pairs_cannot_save_it() {
        let comparison = Comparison {
            of_given: vec![Some(3.0); 12],
            telling: vec![true; 12],
            least_nats: 9.5,
            min_pair_nats: 0.0,
        };
        assert!(comparison.may_take(&[]));
        assert!(comparison.may_take(&[Some(1.0); 12]));
        // Three quarters of the pairs must fit, and speak for it.
        assert!(comparison.may_take(&[Some(4.0); 3]));
        assert!(!comparison.may_take(&[Some(4.0); 4]));
        assert!(!comparison.may_take(&[None; 4]));
        // A pair that does not fit costs more than the others can make up for here.
        assert!(!comparison.may_take(&[None]));
        assert!(!comparison.may_take(&[Some(2.5); 12]));
    }

    /// Pairs with the same step in both readings must fit, and need not speak for it.
    #[test]
    fn pairs_that_tell_nothing_need_only_fit() {
        let comparison = Comparison {
            of_given: [[None; 6], [Some(3.0); 6]].concat(),
            telling: [[true; 6], [false; 6]].concat(),
            least_nats: 9.5,
            min_pair_nats: 18.0,
        };
        assert!(comparison.may_take(&[Some(3.0); 12]));
        assert!(comparison.may_take(&[[Some(3.0); 6], [Some(4.0); 6]].concat()));
        assert!(!comparison.may_take(&[[Some(3.0); 6], [None; 6]].concat()));
        // Two of six speak against it, by too little to speak for it.
        assert!(!comparison.may_take(&[Some(20.0), Some(20.0)]));
    }
}
