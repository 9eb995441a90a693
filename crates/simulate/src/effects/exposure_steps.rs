//! Steps of the exposure: an automatic exposure that changes now and then.

use crate::procedural_noise::{RandomStream, uniform};

/// Share of the frames at which the exposure changes.
const STEP_SHARE: f32 = 0.1;

/// Exposure factors of the frames, relative to that of the first.
///
/// At a random tenth of the frames the exposure is multiplied by a factor and then stays. With e
/// the logarithm of the exposure to the base F, which begins at 0, the new one is uniform between
/// `max(−1, e − 1)` and `min(1, e + 1)`: both the step and the exposure lie between 1/F and F.
#[derive(Clone, Debug)]
pub(super) struct ExposureSteps {
    factors: Vec<f64>,
}

impl ExposureSteps {
    /// Draws the factors of `frames` frames with steps of at most `step` (F).
    pub fn new(seed: u64, step: f64, frames: usize) -> Self {
        let seed = RandomStream::ExposureSteps.seed(seed);
        let mut e = 0.0f64;
        let factors = (0..frames as i64).map(|frame| {
            if frame > 0 && uniform(seed, frame, 0) < STEP_SHARE {
                let (low, high) = ((e - 1.0).max(-1.0), (e + 1.0).min(1.0));
                e = low + (high - low) * f64::from(uniform(seed, frame, 1));
            }
            step.powf(e)
        });
        Self {
            factors: factors.collect(),
        }
    }

    /// Factor of a frame.
    pub fn factor(&self, frame: usize) -> f64 {
        self.factors[frame]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tenth_of_the_frames_steps_by_a_bounded_factor_and_the_others_stay() {
        let (frames, step) = (4000, 1.5);
        let steps = ExposureSteps::new(3, step, frames);
        assert_eq!(steps.factor(0), 1.0);
        let mut sizes = Vec::new();
        for frame in 1..frames {
            let ratio = steps.factor(frame) / steps.factor(frame - 1);
            if ratio != 1.0 {
                sizes.push(ratio.ln() / step.ln());
            }
            assert!((1.0 / step..=step).contains(&steps.factor(frame)));
        }
        assert!((340..460).contains(&sizes.len()), "{}", sizes.len());
        assert!(sizes.iter().all(|size| size.abs() <= 1.0 + 1e-9));
        let large = sizes.iter().filter(|size| size.abs() > 0.5).count();
        assert!(large > sizes.len() / 4, "{large}");
        let other = ExposureSteps::new(4, step, frames);
        assert!((0..frames).any(|frame| other.factor(frame) != steps.factor(frame)));
    }
}
