//! Local contrast normalisation, for comparing frames before lighting and exposure are known.

use super::grey::GreyImage;
use super::windows::{Moments, window_moments};
use tunnelstitch_geometry::numerics::median::MAD_TO_SIGMA;

/// Half width of the largest window relative to the image's shorter side.
const WINDOW_FRACTION: f64 = 1.0 / 8.0;
/// Fraction of the image's global spread that is added to the local one, so that uniform regions
/// stay uniform.
const MIN_SPREAD_FRACTION: f32 = 0.3;

/// Half width of the window for comparing whole images: an eighth of the shorter side, pixels.
pub fn wide_window(image: &GreyImage) -> usize {
    ((WINDOW_FRACTION * image.width().min(image.height()) as f64).round() as usize).max(2)
}

/// The locally normalised parts of an image.
#[derive(Debug)]
pub struct LocalContrast {
    /// `I − mean`, grey levels.
    pub detail: GreyImage,
    /// `(I − mean)/√(variance + floor)`.
    pub contrast: GreyImage,
    /// `1/(variance + floor)`: the variance of unit noise in the contrast.
    pub sensitivity: GreyImage,
}

/// Detail is clipped at this multiple of its spread ([`detail`]), because glints and foreign
/// objects would otherwise dominate a faint wall.
const MAX_DETAIL_SIGMAS: f32 = 1.5;

/// Computes detail and contrast with mean and variance over a square window of `2 reach + 1` pixels
/// around each pixel.
///
/// Smooth lighting cancels, whether fixed to the world or to the camera, as do gain and bias.
/// Pixels without a value are ignored and stay without one.
pub fn local_contrast(image: &GreyImage, reach: usize) -> LocalContrast {
    let w = image.width();
    let values = clip_detail(image, reach, MAX_DETAIL_SIGMAS);
    let moments = window_moments(&values, w, [reach; 2]);
    let overall = moments.iter().map(|m| m.variance).sum::<f32>() / moments.len().max(1) as f32;
    let floor = MIN_SPREAD_FRACTION * MIN_SPREAD_FRACTION * overall + 1e-6;
    let picture = |value: &dyn Fn(f32, &Moments) -> f32| {
        let data = values.iter().zip(&moments).map(|(v, m)| value(*v, m));
        GreyImage::new(w, image.height(), data.collect())
    };
    LocalContrast {
        detail: picture(&|v, m| v - m.mean),
        contrast: picture(&|v, m| (v - m.mean) / (m.variance + floor).sqrt()),
        sensitivity: picture(&|_, m| 1.0 / (m.variance + floor)),
    }
}

/// Clips the detail over windows of `2 reach + 1` pixels at `most` times its spread ([`detail`]).
fn clip_detail(image: &GreyImage, reach: usize, most: f32) -> Vec<f32> {
    let mut values = image.data().to_vec();
    let (means, sigma) = detail(image, reach);
    for (value, mean) in values.iter_mut().zip(&means) {
        // NaN stays NaN.
        *value = value.clamp(mean - most * sigma, mean + most * sigma);
    }
    values
}

/// The means over windows of `2 reach + 1` pixels, and the spread of the deviations from them, of
/// which outliers are multiples (0 for an image without values).
///
/// It is the robust σ of the deviations over the share ρ of their variance that neighbouring pixels
/// have in common, along rows or columns: `ρ = 1 − σ²(I(x+1) − I(x))/2σ²`, by robust σ again. The
/// rest is noise. Where ρ is nearly 1, most pixels show the wall, and what stands out of them is
/// foreign to it. Where it is nearly 0, they show nothing, and what stands out is all that there is
/// of the wall.
fn detail(image: &GreyImage, reach: usize) -> (Vec<f32>, f32) {
    let (values, width) = (image.data(), image.width());
    let moments = window_moments(values, width, [reach; 2]);
    let means: Vec<f32> = moments.into_iter().map(|m| m.mean).collect();
    let deviations = values.iter().zip(&means).map(|(value, mean)| value - mean);
    let sigma = robust_sigma(deviations);
    if sigma == 0.0 {
        return (means, 0.0);
    }
    let [row, column] = [1, width].map(|offset| {
        let neighbours = values.iter().zip(values.iter().skip(offset));
        robust_sigma(neighbours.map(|(value, next)| next - value))
    });
    let common = 1.0 - 0.5 * (row.min(column) / sigma).powi(2);
    (means, sigma / common.max(f32::MIN_POSITIVE))
}

