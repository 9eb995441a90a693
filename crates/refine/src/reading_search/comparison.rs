//! Comparison of a reading with the one given, by pairs of neighbouring frames.

use crate::tracking::neighbour_pairs::RegisteredPair;
use crate::tracking::registration::MAX_DEVIATION_COST;

/// Smallest number of pairs: fewer may fit by chance.
pub const MIN_PAIRS: usize = 4;
/// Standard errors by which differences of pairs exceed zero: the 95 % quantile of a normal
/// distribution.
const MIN_TOLD_SIGMAS: f64 = 1.645;
/// Freedoms of a displacement: those of a pose.
const FREEDOMS: f64 = 6.0;

/// A pair whose frames fit each other in a reading.
#[derive(Clone, Copy, Debug)]
pub struct FittingPair {
    /// Deviation of the estimate from the prior's prediction, `½ eᵀΣ⁻¹e`.
    pub deviation: f64,
    /// Half the squared Mahalanobis distance of the measured displacement from the prediction.
    pub innovation: f64,
    /// Log-likelihood of the correlation, nats.
    pub log_likelihood: f64,
}

impl FittingPair {
    /// The pair as it is registered in a reading.
    pub fn of(registered: &RegisteredPair) -> Self {
        let innovation = registered.innovation.as_ref();
        let cost = innovation.map_or(registered.deviation, |innovation| innovation.cost());
        Self {
            deviation: registered.deviation,
            innovation: cost,
            log_likelihood: registered.log_likelihood,
        }
    }
}

/// The pairs in a reading; None where two frames do not fit each other.
pub type FittingPairs = Vec<Option<FittingPair>>;

/// The part of a pair's evidence for a reading against the one given that is by priors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PriorEvidence {
    /// Under one prior, estimates in both readings are pulled back alike: their deviations tell.
    Deviation,
    /// With another radius, pictures measure other lengths, and a narrower prior pulls estimates
    /// back farther where they measure little: the measured displacements tell, with their own
    /// covariance. A narrower prior that fits as well is no evidence: σ that are stated too large
    /// would be some.
    Innovation,
}

impl PriorEvidence {
    /// Cost of a pair; one that does not fit deviates by as much as the prior allows.
    fn cost(self, pair: &Option<FittingPair>) -> f64 {
        pair.map_or(MAX_DEVIATION_COST, |pair| match self {
            Self::Deviation => pair.deviation,
            Self::Innovation => pair.innovation,
        })
    }
}

/// The reading given, with which others are compared.
pub struct Comparison {
    /// The pairs in the reading given.
    pub of_given: FittingPairs,
    /// True for pairs that must speak for a reading: those with another step in it than as given.
    pub telling: Vec<bool>,
    /// Natural logarithm of the odds that a reading must exceed with the evidence that is left
    /// where displacements scatter more than stated ([`overdispersion`]).
    pub false_alarm_nats: f64,
    /// Natural logarithm of the odds that a reading must exceed with all its evidence.
    pub least_nats: f64,
    /// Evidence of a pair above which it speaks for a reading, nats.
    pub min_pair_nats: f64,
}

