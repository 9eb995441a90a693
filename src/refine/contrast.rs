//! Local contrast: a picture freed of light and exposure, for comparing frames before either is known.

use crate::frames::GreyImage;

/// Half width of the widest sensible window, as a share of the picture's shorter side.
const REACH: f64 = 1.0 / 8.0;
/// Share of the picture's own spread that is added to the local one: flat places stay flat.
const LEAST_SPREAD: f32 = 0.3;

/// Half width of the window for comparing whole pictures: an eighth of the shorter side, pixels.
pub fn wide_window(image: &GreyImage) -> usize {
    ((REACH * image.width().min(image.height()) as f64).round() as usize).max(2)
}

/// What of a picture is local.
pub struct LocalContrast {
    /// `I − mean`, grey levels.
    pub detail: GreyImage,
    /// `(I − mean)/√(variance + floor)`.
    pub contrast: GreyImage,
    /// `1/(variance + floor)`: the variance that a unit of noise has in the contrast.
    pub sensitivity: GreyImage,
}

/// Detail and contrast with mean and variance over a square window of `2 reach + 1` pixels around each pixel.
///
/// Any smooth light cancels, be it fixed to the world or to the camera, as do gain and bias. Pixels without a value
/// stay without one and do not count.
pub fn local_contrast(image: &GreyImage, reach: usize) -> LocalContrast {
    let (w, h) = (image.width(), image.height());
    // Sums over all pixels above and to the left: of 1, I, I², about a level near the mean.
    let known = image.data().iter().filter(|v| !v.is_nan());
    let level = known.clone().sum::<f32>() / known.count().max(1) as f32;
    let mut sums = vec![[0.0f64; 3]; (w + 1) * (h + 1)];
    for y in 0..h {
        let mut row = [0.0f64; 3];
        for x in 0..w {
            let value = image.at(x, y) - level;
            if !value.is_nan() {
                let value = f64::from(value);
                row[0] += 1.0;
                row[1] += value;
                row[2] += value * value;
            }
            let above = sums[y * (w + 1) + x + 1];
            sums[(y + 1) * (w + 1) + x + 1] = std::array::from_fn(|k| above[k] + row[k]);
        }
    }
    let moments = |x0: usize, y0: usize, x1: usize, y1: usize| -> (f32, f32) {
        let at = |x: usize, y: usize| &sums[y * (w + 1) + x];
        let (a, b, c, d) = (at(x0, y0), at(x1, y0), at(x0, y1), at(x1, y1));
        let sum: [f64; 3] = std::array::from_fn(|k| d[k] - b[k] - c[k] + a[k]);
        let n = sum[0].max(1.0);
        let mean = sum[1] / n;
        (mean as f32, (sum[2] / n - mean * mean).max(0.0) as f32)
    };
    let overall = {
        // Spread within windows, not of the light across the picture.
        let (mut sum, mut n) = (0.0f32, 0.0f32);
        for y in (reach..h.saturating_sub(reach)).step_by(reach) {
            for x in (reach..w.saturating_sub(reach)).step_by(reach) {
                sum += moments(x - reach, y - reach, x + reach + 1, y + reach + 1).1;
                n += 1.0;
            }
        }
        sum / n.max(1.0)
    };
    let floor = LEAST_SPREAD * LEAST_SPREAD * overall + 1e-6;
    let (mut detail, mut contrast) = (Vec::with_capacity(w * h), Vec::with_capacity(w * h));
    let mut sensitivity = Vec::with_capacity(w * h);
    for y in 0..h {
        let (y0, y1) = (y.saturating_sub(reach), (y + reach + 1).min(h));
        for x in 0..w {
            let (x0, x1) = (x.saturating_sub(reach), (x + reach + 1).min(w));
            let (mean, variance) = moments(x0, y0, x1, y1);
            let own = image.at(x, y) - level - mean;
            detail.push(own);
            contrast.push(own / (variance + floor).sqrt());
            sensitivity.push(1.0 / (variance + floor));
        }
    }
    LocalContrast {
        detail: GreyImage::new(w, h, detail),
        contrast: GreyImage::new(w, h, contrast),
        sensitivity: GreyImage::new(w, h, sensitivity),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texture(x: usize, y: usize) -> f32 {
        (1.3 * x as f32 + 0.2 * y as f32).sin() + (0.9 * y as f32 - 0.4 * x as f32).cos()
    }

    #[test]
    fn light_gain_and_bias_cancel() {
        let picture = |light: fn(f32, f32) -> f32| {
            let data = (0..60 * 40).map(|k| {
                let (x, y) = (k % 60, k / 60);
                light(x as f32, y as f32) * (100.0 + 20.0 * texture(x, y))
            });
            local_contrast(&GreyImage::new(60, 40, data.collect()), 5).contrast
        };
        let even = picture(|_, _| 1.0);
        let lit = picture(|x, y| 1.4 - 0.008 * x - 0.01 * y);
        let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
        for (a, b) in even.data().iter().zip(lit.data()) {
            (ab, aa, bb) = (ab + a * b, aa + a * a, bb + b * b);
        }
        assert!(ab / (aa * bb).sqrt() > 0.98);
    }

    #[test]
    fn gaps_stay_gaps_and_spoil_nothing_else() {
        let mut image = GreyImage::new(20, 20, (0..400).map(|k| texture(k % 20, k / 20)).collect());
        image.data_mut()[210] = f32::NAN;
        let contrast = local_contrast(&image, 3).contrast;
        assert_eq!(contrast.data().iter().filter(|v| v.is_nan()).count(), 1);
    }
}
