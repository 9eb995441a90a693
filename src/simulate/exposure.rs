//! Gain and bias of a frame.

use super::SimulateOptions;
use super::noise::Purpose;
use crate::frames::GreyImage;
use rand::Rng;

/// How a frame turns light into grey levels: `I = a L + b`, with L the grey level that an exposure
/// of gain 1 and bias 0 would give.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposure {
    /// Gain a.
    pub gain: f64,
    /// Bias b, grey levels.
    pub bias_grey: f64,
}

impl Exposure {
    /// The exposure of a frame: with independent x and y, uniform in [−1, 1), `a = 1 + x P/100` and
    /// `b = y B`, where P is [`SimulateOptions::gain_percent`] and B is
    /// [`SimulateOptions::bias_grey`].
    pub(super) fn of(options: &SimulateOptions, frame: usize) -> Self {
        let mut rng = Purpose::Exposure.rng(options.seed, frame);
        // Both are drawn always, so that asking for one does not change the other.
        let [x, y]: [f64; 2] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        Self {
            gain: 1.0 + x * options.gain_percent / 100.0,
            bias_grey: y * options.bias_grey,
        }
    }

    /// `a L + b` of every pixel; a gain of 1 and a bias of 0 change no bit.
    pub(super) fn expose(self, light: GreyImage) -> GreyImage {
        let (gain, bias) = (self.gain as f32, self.bias_grey as f32);
        let data = light.data().iter().map(|light| gain * light + bias);
        GreyImage::new(light.width(), light.height(), data.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposures_fill_their_range_and_do_not_hang_together() {
        let both = SimulateOptions {
            gain_percent: 20.0,
            bias_grey: 8.0,
            ..SimulateOptions::free()
        };
        let n = 4000;
        let drawn: Vec<Exposure> = (0..n).map(|frame| Exposure::of(&both, frame)).collect();
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
        assert_eq!(Exposure::of(&gain_only, 7).gain, drawn[7].gain);
        assert_eq!(Exposure::of(&gain_only, 7).bias_grey, 0.0);
    }
}