impl Comparison {
    /// Evidence of the first pairs for a reading against the one given by their priors, nats.
    fn evidence<'a>(
        &'a self,
        reading: &'a [Option<FittingPair>],
        by: PriorEvidence,
    ) -> impl Iterator<Item = f64> + 'a {
        let pairs = reading.iter().zip(&self.of_given);
        pairs.map(move |(reading, given)| by.cost(given) - by.cost(reading))
    }

    /// Evidence of each pair for a reading against the one given, nats, by priors alone, or by
    /// pixels, too, where a pair fits in both.
    ///
    /// Only another camera makes pairs correlate better or worse than as given. In all other
    /// readings they differ by chance, which tells nothing.
    pub fn pair_nats(
        &self,
        reading: &[Option<FittingPair>],
        by: PriorEvidence,
        by_pixels: bool,
    ) -> Vec<f64> {
        let of_pixels = |(reading, given): (&Option<FittingPair>, &Option<FittingPair>)| {
            Some((*reading)?.log_likelihood - (*given)?.log_likelihood)
        };
        let pairs = reading.iter().zip(&self.of_given);
        let of_pixels = pairs.map(|pair| of_pixels(pair).filter(|_| by_pixels));
        let evidence = self.evidence(reading, by).zip(of_pixels);
        evidence
            .map(|(of_prior, of_pixels)| of_prior + of_pixels.unwrap_or_default())
            .collect()
    }

    /// True if the pairs that fit in both readings correlate better as given by more than that
    /// scatters. In strong noise a pair fits somewhere in any reading, but only at the right place
    /// does it correlate by more than noise does.
    ///
    /// Under a narrower prior, estimates are held away from where they correlate best, which the
    /// innovation counts already.
    pub fn is_contradicted(&self, reading: &[Option<FittingPair>], by: PriorEvidence) -> bool {
        if by == PriorEvidence::Innovation {
            return false;
        }
        let pairs = reading.iter().zip(&self.of_given);
        let both = pairs.filter_map(|(reading, given)| (*reading).zip(*given));
        let differences: Vec<f64> = both
            .map(|(reading, given)| given.log_likelihood - reading.log_likelihood)
            .collect();
        differences.len() >= MIN_PAIRS && exceeds_scatter(&differences)
    }

    /// True if a reading may be taken whose first pairs are `reading` and in which all others fit
    /// without any deviation: if its odds by priors suffice, three quarters of the pairs fit, and
    /// three quarters of those that tell it from the one given speak for it.
    pub fn may_take(&self, reading: &[Option<FittingPair>], by: PriorEvidence) -> bool {
        let left = &self.of_given[reading.len()..];
        let at_best = left.iter().map(|pair| by.cost(pair));
        let evidence: Vec<f64> = self.evidence(reading, by).chain(at_best).collect();
        let fitting = reading.iter().flatten().count() + left.len();
        let telling = evidence
            .iter()
            .zip(&self.telling)
            .filter(|(_, tells)| **tells);
        let all = telling.clone().count();
        let for_it = telling
            .filter(|(nats, _)| **nats > self.min_pair_nats)
            .count();
        evidence.iter().sum::<f64>() > self.least_nats
            && 4 * fitting >= 3 * self.of_given.len()
            && 4 * for_it >= 3 * all
    }
}

/// True if differences of the evidence of pairs exceed zero in the mean by more than they scatter.
///
/// Source: Q. H. Vuong, "Likelihood ratio tests for model selection and non-nested hypotheses",
/// Econometrica 57, 1989.
pub fn exceeds_scatter(differences: &[f64]) -> bool {
    let count = differences.len() as f64;
    let sum: f64 = differences.iter().sum();
    let squares: f64 = differences.iter().map(|d| (d - sum / count).powi(2)).sum();
    sum > MIN_TOLD_SIGMAS * squares.sqrt()
}

