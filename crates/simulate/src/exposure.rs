//! Exposure of a frame: gain and bias.

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
    /// Draws the exposure of a frame.
    ///
    /// With independent x and y, uniform in [−1, 1), `a = 1 + x P/100` and `b = y B`, where P is
    /// [`SimulateOptions::gain_percent`] and B is [`SimulateOptions::bias_grey`].
    pub(super) fn draw(options: &SimulateOptions, frame: usize) -> Self {
        let mut rng = RandomStream::Exposure.rng(options.seed, frame);
        // Both are always drawn, so that enabling one does not change the other.
        let [x, y]: [f64; 2] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        Self {
            gain: 1.0 + x * options.gain_percent / 100.0,
            bias_grey: y * options.bias_grey,
        }
    }

    /// Applies `a L + b` to every pixel; a gain of 1 and a bias of 0 change no bit.
    pub(super) fn apply(self, light: GreyImage) -> GreyImage {
        let (gain, bias) = (self.gain as f32, self.bias_grey as f32);
        let data = light.data().iter().map(|light| gain * light + bias);
        GreyImage::new(light.width(), light.height(), data.collect())
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
        let drawn: Vec<GainBias> = (0..n).map(|frame| GainBias::draw(&both, frame)).collect();
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
        assert_eq!(GainBias::draw(&gain_only, 7).gain, drawn[7].gain);
        assert_eq!(GainBias::draw(&gain_only, 7).bias_grey, 0.0);
    }
}
