//! Structural similarity.

use image::{ImageBuffer, Luma};
use imageproc::filter::separable_filter_equal;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// Half the side of the 11 × 11 window, pixels.
const RADIUS: usize = 5;

/// Standard deviation of the window's Gaussian, pixels.
const SIGMA: f32 = 1.5;

/// Number of rows processed at a time, which bounds the memory of the filtered copies.
const BAND_ROWS: usize = 256;

/// Sums SSIM over the pixels whose whole window is in `valid`; returns the sum and their number.
///
/// `SSIM = (2 μ_a μ_b + C1)(2 σ_ab + C2) / ((μ_a² + μ_b² + C1)(σ_a² + σ_b² + C2))` with means,
/// variances and covariance under an 11 × 11 Gaussian of σ = 1.5 px, `C1 = (0.01 L)²`,
/// `C2 = (0.03 L)²`, `L = 255`. `a`, `b`, `valid`: row-major, `width` pixels a row.
///
/// Source: Wang, Bovik, Sheikh, Simoncelli, "Image quality assessment: from error visibility to
/// structural similarity", 2004.
pub(super) fn sum_of_ssim(a: &[f32], b: &[f32], valid: &[bool], width: usize) -> (f64, usize) {
    let height = a.len() / width;
    if width <= 2 * RADIUS || height <= 2 * RADIUS {
        return (0.0, 0);
    }
    let starts: Vec<usize> = (RADIUS..height - RADIUS).step_by(BAND_ROWS).collect();
    // Collected before they are added: the sum does not depend on the threads.
    let parts: Vec<(f64, usize)> = starts.par_map(|start| {
        let end = (start + BAND_ROWS).min(height - RADIUS);
        let rows = (start - RADIUS) * width..(end + RADIUS) * width;
        sum_over_band(&a[rows.clone()], &b[rows.clone()], &valid[rows], width)
    });
    parts
        .iter()
        .fold((0.0, 0), |sum, part| (sum.0 + part.0, sum.1 + part.1))
}

/// Sums SSIM over the rows of a band, except the outermost [`RADIUS`] on either side.
fn sum_over_band(a: &[f32], b: &[f32], valid: &[bool], width: usize) -> (f64, usize) {
    let height = a.len() / width;
    let blurred = |value: &dyn Fn(usize) -> f32| -> Vec<f32> {
        let data: Vec<f32> = (0..a.len()).map(value).collect();
        // The buffer holds width · height values by construction.
        match ImageBuffer::<Luma<f32>, _>::from_raw(width as u32, height as u32, data) {
            Some(image) => separable_filter_equal(&image, &window()).into_raw(),
            None => Vec::new(),
        }
    };
    let (mean_a, mean_b) = (blurred(&|k| a[k]), blurred(&|k| b[k]));
    let (mean_aa, mean_bb) = (blurred(&|k| a[k] * a[k]), blurred(&|k| b[k] * b[k]));
    let mean_ab = blurred(&|k| a[k] * b[k]);
    let whole = eroded(valid, width);
    let (c1, c2) = ((0.01f64 * 255.0).powi(2), (0.03f64 * 255.0).powi(2));
    let (mut sum, mut count) = (0.0, 0);
    for y in RADIUS..height - RADIUS {
        for x in RADIUS..width - RADIUS {
            let k = y * width + x;
            if !whole[k] {
                continue;
            }
            let (mu_a, mu_b) = (f64::from(mean_a[k]), f64::from(mean_b[k]));
            let var_a = (f64::from(mean_aa[k]) - mu_a * mu_a).max(0.0);
            let var_b = (f64::from(mean_bb[k]) - mu_b * mu_b).max(0.0);
            let covariance = f64::from(mean_ab[k]) - mu_a * mu_b;
            sum += (2.0 * mu_a * mu_b + c1) * (2.0 * covariance + c2)
                / ((mu_a * mu_a + mu_b * mu_b + c1) * (var_a + var_b + c2));
            count += 1;
        }
    }
    (sum, count)
}

