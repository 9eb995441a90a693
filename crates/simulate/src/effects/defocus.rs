//! Blur of a lens that is out of focus.

use crate::effects::frame_effect::FrameEffect;
use tunnelstitch_core::frames::GreyImage;

/// Extent of the kernel, sigmas.
const REACH_SIGMAS: f64 = 4.0;

/// Gaussian point spread; beyond the border the outermost pixels are repeated.
pub(super) struct Defocus {
    /// One half of the normalised kernel, from its middle.
    half: Vec<f32>,
}

impl Defocus {
    /// Blur of 1-σ `sigma_px` (above 0).
    pub fn new(sigma_px: f64) -> Self {
        let reach = (REACH_SIGMAS * sigma_px).ceil() as usize;
        let weight = |k: usize| (-0.5 * (k as f64 / sigma_px).powi(2)).exp();
        let sum: f64 = weight(0) + 2.0 * (1..=reach).map(weight).sum::<f64>();
        let half = (0..=reach).map(|k| (weight(k) / sum) as f32);
        Self {
            half: half.collect(),
        }
    }

    /// Convolves a line of pixels, which begins and ends with `reach` repeated pixels.
    fn convolve(&self, padded: &[f32], blurred: &mut [f32]) {
        let reach = self.half.len() - 1;
        for (k, value) in blurred.iter_mut().enumerate() {
            let middle = reach + k;
            let sides =
                (1..=reach).map(|d| self.half[d] * (padded[middle - d] + padded[middle + d]));
            *value = self.half[0] * padded[middle] + sides.sum::<f32>();
        }
    }

    /// Blurs along the rows of an image of `width` columns.
    fn blur_rows(&self, width: usize, data: &mut [f32]) {
        let reach = self.half.len() - 1;
        let mut padded = vec![0.0; width + 2 * reach];
        for row in data.chunks_exact_mut(width) {
            padded[..reach].fill(row[0]);
            padded[reach..reach + width].copy_from_slice(row);
            padded[reach + width..].fill(row[width - 1]);
            self.convolve(&padded, row);
        }
    }
}

/// Exchanges rows and columns of an image of `width` columns.
fn transpose(width: usize, data: &[f32]) -> Vec<f32> {
    let height = data.len() / width;
    let columns = (0..width).flat_map(|u| (0..height).map(move |v| data[v * width + u]));
    columns.collect()
}

impl FrameEffect for Defocus {
    fn apply(&self, _frame: usize, image: GreyImage) -> GreyImage {
        let (width, height) = (image.width(), image.height());
        let mut data = image.data().to_vec();
        self.blur_rows(width, &mut data);
        let mut data = transpose(width, &data);
        self.blur_rows(height, &mut data);
        GreyImage::new(width, height, transpose(height, &data))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point spreads to a Gaussian of the given variance along both axes, and no light is lost.
    #[test]
    fn a_point_spreads_with_the_given_sigma() {
        let (width, height, sigma) = (61, 51, 2.5);
        let mut data = vec![0.0; width * height];
        data[25 * width + 30] = 1000.0;
        let image = Defocus::new(sigma).apply(0, GreyImage::new(width, height, data));
        let moment = |weight: &dyn Fn(f64, f64) -> f64| -> f64 {
            let pixels = image.data().iter().enumerate().map(|(k, value)| {
                let (u, v) = ((k % width) as f64 - 30.0, (k / width) as f64 - 25.0);
                f64::from(*value) * weight(u, v)
            });
            pixels.sum::<f64>() / 1000.0
        };
        assert!((moment(&|_, _| 1.0) - 1.0).abs() < 1e-4);
        assert!((moment(&|u, _| u * u) - sigma * sigma).abs() < 0.02);
        assert!((moment(&|_, v| v * v) - sigma * sigma).abs() < 0.02);
        assert!(moment(&|u, v| u * v).abs() < 1e-3);
    }

    #[test]
    fn an_even_image_stays_even_up_to_the_border() {
        let image = GreyImage::new(20, 16, vec![77.0; 320]);
        let blurred = Defocus::new(3.0).apply(0, image);
        assert!(
            blurred
                .data()
                .iter()
                .all(|value| (value - 77.0).abs() < 1e-3)
        );
    }
}
