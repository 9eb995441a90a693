//! Areas whose values do not change while the wall moves, within sharp edges.

use super::outline::{keep_regions, picture};
use super::ridges::smoothed;
use super::temporal_statistics::TemporalStatistics;
use image::GrayImage;
use imageproc::distance_transform::Norm;
use imageproc::morphology::{dilate, open};
use tunnelstitch_geometry::numerics::median::{MAD_TO_SIGMA, median};

/// Largest spread of a constant pixel, multiple of the picture's median.
const MAX_SPREAD: f32 = 0.3;
/// Half the smallest width of an area, pixels; a joint of the wall that is always at the same row
/// is thinner.
const HALF_WIDTH_PX: u8 = 3;
/// Smallest number of an area's pixels.
const MIN_PIXELS: usize = 60;
/// Smallest share of an area's border that is a sharp edge: shading has none.
const MIN_EDGE_SHARE: f64 = 0.6;
/// Distance of pixels whose difference is the slope at an edge, to either side.
const EDGE_REACH: usize = 2;
/// Smallest slope at an edge: standard deviations of all slopes, and in units of the frames'
/// medians.
const MIN_EDGE: (f32, f32) = (4.0, 0.06);
/// Distance from an area's border within which an edge is sought, pixels.
const EDGE_DISTANCE_PX: u8 = 3;

/// Finds the areas, such as parts of the carrier, black bars and corners; 255 marks them.
///
/// Beside a sharp edge only: at the middle of frames on a smooth wall, values hardly change either.
pub(super) fn constant_areas(statistics: &TemporalStatistics) -> GrayImage {
    let size = statistics.size();
    let [width, height] = size;
    let max_spread = MAX_SPREAD * statistics.typical_spread();
    let spread = statistics.spread.data();
    let constant = picture(size, |k| statistics.open[k] && spread[k] <= max_spread);
    let constant = open(&constant, Norm::LInf, HALF_WIDTH_PX);
    let edges = dilate(&edges(statistics), Norm::LInf, EDGE_DISTANCE_PX);
    let (constant_pixels, edge_pixels): (&[u8], &[u8]) = (&constant, &edges);
    keep_regions(&constant, |pixels| {
        let is_border = |k: &&usize| {
            let (u, v) = (**k % width, **k / width);
            let inside = (1..width - 1).contains(&u) && (1..height - 1).contains(&v);
            inside
                && [**k - 1, **k + 1, **k - width, **k + width]
                    .iter()
                    .any(|n| constant_pixels[*n] == 0)
        };
        let border: Vec<&usize> = pixels.iter().filter(is_border).collect();
        let sharp = border.iter().filter(|k| edge_pixels[***k] > 0).count();
        pixels.len() >= MIN_PIXELS
            && !border.is_empty()
            && sharp as f64 >= MIN_EDGE_SHARE * border.len() as f64
    })
}

/// Pixels at sharp edges of the temporal mean.
fn edges(statistics: &TemporalStatistics) -> GrayImage {
    let size = statistics.size();
    let [width, height] = size;
    let mean = smoothed(&statistics.mean, 1);
    let slopes: Vec<f32> = (0..width * height)
        .map(|k| {
            let (u, v) = (k % width, k / width);
            let before = |at: usize| at.saturating_sub(EDGE_REACH);
            let after = |at: usize, size: usize| (at + EDGE_REACH).min(size - 1);
            let across = mean.at(after(u, width), v) - mean.at(before(u), v);
            across.hypot(mean.at(u, after(v, height)) - mean.at(u, before(v)))
        })
        .collect();
    let sigma = MAD_TO_SIGMA as f32 * median(&mut slopes.clone());
    let min_slope = (MIN_EDGE.0 * sigma).max(MIN_EDGE.1);
    picture(size, |k| slopes[k] >= min_slope)
}