/// Mean square of the displacements of all pairs that fit over the expected one, at least 1.
///
/// In strong noise displacements scatter more than the equations state; the evidence of pairs
/// counts the less.
///
/// Source: D. R. Anderson, K. P. Burnham, G. C. White, "AIC model selection in overdispersed
/// capture–recapture data", Ecology 75(6), 1994.
pub fn overdispersion(reading: &[Option<FittingPair>], by: PriorEvidence) -> f64 {
    let fitting = reading.iter().filter(|pair| pair.is_some());
    let freedoms = FREEDOMS * fitting.clone().count() as f64;
    let squares: f64 = fitting.map(|pair| 2.0 * by.cost(pair)).sum();
    (squares / freedoms).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::PriorEvidence::Deviation;
    use super::*;

    /// A pair whose displacement costs so much.
    fn fits(cost: f64) -> Option<FittingPair> {
        Some(FittingPair {
            deviation: cost,
            innovation: cost,
            log_likelihood: 0.0,
        })
    }

    #[test]
    fn a_reading_is_given_up_once_the_other_pairs_cannot_save_it() {
        let comparison = Comparison {
            of_given: vec![fits(3.0); 12],
            telling: vec![true; 12],
            false_alarm_nats: 9.5,
            least_nats: 9.5,
            min_pair_nats: 0.0,
        };
        assert!(comparison.may_take(&[], Deviation));
        assert!(comparison.may_take(&[fits(1.0); 12], Deviation));
        // Three quarters of the pairs must fit, and speak for it.
        assert!(comparison.may_take(&[fits(4.0); 3], Deviation));
        assert!(!comparison.may_take(&[fits(4.0); 4], Deviation));
        assert!(!comparison.may_take(&[None; 4], Deviation));
        // A pair that does not fit costs more than the others can make up for here.
        assert!(!comparison.may_take(&[None], Deviation));
        assert!(!comparison.may_take(&[fits(2.5); 12], Deviation));
    }

    /// Pairs with the same step in both readings must fit, and need not speak for it.
    #[test]
    fn pairs_that_tell_nothing_need_only_fit() {
        let comparison = Comparison {
            of_given: [[None; 6], [fits(3.0); 6]].concat(),
            telling: [[true; 6], [false; 6]].concat(),
            false_alarm_nats: 9.5,
            least_nats: 9.5,
            min_pair_nats: 18.0,
        };
        assert!(comparison.may_take(&[fits(3.0); 12], Deviation));
        assert!(comparison.may_take(&[[fits(3.0); 6], [fits(4.0); 6]].concat(), Deviation));
        assert!(!comparison.may_take(&[[fits(3.0); 6], [None; 6]].concat(), Deviation));
        // Two of six speak against it, by too little to speak for it.
        assert!(!comparison.may_take(&[fits(20.0), fits(20.0)], Deviation));
    }

    /// Pairs that fit in two readings correlate at the right place, and by chance in the other.
    #[test]
    fn pairs_that_correlate_as_given_contradict() {
        let correlates = |log_likelihood: f64| {
            fits(1.0).map(|pair| FittingPair {
                log_likelihood,
                ..pair
            })
        };
        let comparison = Comparison {
            of_given: [30.0, 40.0, 35.0, 45.0].map(correlates).to_vec(),
            telling: vec![true; 4],
            false_alarm_nats: 9.5,
            least_nats: 9.5,
            min_pair_nats: 0.0,
        };
        let is_contradicted = |reading: [f64; 4]| {
            let reading = reading.map(correlates);
            comparison.is_contradicted(&reading, Deviation)
        };
        assert!(is_contradicted([5.0, 7.0, 4.0, 6.0]));
        assert!(!is_contradicted([25.0, 45.0, 40.0, 38.0]));
        assert!(!is_contradicted([60.0, 60.0, 60.0, 60.0]));
        assert!(!comparison.is_contradicted(&[correlates(5.0), None, None, None], Deviation));
    }

    /// Noise that scatters displacements alike in two readings tells less than it seems to.
    #[test]
    fn displacements_that_scatter_count_less() {
        use PriorEvidence::Innovation;
        assert_eq!(
            overdispersion(&[fits(1.0), fits(5.0), None], Innovation),
            1.0
        );
        assert_eq!(
            overdispersion(&[fits(8.0), fits(10.0), None], Innovation),
            3.0
        );
        assert_eq!(overdispersion(&[None], Innovation), 1.0);
    }

    /// Steps that are longer than planned fit a shorter focal length, but the pictures do not.
    #[test]
    fn pixels_that_correlate_worse_speak_against_a_reading() {
        let correlates = |deviation: f64, log_likelihood: f64| {
            fits(deviation).map(|pair| FittingPair {
                log_likelihood,
                ..pair
            })
        };
        let comparison = Comparison {
            of_given: vec![correlates(3.0, 40.0), correlates(3.0, 40.0), None],
            telling: vec![true; 3],
            false_alarm_nats: 3.0,
            least_nats: 3.0,
            min_pair_nats: 0.0,
        };
        let nats = |of_pixels: f64, by_pixels| -> f64 {
            let reading = [correlates(1.0, of_pixels); 3];
            comparison
                .pair_nats(&reading, Deviation, by_pixels)
                .iter()
                .sum()
        };
        let odds = |of_pixels: f64| nats(of_pixels, true);
        let by_priors = nats(0.0, false);
        assert_eq!(by_priors, 4.0 + MAX_DEVIATION_COST - 1.0);
        assert_eq!(odds(40.0), by_priors);
        assert_eq!(odds(30.0), by_priors - 20.0);
    }
}
