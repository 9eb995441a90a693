//! The readings that a search has found.

/// Largest power of ten of odds that is printed: no prior is right so far out.
const MAX_ODDS_POWER: f64 = 20.0;

/// Readings that neighbouring frames agree with rather than with the one given.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct FittingReadings {
    /// The readings, each as it is asked for.
    pub readings: Vec<String>,
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
        } = self;
        let power = log_odds / std::f64::consts::LN_10;
        let odds = if power < MAX_ODDS_POWER {
            format!("odds of 10^{power:.0} to 1")
        } else {
            format!("odds of more than 10^{MAX_ODDS_POWER:.0} to 1")
        };
        format!(
            "the frames do not agree with poses, pictures and camera as given ({given} of {pairs} \
             neighbours fit each other); they agree ({fitting} of {pairs}, {odds}) with {}",
            readings.join(", or with ")
        )
    }
}
