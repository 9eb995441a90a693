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
    /// The verdict about frames, of which `photometric` holds the σ of those that are photometric;
    /// `contradiction`: of the prior to the lengths, if there is one.
    pub fn new(
        photometric: &[FrameSigma],
        frames: usize,
        model_error: Option<&ModelErrorReport>,
        contradiction: Option<&str>,
    ) -> Self {
        let median = |of: fn(&FrameSigma) -> f64| {
            upper_median(photometric.iter().map(of).collect()).unwrap_or(f64::NAN)
        };
        let accuracy = format!(
            "{:.3} px against each other, {:.2} px against the first frame (1-σ)",
            median(|sigma| sigma.registration_px),
            median(|sigma| sigma.wall_px),
        );
        let shape = match model_error {
            Some(_) => {
                "; the residuals show errors of lens, shape or light, which σ includes as far as \
                 they show"
            }
            None => "",
        };
        let sentence = match (contradiction, photometric.len()) {
            (Some(contradiction), _) => {
                format!("the result must not be used: {contradiction}; the initial poses are kept")
            }
            (None, 0) => "the result must not be used: no frame is photometric, and the initial \
                          poses are kept"
                .to_owned(),
            (None, all) if all == frames => {
                format!(
                    "the result may be used: all {frames} frames are right to {accuracy}{shape}"
                )
            }
            (None, some) => format!(
                "the result may be used for {some} of {frames} frames, which are right to \
                 {accuracy}{shape}; the others rest on the prior"
            ),
        };
        Self {
            photometric: photometric.len(),
            frames,
            sentence,
        }
    }
}
