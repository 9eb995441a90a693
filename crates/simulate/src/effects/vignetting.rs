//! Vignetting and camera-mounted light: shading that is fixed in the image.

use crate::effects::frame_effect::FrameEffect;
use tunnelstitch_core::frames::GreyImage;

/// Brightest pixel, as shares of the width and height between the outermost pixel centres.
///
/// It lies off the centre, so that no symmetry hides an error.
const BRIGHTEST: [f64; 2] = [0.6, 0.4];

/// Shading of a lamp that moves with the camera, or of a lens that darkens towards its corners.
///
/// With d the distance of pixel (u, v) from the brightest pixel and D that of the corner farthest
/// from it, both in pixels,
///
/// ```text
/// shade(u, v) = 1/(1 + (1/√c − 1) d²/D²)²,
/// ```
///
/// which is 1 at the brightest pixel and c in that corner. It is the cos⁴ law of a lens,
/// `cos⁴ φ = 1/(1 + tan² φ)²`, with tan φ in proportion to d.
pub(super) struct Vignetting {
    /// Brightest pixel (u, v).
    spot: [f64; 2],
    /// `(1/√c − 1)/D²`, 1/pixels².
    fall: f64,
}

impl Vignetting {
    /// Shading of frames of `width × height` pixels that falls to `corner` (0–1) in the corner
    /// farthest from the brightest pixel.
    pub fn new(corner: f64, width: usize, height: usize) -> Self {
        let last = [width, height].map(|size| size as f64 - 1.0);
        let spot = [BRIGHTEST[0] * last[0], BRIGHTEST[1] * last[1]];
        let farthest = |k: usize| spot[k].max(last[k] - spot[k]);
        Self {
            spot,
            fall: (1.0 / corner.sqrt() - 1.0) / (farthest(0).powi(2) + farthest(1).powi(2)),
        }
    }

    /// Share of the light at a pixel, 0–1.
    fn shade(&self, u: f64, v: f64) -> f64 {
        let square = (u - self.spot[0]).powi(2) + (v - self.spot[1]).powi(2);
        (1.0 + self.fall * square).powi(-2)
    }
}

impl FrameEffect for Vignetting {
    fn apply(&self, _frame: usize, image: GreyImage) -> GreyImage {
        let (width, height) = (image.width(), image.height());
        let data = image.data().iter().enumerate().map(|(k, light)| {
            let (u, v) = ((k % width) as f64, (k / width) as f64);
            light * self.shade(u, v) as f32
        });
        GreyImage::new(width, height, data.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_light_falls_smoothly_from_its_spot_to_the_share_in_the_farthest_corner() {
        let (width, height, corner) = (101, 81, 0.3);
        let vignetting = Vignetting::new(corner, width, height);
        let lit = vignetting.apply(
            0,
            GreyImage::new(width, height, vec![200.0; width * height]),
        );
        assert_eq!(lit.at(60, 32), 200.0);
        assert!((lit.at(0, 80) - 60.0).abs() < 1e-3);
        for (k, light) in lit.data().iter().enumerate() {
            assert!((59.999..=200.0).contains(light), "{k}: {light}");
        }
        // Monotonic on both sides of the brightest pixel, and not symmetric about the centre.
        for u in 1..width {
            assert!((lit.at(u, 32) > lit.at(u - 1, 32)) == (u <= 60), "{u}");
            assert!((lit.at(u, 32) - lit.at(u - 1, 32)).abs() < 4.0);
        }
        assert!(lit.at(100, 0) > lit.at(0, 0) + 10.0);
    }
}
