//! Interpolation between a frame's pixels, and the correlation of noise that it causes.
//!
//! Along each axis a sample at the fraction f from one pixel to the next is `Σ_i K(i − f) I_i`. At
//! sharp edges its value depends on f, which mimics a displacement of some hundredths of a pixel.
//!
//! Source: R. G. Keys, "Cubic convolution interpolation for digital image processing", IEEE
//! Transactions on Acoustics, Speech, and Signal Processing 29(6), 1981.

use serde::{Deserialize, Serialize};
use tunnelstitch_geometry::numerics::kernel;

/// Interpolation kernel K.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Interpolation {
    /// A triangle: two pixels along each axis.
    Bilinear,
    /// Keys's cubic with a = −½: four pixels, exact for quadratics.
    Bicubic,
}

/// Number of steps of an integral over a pixel.
const STEPS: usize = 256;

impl Interpolation {
    /// The kernel `K(x)` and its reach.
    fn kernel(self) -> kernel::Interpolation {
        match self {
            Self::Bilinear => kernel::Interpolation::Bilinear,
            Self::Bicubic => kernel::Interpolation::Bicubic,
        }
    }

    /// Covariance along one axis of two samples at a distance d in an image of white noise of
    /// variance 1, on average over all fractions: `β(d) = ∫ K(x) K(x + d) dx`.
    ///
    /// `distance_px`: d. The variance of a sample in both axes is `β(0)²`; bilinear: 4/9.
    pub fn autocorrelation(self, distance_px: f64) -> f64 {
        let kernel = self.kernel();
        let steps = (2.0 * kernel.reach()) as usize * STEPS;
        let at = |k: usize| (k as f64 + 0.5) / STEPS as f64 - kernel.reach();
        let products =
            (0..steps).map(|k| kernel.weight(at(k)) * kernel.weight(at(k) + distance_px));
        products.sum::<f64>() / STEPS as f64
    }
}

/// Weights of the pixels at −1, 0, 1 and 2 at the fraction `f` from 0 to 1: `K(i − f)` of
/// [`Interpolation::Bicubic`].
#[inline(always)]
pub fn cubic_weights(f: f32) -> [f32; 4] {
    let g = 1.0 - f;
    [
        -0.5 * f * g * g,
        1.0 + f * f * (1.5 * f - 2.5),
        1.0 + g * g * (1.5 * g - 2.5),
        -0.5 * g * f * f,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubic_weights_are_the_kernel() {
        for k in 0..=10 {
            let f = k as f32 / 10.0;
            for (i, weight) in cubic_weights(f).into_iter().enumerate() {
                let expected = kernel::Interpolation::Bicubic.weight(i as f64 - 1.0 - f64::from(f));
                assert!((f64::from(weight) - expected).abs() < 1e-6, "{f} {i}");
            }
        }
    }

    /// A triangle's autocorrelation is the cubic B-spline; the cubic passes more noise.
    #[test]
    fn noise_correlation_is_the_autocorrelation_of_the_kernel() {
        let bilinear = |d: f64| Interpolation::Bilinear.autocorrelation(d);
        let expected = [
            (0.0, 2.0 / 3.0),
            (0.5, 23.0 / 48.0),
            (1.0, 1.0 / 6.0),
            (2.0, 0.0),
        ];
        for (distance, value) in expected {
            assert!((bilinear(distance) - value).abs() < 1e-5, "{distance}");
        }
        // Σ_i K(i − f)² over many fractions.
        let squares = (0..1000).map(|k| {
            let weights = cubic_weights((k as f32 + 0.5) / 1000.0);
            f64::from(weights.iter().map(|w| w * w).sum::<f32>())
        });
        let variance = Interpolation::Bicubic.autocorrelation(0.0);
        assert!((variance - squares.sum::<f64>() / 1000.0).abs() < 1e-5);
        assert!(variance > bilinear(0.0));
        assert_eq!(Interpolation::Bicubic.autocorrelation(4.0), 0.0);
    }
}