/// The 11 weights of the Gaussian, which sum to 1.
fn window() -> [f32; 2 * RADIUS + 1] {
    let mut weights = [0.0; 2 * RADIUS + 1];
    for (k, weight) in weights.iter_mut().enumerate() {
        let x = k as f32 - RADIUS as f32;
        *weight = (-x * x / (2.0 * SIGMA * SIGMA)).exp();
    }
    let sum: f32 = weights.iter().sum();
    weights.map(|weight| weight / sum)
}

/// Mask of the pixels whose whole window is valid; windows beyond the border are not.
fn eroded(valid: &[bool], width: usize) -> Vec<bool> {
    let edge = 2 * RADIUS + 1;
    let height = valid.len() / width;
    // Lengths of the runs of valid pixels that end here, first along the row, then down the column.
    let mut run_x = vec![0usize; valid.len()];
    let mut run_y = vec![0usize; valid.len()];
    let mut whole = vec![false; valid.len()];
    for y in 0..height {
        for x in 0..width {
            let k = y * width + x;
            if valid[k] {
                run_x[k] = 1 + if x > 0 { run_x[k - 1] } else { 0 };
            }
            if run_x[k] >= edge {
                run_y[k] = 1 + if y > 0 { run_y[k - width] } else { 0 };
            }
            if run_y[k] >= edge {
                whole[k - RADIUS * width - RADIUS] = true;
            }
        }
    }
    whole
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pattern(width: usize, height: usize, phase: f32) -> Vec<f32> {
        (0..width * height)
            .map(|k| {
                let (x, y) = ((k % width) as f32, (k / width) as f32);
                128.0 + 60.0 * (0.4 * x + phase).sin() * (0.3 * y - phase).cos()
            })
            .collect()
    }

    /// Evaluates the formula with an explicit 11 × 11 sum, two-pass, in f64.
    fn ssim_at(a: &[f32], b: &[f32], width: usize, x: usize, y: usize) -> f64 {
        let mut samples = Vec::new();
        for j in 0..11 {
            for i in 0..11 {
                let (dx, dy) = (i as f64 - 5.0, j as f64 - 5.0);
                let w = (-(dx * dx + dy * dy) / (2.0 * 1.5 * 1.5)).exp();
                let k = (y + j - 5) * width + x + i - 5;
                samples.push((w, f64::from(a[k]), f64::from(b[k])));
            }
        }
        let total: f64 = samples.iter().map(|s| s.0).sum();
        let mean = |f: &dyn Fn(f64, f64) -> f64| {
            samples.iter().map(|s| s.0 * f(s.1, s.2)).sum::<f64>() / total
        };
        let (ma, mb) = (mean(&|a, _| a), mean(&|_, b| b));
        let va = mean(&|a, _| (a - ma) * (a - ma));
        let vb = mean(&|_, b| (b - mb) * (b - mb));
        let cov = mean(&|a, b| (a - ma) * (b - mb));
        (2.0 * ma * mb + 6.5025) * (2.0 * cov + 58.5225)
            / ((ma * ma + mb * mb + 6.5025) * (va + vb + 58.5225))
    }

    #[test]
    fn filters_agree_with_the_explicit_sum() {
        let (width, height) = (40, 300);
        let (a, b) = (pattern(width, height, 0.0), pattern(width, height, 0.7));
        let (sum, count) = sum_of_ssim(&a, &b, &vec![true; a.len()], width);
        assert_eq!(count, (width - 10) * (height - 10));
        let mut expected = 0.0;
        for y in 5..height - 5 {
            for x in 5..width - 5 {
                expected += ssim_at(&a, &b, width, x, y);
            }
        }
        let (mean, expected) = (sum / count as f64, expected / count as f64);
        assert!((mean - expected).abs() < 1e-4, "{mean} {expected}");
        assert!(mean < 0.95);
    }

    #[test]
    fn windows_that_touch_a_hole_do_not_count() {
        let (width, height) = (30, 30);
        let a = pattern(width, height, 0.0);
        let mut b = a.clone();
        let mut valid = vec![true; a.len()];
        let hole = 15 * width + 15;
        b[hole] = 0.0;
        valid[hole] = false;
        let (sum, count) = sum_of_ssim(&a, &b, &valid, width);
        assert_eq!(count, 20 * 20 - 11 * 11);
        assert!((sum / count as f64 - 1.0).abs() < 1e-6);
    }
}
