//! Ridges of the temporal mean along the motion of the wall.

use super::motion_field::MotionField;
use super::temporal_statistics::TemporalStatistics;
use crate::frames::grey::GreyImage;
use rayon::prelude::*;
use tunnelstitch_geometry::numerics::median::{MAD_TO_SIGMA, median};

/// Smoothing (passes of `[1 2 1]/4` along both axes) and distance, pixels, of the differences:
/// strokes of letters, rims and dirt, larger dirt.
const SCALES: [(usize, f64); 3] = [(1, 4.0), (2, 8.0), (6, 14.0)];
/// Smallest root mean square motion along a direction, share of the width: the ridges of walls that
/// move less do not average out.
const MIN_MOTION: f64 = 0.02;
/// Smallest contrast of a ridge, in units of the frames' medians: weaker ones matter to nothing.
const MIN_CONTRAST: f32 = 0.04;

/// Smallest number of independent frames. With fewer, the wall looks alike from frame to frame,
/// because it repeats itself with the step of the camera, and cannot be told from an overlay.
const MIN_INDEPENDENT_FRAMES: f32 = 8.0;
/// Variance of a difference of two pixels over that of [`second_difference`], for white noise.
const DIFFERENCE_VARIANCE: f32 = 2.0 / 1.5;

/// Strength of each pixel's ridge, row-major: its contrast in standard deviations of the wall's; 0
/// where there is none. None if the wall looks alike from frame to frame.
///
/// With the smoothed temporal mean M, the unit vector û along the wall's motion and a distance r,
/// the differences are `a = M(p) − M(p − r û)` and `b = M(p) − M(p + r û)`, and the contrast
/// `min(|a|, |b|)` if a and b have the same sign: it is 0 on shading that grows to one side, beside
/// an overlay, and on structures of the wall that extend along the motion. The standard deviation
/// σ of a and b is `√(4/3)` of that of `(a + b)/2`, on which shading has no influence, robustly
/// over the picture. It holds what is left of the wall's repetitions and of the overlap of frames.
/// The number of independent frames is the variance of `(a + b)/2` in a frame over that in the
/// temporal mean.
///
/// Source of the empirical null distribution: B. Efron, "Large-scale simultaneous hypothesis
/// testing: the choice of a null hypothesis", Journal of the American Statistical Association
/// 99(465), 2004.
pub(super) fn ridge_strength(
    statistics: &TemporalStatistics,
    motion: &MotionField,
) -> Option<Vec<f32>> {
    let mut strength = vec![0.0f32; statistics.open.len()];
    let mut is_tested = false;
    for (passes, reach_px) in SCALES {
        let smooth = smoothed(&statistics.mean, passes);
        let samples: Vec<GreyImage> = statistics
            .samples
            .iter()
            .map(|sample| smoothed(sample, passes))
            .collect();
        for axis in 0..2 {
            let of = |image| differences(image, &statistics.open, motion, axis, reach_px);
            let pairs = of(&smooth);
            let mut sizes: Vec<f32> = pairs.iter().filter_map(second_difference).collect();
            sizes.iter_mut().for_each(|size| *size = size.abs());
            let sigma = MAD_TO_SIGMA as f32 * median(&mut sizes);
            let in_frames = samples.iter().map(|sample| mean_square(&of(sample)));
            let in_a_frame = in_frames.sum::<f32>() / samples.len() as f32;
            // Also false if there are no pixels, so that both are NaN.
            if in_a_frame >= MIN_INDEPENDENT_FRAMES * sigma * sigma {
                is_tested = true;
                let sigma = (DIFFERENCE_VARIANCE.sqrt() * sigma).max(f32::MIN_POSITIVE);
                keep_strongest(&mut strength, &pairs, sigma);
            }
        }
    }
    is_tested.then_some(strength)
}

