//! Times of the frames of a survey that has no poses yet.

use super::error::SurveyError;

/// Times of frames, strictly increasing.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameTimes {
    /// Seconds if a clock is known, else the frames' indices.
    pub times_s: Vec<f64>,
    /// True if the times are seconds.
    pub is_clock: bool,
}

impl FrameTimes {
    /// Times of `count` frames: at `fps` frames per second from 0 s on, else `known_s`, else their
    /// indices.
    ///
    /// # Errors
    /// No frame; times that do not increase.
    pub fn new(
        count: usize,
        fps: Option<f64>,
        known_s: Option<Vec<f64>>,
    ) -> Result<Self, SurveyError> {
        let (times_s, is_clock) = match (fps, known_s) {
            (Some(fps), _) => ((0..count).map(|k| k as f64 / fps).collect(), true),
            (None, Some(known_s)) => (known_s, true),
            (None, None) => ((0..count).map(|k| k as f64).collect(), false),
        };
        if times_s.is_empty() {
            return Err(SurveyError::NoFrame);
        }
        if let Some(k) = times_s.windows(2).position(|pair| pair[1] <= pair[0]) {
            return Err(SurveyError::FrameTimeOrder {
                frame: k + 1,
                time_s: times_s[k + 1],
                previous_s: times_s[k],
            });
        }
        Ok(Self { times_s, is_clock })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_wins_over_known_times_and_indices_are_no_clock() {
        let at_rate = FrameTimes::new(3, Some(2.0), Some(vec![7.0, 8.0, 9.0])).unwrap();
        assert_eq!(at_rate.times_s, [0.0, 0.5, 1.0]);
        assert!(at_rate.is_clock);
        let indices = FrameTimes::new(2, None, None).unwrap();
        assert_eq!(indices.times_s, [0.0, 1.0]);
        assert!(!indices.is_clock);
    }

    #[test]
    fn times_must_increase() {
        let error = FrameTimes::new(3, None, Some(vec![0.0, 2.0, 2.0])).unwrap_err();
        assert!(error.to_string().starts_with("frame 2 has time 2 s"));
        assert!(FrameTimes::new(0, None, None).is_err());
    }
}
