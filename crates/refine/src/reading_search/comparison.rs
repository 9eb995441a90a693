//! Comparison of a reading with the one given, by pairs of neighbouring frames.

use crate::tracking::registration::{MAX_DEVIATION_COST, Registered};

/// Standard errors by which evidence exceeds 0 that is not due to its scatter from pair to pair:
/// the 95 % quantile of a normal distribution.
const MIN_EVIDENCE_SIGMAS: f64 = 1.645;

/// The second frames of the pairs; None where a frame does not fit.
pub type Registrations = Vec<Option<Registered>>;

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
    /// Evidence of the first pairs for a reading against the one given by their priors, nats.
    fn evidence<'a>(&'a self, reading: &'a [Option<Registered>]) -> impl Iterator<Item = f64> + 'a {
        let pairs = reading.iter().zip(&self.of_given);
        pairs.map(move |(reading, given)| deviation(given) - deviation(reading))
    }

    /// Evidence of each pair for a reading against the one given, nats, by priors alone, or by
    /// pixels, too, where a pair fits in both.
    ///
    /// Only another camera makes pairs correlate better or worse than as given. In all other
    /// readings they differ by chance, which tells nothing.
    pub fn pair_nats(&self, reading: &[Option<Registered>], by_pixels: bool) -> Vec<f64> {
        let of_pixels = |(reading, given): (&Option<Registered>, &Option<Registered>)| {
            Some((*reading)?.log_likelihood - (*given)?.log_likelihood)
        };
        let pairs = reading.iter().zip(&self.of_given);
        let of_pixels = pairs.map(|pair| of_pixels(pair).filter(|_| by_pixels));
        let evidence = self.evidence(reading).zip(of_pixels);
        evidence
            .map(|(of_prior, of_pixels)| of_prior + of_pixels.unwrap_or_default())
            .collect()
    }

    /// True if a reading may be taken whose first pairs are `reading` and in which all others fit
    /// without any deviation: if its odds by priors suffice, three quarters of the pairs fit, and
    /// those that tell it from the one given agree.
    pub fn may_take(&self, reading: &[Option<Registered>]) -> bool {
        let left = &self.of_given[reading.len()..];
        let at_best = left.iter().map(deviation);
        let evidence: Vec<f64> = self.evidence(reading).chain(at_best).collect();
        let fitting = reading.iter().flatten().count() + left.len();
        self.total_nats(&evidence) > self.least_nats
            && 4 * fitting >= 3 * self.of_given.len()
            && self.agree(&evidence)
    }

    /// True if three quarters of the pairs that tell a reading from the one given speak for it, or,
    /// where as many fit as given, too, if their evidence exceeds its scatter: the errors of poses
    /// may turn the sign of a pair's small evidence. (Where pairs do not fit, that is large.)
    fn agree(&self, evidence: &[f64]) -> bool {
        let pairs = evidence.iter().zip(&self.telling);
        let telling = pairs.filter(|(_, tells)| **tells).map(|(nats, _)| *nats);
        let telling: Vec<f64> = telling.collect();
        let speaks = |nats: &&f64| **nats > self.min_pair_nats;
        let for_it = telling.iter().filter(speaks).count();
        let fit_as_given = self.of_given.iter().flatten().count();
        let is_small = self.min_pair_nats == 0.0 && 4 * fit_as_given >= 3 * self.of_given.len();
        4 * for_it >= 3 * telling.len() || (is_small && exceeds_scatter(&telling))
    }

    /// Evidence of all pairs, nats, in which no pair that does not fit as given speaks louder for
    /// a reading than the upper quartile of the telling ones: of weak pictures, some do not fit by
    /// chance, in a right reading as well.
    ///
    /// Source: J. W. Tukey, "The future of data analysis", Annals of Mathematical Statistics 33(1),
    /// 1962 (winsorised sums).
    pub fn total_nats(&self, evidence: &[f64]) -> f64 {
        let pairs = evidence.iter().zip(&self.telling);
        let telling = pairs.filter(|(_, tells)| **tells).map(|(nats, _)| *nats);
        let mut telling: Vec<f64> = telling.collect();
        telling.sort_unstable_by(f64::total_cmp);
        let below = telling.len() - telling.len() / 4;
        let quartile = telling[..below].last().copied().unwrap_or(f64::INFINITY);
        let pairs = evidence.iter().zip(&self.of_given);
        pairs
            .map(|(nats, given)| match given {
                Some(_) => *nats,
                None => nats.min(quartile),
            })
            .sum()
    }
}

/// True if evidence exceeds 0 by more than it scatters from pair to pair.
///
/// Source: Q. H. Vuong, "Likelihood ratio tests for model selection and non-nested hypotheses",
/// Econometrica 57(2), 1989.
pub fn exceeds_scatter(evidence: &[f64]) -> bool {
    let sum: f64 = evidence.iter().sum();
    let mean = sum / evidence.len() as f64;
    let squares: f64 = evidence.iter().map(|nats| (nats - mean).powi(2)).sum();
    sum > MIN_EVIDENCE_SIGMAS * squares.sqrt()
}