/// Raises the strengths to those of the ridges of `pairs`.
fn keep_strongest(strength: &mut [f32], pairs: &[[f32; 2]], sigma: f32) {
    for (strongest, [a, b]) in strength.iter_mut().zip(pairs) {
        let contrast = a.abs().min(b.abs());
        if a * b > 0.0 && contrast >= MIN_CONTRAST {
            *strongest = strongest.max(contrast / sigma);
        }
    }
}

/// `(a + b)/2` of the differences to either side; None where one is not known.
fn second_difference([a, b]: &[f32; 2]) -> Option<f32> {
    let mean = 0.5 * (a + b);
    mean.is_finite().then_some(mean)
}

/// Mean square of the second differences; NaN of none.
fn mean_square(pairs: &[[f32; 2]]) -> f32 {
    let (mut sum, mut count) = (0.0f64, 0.0f64);
    for difference in pairs.iter().filter_map(second_difference) {
        sum += f64::from(difference).powi(2);
        count += 1.0;
    }
    (sum / count) as f32
}

/// Differences (a, b) of each pixel along the motion (axis 0) or across it (axis 1); NaN where the
/// wall does not move, is not shown, or the distance leaves the picture.
fn differences(
    smooth: &GreyImage,
    open: &[bool],
    motion: &MotionField,
    axis: usize,
    reach_px: f64,
) -> Vec<[f32; 2]> {
    let (width, height) = (smooth.width(), smooth.height());
    let share = |at: usize, size: usize| (at as f64 + 0.5) / size as f64;
    (0..width * height)
        .into_par_iter()
        .map(|k| {
            let (u, v) = (k % width, k / width);
            let cell = motion.at(share(u, width), share(v, height));
            let Some(cell) = cell.filter(|cell| open[k] && cell.rms[axis] >= MIN_MOTION) else {
                return [f32::NAN; 2];
            };
            let [along_u, along_v] = cell.direction;
            let [du, dv] = match axis {
                0 => [along_u, along_v],
                _ => [-along_v, along_u],
            }
            .map(|part| part * reach_px);
            let here = smooth.at(u, v);
            let (u, v) = (u as f64, v as f64);
            [
                here - bilinear(smooth, u - du, v - dv),
                here - bilinear(smooth, u + du, v + dv),
            ]
        })
        .collect()
}

/// Bilinear interpolation; NaN outside.
fn bilinear(image: &GreyImage, u: f64, v: f64) -> f32 {
    let within = |at: f64, size: usize| (0.0..=(size - 1) as f64).contains(&at);
    if !within(u, image.width()) || !within(v, image.height()) {
        return f32::NAN;
    }
    let (x, y) = (u as usize, v as usize);
    let (fx, fy) = ((u - x as f64) as f32, (v - y as f64) as f32);
    let (right, below) = (
        (x + 1).min(image.width() - 1),
        (y + 1).min(image.height() - 1),
    );
    let row = |y: usize| (1.0 - fx) * image.at(x, y) + fx * image.at(right, y);
    (1.0 - fy) * row(y) + fy * row(below)
}

/// Smooths by passes of `[1 2 1]/4` along both axes; borders repeat the outermost pixel.
pub(super) fn smoothed(image: &GreyImage, passes: usize) -> GreyImage {
    let (width, height) = (image.width(), image.height());
    let mut smooth = image.clone();
    for _ in 0..passes {
        let across: Vec<f32> = (0..width * height)
            .map(|k| {
                let (u, v) = (k % width, k / width);
                let (left, right) = (u.saturating_sub(1), (u + 1).min(width - 1));
                0.25 * (smooth.at(left, v) + smooth.at(right, v)) + 0.5 * smooth.at(u, v)
            })
            .collect();
        let at = |u: usize, v: usize| across[v * width + u];
        let data = (0..width * height).map(|k| {
            let (u, v) = (k % width, k / width);
            let (above, below) = (v.saturating_sub(1), (v + 1).min(height - 1));
            0.25 * (at(u, above) + at(u, below)) + 0.5 * at(u, v)
        });
        smooth = GreyImage::new(width, height, data.collect());
    }
    smooth
}
