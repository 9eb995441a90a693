//! Other readings of poses, pictures and camera than those given, in which frames fit.

use serde::{Deserialize, Serialize};

/// Largest power of ten of odds that is printed: no prior is right so far out.
const MAX_ODDS_POWER: f64 = 20.0;

/// The result of a search for other readings of a survey ([`crate::reading_search`]).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OtherReadings {
    /// They were not compared.
    #[default]
    Untried,
    /// Neighbouring frames agree better with none of them.
    NoneFits,
    /// Neighbouring frames agree better with these.
    Fit(FittingReadings),
}

impl OtherReadings {
    /// True if they were not compared.
    pub fn are_untried(&self) -> bool {
        *self == Self::Untried
    }
}

impl From<Option<FittingReadings>> for OtherReadings {
    fn from(found: Option<FittingReadings>) -> Self {
        found.map_or(Self::NoneFits, Self::Fit)
    }
}

/// Readings that neighbouring frames agree with rather than with the one given.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FittingReadings {
    /// The readings, each as it is asked for.
    pub readings: Vec<String>,
    /// True if one of them is of another camera.
    pub is_of_camera: bool,
    /// Pairs of neighbouring frames that fit in the first of them.
    pub fitting: usize,
    /// Pairs that fit as given.
    pub given: usize,
    /// Pairs that were looked at.
    pub pairs: usize,
    /// Natural logarithm of the posterior odds of the first to the one given.
    pub log_odds: f64,
}

impl FittingReadings {
    /// The finding in one sentence.
    pub fn sentence(&self) -> String {
        let Self {
            readings,
            fitting,
            given,
            pairs,
            log_odds,
            ..
        } = self;
        let power = log_odds / std::f64::consts::LN_10;
        let odds = if power < MAX_ODDS_POWER {
            format!("odds of 10^{power:.0} to 1")
        } else {
            format!("odds of more than 10^{MAX_ODDS_POWER:.0} to 1")
        };
        let readings = readings.join(", or with ");
        // Pairs may fit in both readings, far from the prior in one of them.
        if 4 * given < 3 * pairs {
            format!(
                "the frames do not agree with poses, pictures and camera as given ({given} of \
                 {pairs} neighbours fit each other); they agree ({fitting} of {pairs}, {odds}) \
                 with {readings}"
            )
        } else {
            format!(
                "the frames agree better than with poses, pictures and camera as given, by which \
                 {given} of {pairs} neighbours fit each other, but far from their prior, with \
                 {readings} ({fitting} of {pairs}, {odds})"
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sentence_does_not_contradict_its_numbers() {
        let sentence = |given| {
            let found = FittingReadings {
                readings: vec!["a".to_owned(), "b".to_owned()],
                is_of_camera: false,
                fitting: 7,
                given,
                pairs: 7,
                log_odds: 39.0,
            };
            found.sentence()
        };
        let none = sentence(0);
        assert!(
            none.contains("do not agree") && none.contains("(0 of 7"),
            "{none}"
        );
        let all = sentence(7);
        assert!(
            all.contains("agree better") && all.contains("a, or with b (7 of 7"),
            "{all}"
        );
        assert!(!all.contains("do not"), "{all}");
    }
}
