//! Sharpness of an image from a slanted edge: modulation transfer function.

use tunnelstitch_geometry::numerics::signal::{hann, sinc};
use tunnelstitch_geometry::numerics::spectrum::half_spectrum;

/// Bins of the edge's profile per pixel of the image.
const OVERSAMPLING: f64 = 4.0;

/// Computes the MTF50, the frequency (cycles per metre) at which an image's contrast is halved.
///
/// `samples` are pixels around a straight edge, each with its distance from the edge (metres) and
/// its value; `pixel_m` is the size of a pixel, metres. The edge is slanted, so that the pixels'
/// distances are dense. Their mean over bins of a quarter of a pixel is the edge spread function
/// (ESF), the difference of neighbouring bins the line spread function (LSF), and the modulus of
/// its Fourier transform the modulation transfer function (MTF), normalised at frequency 0 and
/// corrected for the response of the differences. A Hann window suppresses the noise of the outer
/// bins. The samples should extend to fifteen times the blur's 1-σ on either side, because the
/// window makes wider blurs look sharper. `None` if a bin is empty, or if the MTF does not fall to
/// a half.
///
/// Source: ISO 12233:2017, annex D (edge-based spatial frequency response).
pub fn mtf50(samples: impl IntoIterator<Item = (f64, f64)>, pixel_m: f64) -> Option<f64> {
    let mut lsf = line_spread(&edge_spread(samples, pixel_m / OVERSAMPLING)?);
    let n = lsf.len();
    let spectrum = half_spectrum(&mut lsf);
    let at_zero = f64::from(spectrum.first()?.norm());
    let per_bin = OVERSAMPLING / (n as f64 * pixel_m);
    let mut last = 1.0;
    for (k, value) in spectrum.iter().enumerate().skip(1) {
        // Responses of the central difference over two bins and of the mean over a bin: sinc(2f)
        // and sinc(f), f in cycles per bin.
        let f = k as f64 / n as f64;
        let response = sinc(2.0 * f) * sinc(f);
        let mtf = f64::from(value.norm()) / (at_zero * response);
        if f > 0.4 || !mtf.is_finite() {
            return None;
        }
        if mtf < 0.5 {
            return Some((k as f64 - (0.5 - mtf) / (last - mtf)) * per_bin);
        }
        last = mtf;
    }
    None
}

/// Edge spread function: the mean of the samples in each bin of `bin_m`; `None` if one is empty.
fn edge_spread(samples: impl IntoIterator<Item = (f64, f64)>, bin_m: f64) -> Option<Vec<f64>> {
    let samples: Vec<(i64, f64)> = samples
        .into_iter()
        .map(|(distance_m, value)| ((distance_m / bin_m).floor() as i64, value))
        .collect();
    let first = samples.iter().map(|(bin, _)| *bin).min()?;
    let last = samples.iter().map(|(bin, _)| *bin).max()?;
    let mut sums = vec![(0.0, 0.0); usize::try_from(last - first).ok()? + 1];
    for (bin, value) in samples {
        let (sum, count) = &mut sums[(bin - first) as usize];
        *sum += value;
        *count += 1.0;
    }
    // The outermost bins are incomplete.
    let inner = sums.get(1..sums.len() - 1)?;
    inner
        .iter()
        .map(|(sum, count)| (*count > 0.0).then(|| sum / count))
        .collect()
}

/// Line spread function: central differences under a Hann window.
fn line_spread(esf: &[f64]) -> Vec<f32> {
    let n = esf.len().saturating_sub(2);
    let differences = esf.windows(3).map(|bins| bins[2] - bins[0]);
    let windowed = differences
        .enumerate()
        .map(|(k, d)| (d * hann(k, n)) as f32);
    windowed.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    const PIXEL_M: f64 = 0.004;

    /// Pixels around an edge slanted by 5°, with the profile given.
    fn samples(profile: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
        let (sin, cos) = 5f64.to_radians().sin_cos();
        let mut samples = Vec::new();
        for y in -40..40 {
            for x in -30..30 {
                let distance_m = (cos * f64::from(x) + sin * f64::from(y)) * PIXEL_M;
                if distance_m.abs() < 0.09 {
                    samples.push((distance_m, profile(distance_m)));
                }
            }
        }
        samples
    }

    /// A Gaussian's MTF is `exp(−2 π² σ² f²)`.
    #[test]
    fn a_gaussian_blur_has_its_mtf50() {
        for sigma_m in [0.003, 0.004, 0.006] {
            // An approximation of the error function, good to 1.5e-7 (Abramowitz and Stegun,
            // 7.1.26).
            let erf = |x: f64| {
                let t = 1.0 / (1.0 + 0.3275911 * x.abs());
                let tail =
                    ((((1.061405429 * t - 1.453152027) * t + 1.421413741) * t - 0.284496736) * t
                        + 0.254829592)
                        * t
                        * (-x * x).exp();
                (1.0 - tail).copysign(x)
            };
            let found = mtf50(
                samples(|d| 100.0 + 50.0 * erf(d / sigma_m / 2f64.sqrt())),
                PIXEL_M,
            );
            let expected = (2f64.ln() / 2.0).sqrt() / (PI * sigma_m);
            let found = found.unwrap();
            assert!((found / expected - 1.0).abs() < 0.03, "{found} {expected}");
        }
    }

    /// A box of width w has `sinc(f w)`, which falls to half at `0.6034/w`.
    #[test]
    fn a_box_blur_has_its_mtf50() {
        for width_m in [0.008, 0.016] {
            let found = mtf50(samples(|d| (d / width_m).clamp(-0.5, 0.5)), PIXEL_M).unwrap();
            let expected = 0.6034 / width_m;
            assert!((found / expected - 1.0).abs() < 0.03, "{found} {expected}");
        }
    }

    #[test]
    fn too_few_pixels_have_no_mtf() {
        assert_eq!(mtf50([], PIXEL_M), None);
        assert_eq!(mtf50([(0.0, 1.0), (0.05, 2.0)], PIXEL_M), None);
    }
}