/// Deviation of a frame from its prior; one that does not fit deviates by as much as that allows.
fn deviation(registered: &Option<Registered>) -> f64 {
    registered.map_or(MAX_DEVIATION_COST, |registered| registered.deviation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::frame_estimate::FrameEstimate;
    use tunnelstitch_geometry::trajectory::Pose;

    /// A frame that deviates from its prior by so much.
    fn fits(deviation: f64) -> Option<Registered> {
        Some(Registered {
            estimate: FrameEstimate::at(Pose::identity()),
            is_reliable: true,
            deviation,
            log_likelihood: 0.0,
        })
    }

    #[test]
    fn a_reading_is_given_up_once_the_other_pairs_cannot_save_it() {
        let comparison = Comparison {
            of_given: vec![fits(3.0); 12],
            telling: vec![true; 12],
            least_nats: 9.5,
            min_pair_nats: 0.0,
        };
        assert!(comparison.may_take(&[]));
        assert!(comparison.may_take(&[fits(1.0); 12]));
        // Three quarters of the pairs must fit.
        assert!(comparison.may_take(&[fits(4.0); 6]));
        assert!(!comparison.may_take(&[fits(4.0); 7]));
        assert!(!comparison.may_take(&[None; 4]));
        // A pair that does not fit costs more than the others can make up for here.
        assert!(!comparison.may_take(&[None]));
        assert!(!comparison.may_take(&[fits(2.5); 12]));
    }

    /// Less than three quarters speak for a reading, but on the whole they do; one pair alone does
    /// not.
    #[test]
    fn pairs_agree_whose_evidence_exceeds_its_scatter() {
        let given = [5.0, 6.0, 10.0, 7.0, 27.0, 16.0, 15.0, 17.0].map(fits);
        let comparison = |min_pair_nats| Comparison {
            of_given: given.to_vec(),
            telling: vec![true; 8],
            least_nats: 9.5,
            min_pair_nats,
        };
        let mixed = [6.5, 1.4, 6.4, 7.4, 10.0, 17.2, 5.0, 7.9].map(fits);
        assert!(comparison(0.0).may_take(&mixed));
        // Of poses of other frames, each pair must tell.
        assert!(!comparison(18.0).may_take(&mixed));
        // Weak pictures fit by chance, or not.
        let weak = Comparison {
            of_given: [&[None; 3], &given[3..]].concat(),
            ..comparison(0.0)
        };
        let by_chance = [5.0, 5.0, 5.0, 8.0, 28.0, 17.0, 16.0, 12.0].map(fits);
        assert!(!weak.may_take(&by_chance));
        let single = [6.5, 7.4, 11.4, 8.4, 0.0, 17.2, 15.0, 16.0].map(fits);
        assert!(!comparison(0.0).may_take(&single));
    }

    /// Pairs with the same step in both readings must fit, and need not speak for it.
    #[test]
    fn pairs_that_tell_nothing_need_only_fit() {
        let comparison = Comparison {
            of_given: [[None; 6], [fits(3.0); 6]].concat(),
            telling: [[true; 6], [false; 6]].concat(),
            least_nats: 9.5,
            min_pair_nats: 18.0,
        };
        assert!(comparison.may_take(&[fits(3.0); 12]));
        assert!(comparison.may_take(&[[fits(3.0); 6], [fits(4.0); 6]].concat()));
        assert!(!comparison.may_take(&[[fits(3.0); 6], [None; 6]].concat()));
        // Two of six speak against it, by too little to speak for it.
        assert!(!comparison.may_take(&[fits(20.0), fits(20.0)]));
    }

    /// Of eight pairs, two that do not fit as given are chance; three are not.
    #[test]
    fn a_quarter_of_the_pairs_does_not_decide() {
        let odds = |unfit: usize| {
            let comparison = Comparison {
                of_given: [vec![None; unfit], vec![fits(3.0); 8 - unfit]].concat(),
                telling: vec![true; 8],
                least_nats: 9.5,
                min_pair_nats: 0.0,
            };
            let reading = [fits(2.5); 8];
            let nats = comparison.pair_nats(&reading, false);
            (comparison.total_nats(&nats), comparison.may_take(&reading))
        };
        assert_eq!(odds(0), (4.0, false));
        assert_eq!(odds(2), (4.0, false));
        assert_eq!(odds(3), (3.0 * (MAX_DEVIATION_COST - 2.5) + 2.5, true));
    }

    /// Steps that are longer than planned fit a shorter focal length, but the pictures do not.
    #[test]
    fn pixels_that_correlate_worse_speak_against_a_reading() {
        let correlates = |deviation: f64, log_likelihood: f64| {
            fits(deviation).map(|registered| Registered {
                log_likelihood,
                ..registered
            })
        };
        let comparison = Comparison {
            of_given: vec![correlates(3.0, 40.0), correlates(3.0, 40.0), None],
            telling: vec![true; 3],
            least_nats: 3.0,
            min_pair_nats: 0.0,
        };
        let nats = |of_pixels: f64, by_pixels| -> f64 {
            let reading = [correlates(1.0, of_pixels); 3];
            comparison.pair_nats(&reading, by_pixels).iter().sum()
        };
        let odds = |of_pixels: f64| nats(of_pixels, true);
        let by_priors = nats(0.0, false);
        assert_eq!(by_priors, 4.0 + MAX_DEVIATION_COST - 1.0);
        assert_eq!(odds(40.0), by_priors);
        assert_eq!(odds(30.0), by_priors - 20.0);
    }
}