/// Robust σ of values with zero median, by every third of them; 0 if there are none.
fn robust_sigma(values: impl Iterator<Item = f32>) -> f32 {
    let mut sizes: Vec<f32> = values
        .map(f32::abs)
        .filter(|size| !size.is_nan())
        .step_by(3)
        .collect();
    if sizes.is_empty() {
        return 0.0;
    }
    let middle = sizes.len() / 2;
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f32::total_cmp);
    MAD_TO_SIGMA as f32 * *median
}

/// Clips deviations from the local mean at a few times their spread ([`detail`]). On a coarser
/// level, glints and objects in front of the wall would blend into it, where a robust loss could no
/// longer separate them.
pub fn clip_outliers(image: &GreyImage) -> GreyImage {
    let values = clip_detail(image, wide_window(image), MAX_CLIPPED_SIGMAS);
    GreyImage::new(image.width(), image.height(), values)
}

/// Largest detail after [`clip_outliers`], multiples of the spread ([`detail`]).
const MAX_CLIPPED_SIGMAS: f32 = 3.0;

/// Removes outliers: pixels that stand out of their surroundings, such as wet patches and glints,
/// get no value.
pub fn mask_outliers(image: &GreyImage) -> GreyImage {
    // Relative to clipped surroundings, so that outliers do not bias the mean.
    let (means, sigma) = detail(&clip_outliers(image), wide_window(image));
    let pixels = image.data().iter().zip(&means);
    let values = pixels.map(|(value, mean)| {
        if (value - mean).abs() > MAX_KEPT_SIGMAS * sigma {
            f32::NAN
        } else {
            *value
        }
    });
    GreyImage::new(image.width(), image.height(), values.collect())
}

/// Largest detail of an inlier, multiples of the spread ([`detail`]); less than the bound of
/// [`clip_outliers`].
const MAX_KEPT_SIGMAS: f32 = 2.5;

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

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
    fn a_wet_patch_is_not_usual_and_the_wall_around_it_is() {
        let wet = |x: usize, y: usize| (60..66).contains(&x) && (20..27).contains(&y);
        let value = |k: usize| match (k % 200, k / 200) {
            (x, y) if wet(x, y) => 60.0,
            (x, y) => 100.0 + 2.0 * texture(x, y),
        };
        let left = mask_outliers(&GreyImage::new(200, 160, (0..32000).map(value).collect()));
        for (k, value) in left.data().iter().enumerate() {
            assert_eq!(value.is_nan(), wet(k % 200, k / 200), "{k}");
        }
    }

    /// Specks on a bare wall in noise are the wall; the same specks on a textured one may be drops.
    #[test]
    fn what_stands_out_of_mere_noise_is_kept() {
        let is_speck = |k: usize| k % 200 % 20 < 3 && k / 200 % 20 < 3;
        let specks_left = |texture_grey: f32| {
            let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
            let noise = Normal::new(0.0, 2.0).unwrap();
            let value = |k: usize| {
                let wall = texture_grey * texture(k % 200, k / 200);
                let speck = if is_speck(k) { 60.0 } else { 0.0 };
                100.0 + wall + speck + noise.sample(&mut rng) as f32
            };
            let left = mask_outliers(&GreyImage::new(200, 160, (0..32000).map(value).collect()));
            let values = left.data().iter().enumerate();
            values
                .filter(|(k, value)| is_speck(*k) && !value.is_nan())
                .count()
        };
        assert!(specks_left(0.0) > 600, "of 720: {}", specks_left(0.0));
        assert_eq!(specks_left(8.0), 0);
    }

    #[test]
    fn gaps_stay_gaps_and_spoil_nothing_else() {
        let mut image = GreyImage::new(20, 20, (0..400).map(|k| texture(k % 20, k / 20)).collect());
        image.data_mut()[210] = f32::NAN;
        let contrast = local_contrast(&image, 3).contrast;
        assert_eq!(contrast.data().iter().filter(|v| v.is_nan()).count(), 1);
    }
}
