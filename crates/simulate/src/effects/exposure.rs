//! Exposure of a frame: gain and bias.

use crate::effects::exposure_steps::ExposureSteps;
use crate::effects::frame_effect::FrameEffect;
use crate::options::SimulateOptions;
use crate::procedural_noise::RandomStream;
use rand::Rng;
use tunnelstitch_core::frames::GreyImage;

/// Affine exposure model of a frame, `I = a L + b`, with L the grey level at gain 1 and bias 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GainBias {
    /// Gain a.
    pub gain: f64,
    /// Bias b, grey levels.
    pub bias_grey: f64,
}

impl GainBias {
    /// Applies `a L + b` to every pixel; a gain of 1 and a bias of 0 change no bit.
    fn apply(self, light: GreyImage) -> GreyImage {
        let (gain, bias) = (self.gain as f32, self.bias_grey as f32);
        let data = light.data().iter().map(|light| gain * light + bias);
        GreyImage::new(light.width(), light.height(), data.collect())
    }
}

/// Exposures of the frames of a survey.
#[derive(Clone, Debug)]
pub(crate) struct Exposures {
    seed: u64,
    gain_percent: f64,
    bias_grey: f64,
    steps: Option<ExposureSteps>,
}

impl Exposures {
    /// The exposures by the options of a survey.
    pub fn new(options: &SimulateOptions) -> Self {
        let steps = |step| ExposureSteps::new(options.seed, step, options.pictures());
        Self {
            seed: options.seed,
            gain_percent: options.gain_percent,
            bias_grey: options.bias_grey,
            steps: options.effects.exposure_step.map(steps),
        }
    }

    /// The exposure of a frame.
    ///
    /// With independent x and y, uniform in [−1, 1), `a = s (1 + x P/100)` and `b = y B`, where P
    /// is [`SimulateOptions::gain_percent`], B is [`SimulateOptions::bias_grey`], and s is the
    /// factor by the steps of the exposure, if there are any.
    pub fn of_frame(&self, frame: usize) -> GainBias {
        let mut rng = RandomStream::Exposure.rng(self.seed, frame);
        // Both are always drawn, so that enabling one does not change the other.
        let [x, y]: [f64; 2] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        let step = self.steps.as_ref().map_or(1.0, |steps| steps.factor(frame));
        GainBias {
            gain: step * (1.0 + x * self.gain_percent / 100.0),
            bias_grey: y * self.bias_grey,
        }
    }
}

impl FrameEffect for Exposures {
    fn apply(&self, frame: usize, image: GreyImage) -> GreyImage {
        self.of_frame(frame).apply(image)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gain_and_bias_are_uniform_and_uncorrelated() {
        let both = SimulateOptions {
            gain_percent: 20.0,
            bias_grey: 8.0,
            ..SimulateOptions::free()
        };
        let n = 4000;
        let exposures = Exposures::new(&both);
        let drawn: Vec<GainBias> = (0..n).map(|frame| exposures.of_frame(frame)).collect();
        let x: Vec<f64> = drawn.iter().map(|e| (e.gain - 1.0) / 0.2).collect();
        let y: Vec<f64> = drawn.iter().map(|e| e.bias_grey / 8.0).collect();
        for values in [&x, &y] {
            assert!(values.iter().all(|v| v.abs() <= 1.0));
            let mean = values.iter().sum::<f64>() / n as f64;
            let square = values.iter().map(|v| v * v).sum::<f64>() / n as f64;
            assert!(mean.abs() < 0.03 && (square - 1.0 / 3.0).abs() < 0.02);
        }
        let joint = x.iter().zip(&y).map(|(x, y)| x * y).sum::<f64>() / n as f64;
        assert!(joint.abs() < 0.02, "{joint}");
        let gain_only = SimulateOptions {
            bias_grey: 0.0,
            ..both
        };
        let seventh = Exposures::new(&gain_only).of_frame(7);
        assert_eq!((seventh.gain, seventh.bias_grey), (drawn[7].gain, 0.0));
    }
}
