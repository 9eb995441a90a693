//! The verdict about a survey: whether its result may be used, and for what, in one sentence.

use crate::uncertainty::frame_sigma::FrameSigma;
use crate::uncertainty::model_error::ModelErrorReport;
use serde::{Deserialize, Serialize};
use tunnelstitch_geometry::numerics::median::upper_median;

/// The verdict about a survey.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SurveyVerdict {
    /// Number of photometric frames.
    pub photometric: usize,
    /// Number of frames.
    pub frames: usize,
    /// The sentence: whether the result may be used, and for what.
    pub sentence: String,
}

impl SurveyVerdict {
    /// The verdict about frames, with the σ of those that are photometric and of those that are
    /// placed less exactly than `max_sigma_px`; `contradiction`: of the prior to the lengths, if
    /// there is one.
    pub fn new(
        (photometric, uncertain): (&[FrameSigma], &[FrameSigma]),
        frames: usize,
        max_sigma_px: f64,
        model_error: Option<&ModelErrorReport>,
        contradiction: Option<&str>,
    ) -> Self {
        let shape = match model_error {
            Some(_) => {
                "; the residuals show errors of lens, shape or light, which σ includes as far as \
                 they show"
            }
            None => "",
        };
        let accuracy = accuracy(photometric);
        let less = less_exact(uncertain, max_sigma_px);
        let others = match frames - photometric.len() - uncertain.len() {
            0 => "",
            _ => "; the others rest on the prior",
        };
        let sentence = match (contradiction, photometric.len(), uncertain.len()) {
            (Some(contradiction), ..) => {
                format!("the result must not be used: {contradiction}; the initial poses are kept")
            }
            (None, 0, 0) => {
                "the result must not be used: no frame is photometric, and the initial \
                             poses are kept"
                    .to_owned()
            }
            (None, 0, _) => format!(
                "the result is not as exact as asked for: {less}{shape}{others}; \
                 --max-sigma-px accepts such frames"
            ),
            (None, all, _) if all == frames => {
                format!(
                    "the result may be used: all {frames} frames are right to {accuracy}{shape}"
                )
            }
            (None, some, 0) => format!(
                "the result may be used for {some} of {frames} frames, which are right to \
                 {accuracy}{shape}{others}"
            ),
            (None, some, _) => format!(
                "the result may be used for {some} of {frames} frames, which are right to \
                 {accuracy}{shape}; {less}{others}"
            ),
        };
        Self {
            photometric: photometric.len(),
            frames,
            sentence,
        }
    }
}

/// The accuracy of frames, in words: medians.
fn accuracy(sigmas: &[FrameSigma]) -> String {
    let median = |of: fn(&FrameSigma) -> f64| {
        upper_median(sigmas.iter().map(of).collect()).unwrap_or(f64::NAN)
    };
    format!(
        "{:.3} px against each other, {:.2} px against the first frame (1-σ)",
        median(|sigma| sigma.registration_px),
        median(|sigma| sigma.wall_px),
    )
}

/// The frames that are placed less exactly than asked for, in words.
fn less_exact(uncertain: &[FrameSigma], max_sigma_px: f64) -> String {
    format!(
        "{} frames are refined to {}, more than {max_sigma_px} px",
        uncertain.len(),
        accuracy(uncertain)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sigmas(count: usize, registration_px: f64) -> Vec<FrameSigma> {
        let sigma = FrameSigma {
            rotation_deg: 0.01,
            translation_m: 0.001,
            wall_m: 0.001,
            wall_px: 0.9,
            registration_px,
        };
        vec![sigma; count]
    }

    #[test]
    fn a_sentence_says_what_may_be_used() {
        let sentence = |photometric: usize, uncertain: usize| {
            let placed = (sigmas(photometric, 0.01), sigmas(uncertain, 0.4));
            SurveyVerdict::new((&placed.0, &placed.1), 10, 0.25, None, None).sentence
        };
        assert_eq!(
            sentence(10, 0),
            "the result may be used: all 10 frames are right to 0.010 px against each other, \
             0.90 px against the first frame (1-σ)"
        );
        assert!(sentence(0, 0).contains("initial poses are kept"));
        let none = sentence(0, 8);
        assert!(none.contains("8 frames are refined to 0.400 px"), "{none}");
        assert!(none.contains("the others rest on the prior"), "{none}");
        let some = sentence(4, 6);
        assert!(
            some.contains("for 4 of 10 frames, which are right to 0.010 px"),
            "{some}"
        );
        assert!(
            some.ends_with(
                "6 frames are refined to 0.400 px against each other, 0.90 px \
            against the first frame (1-σ), more than 0.25 px"
            ),
            "{some}"
        );
    }
}
