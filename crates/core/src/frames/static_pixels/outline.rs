//! Outlines of overlays: growth from seeds, closing, holes.

use super::temporal_statistics::TemporalStatistics;
use image::{GrayImage, Luma, imageops};
use imageproc::distance_transform::Norm;
use imageproc::morphology::{close as close_gaps, dilate};
use imageproc::region_labelling::{Connectivity, connected_components};

/// Smallest strength of a ridge that an overlay begins with, standard deviations.
const MIN_SEED_STRENGTH: f32 = 7.0;
/// Smallest strength of a ridge that an overlay extends to.
const MIN_GROWN_STRENGTH: f32 = 4.0;
/// Smallest spread, multiples of the picture's median, of a text that changes and extends an
/// overlay: bright letters and dark outlines take turns with the wall.
const MIN_CHANGING_SPREAD: f32 = 3.0;
/// Smallest number of pixels of an overlay before it is closed.
const MIN_PIXELS: usize = 8;
/// Smallest number of its pixels that are seeds.
const MIN_SEEDS: usize = 3;
/// Distance across which gaps are closed, share of the width: that between the strokes of letters
/// and between lines.
const CLOSED_SHARE: f64 = 1.0 / 80.0;
/// Largest hole that is filled, share of the picture: the inside of letters and logos.
const MAX_HOLE_SHARE: f64 = 0.02;

/// Grows the pixels with strong ridges to their connected neighbours with weaker ones; 255 marks
/// what is found.
///
/// Source of the two thresholds: J. Canny, "A computational approach to edge detection", IEEE
/// Transactions on Pattern Analysis and Machine Intelligence 8(6), 1986.
pub(super) fn grow_seeds(strength: &[f32], statistics: &TemporalStatistics) -> GrayImage {
    let [width, height] = statistics.size();
    let changing = MIN_CHANGING_SPREAD * statistics.typical_spread();
    let spread = statistics.spread.data();
    let grown = picture([width, height], |k| {
        statistics.open[k] && (strength[k] >= MIN_GROWN_STRENGTH || spread[k] >= changing)
    });
    keep_regions(&grown, |pixels| {
        let is_seed = |k: &&usize| strength[**k] >= MIN_SEED_STRENGTH;
        pixels.len() >= MIN_PIXELS && pixels.iter().filter(is_seed).count() >= MIN_SEEDS
    })
}

/// Closes the gaps of what was found, fills small holes and adds a border of a pixel.
pub(super) fn close(found: &GrayImage) -> GrayImage {
    let (width, height) = found.dimensions();
    let reach = (CLOSED_SHARE * f64::from(width)).round().clamp(1.0, 255.0) as u8;
    // With a margin: beyond the border, closing would find nothing to erode with.
    let margin = u32::from(reach);
    let mut padded = GrayImage::new(width + 2 * margin, height + 2 * margin);
    imageops::replace(&mut padded, found, i64::from(margin), i64::from(margin));
    let closed = close_gaps(&padded, Norm::LInf, reach);
    let closed = imageops::crop_imm(&closed, margin, margin, width, height).to_image();
    let open = GrayImage::from_fn(width, height, |u, v| {
        Luma([255 - closed.get_pixel(u, v).0[0]])
    });
    let max_hole = MAX_HOLE_SHARE * f64::from(width) * f64::from(height);
    let wall = keep_regions(&open, |pixels| pixels.len() as f64 > max_hole);
    let filled = GrayImage::from_fn(width, height, |u, v| {
        Luma([255 - wall.get_pixel(u, v).0[0]])
    });
    dilate(&filled, Norm::LInf, 1)
}

/// A picture whose pixels are 255 where `is_marked`, else 0.
pub(super) fn picture(size: [usize; 2], is_marked: impl Fn(usize) -> bool) -> GrayImage {
    let [width, height] = size.map(|side| side as u32);
    GrayImage::from_fn(width, height, |u, v| {
        let marked = is_marked(v as usize * size[0] + u as usize);
        Luma([if marked { 255 } else { 0 }])
    })
}

/// The connected regions of a picture for whose pixels, row-major indices, `is_kept` holds.
pub(super) fn keep_regions(marked: &GrayImage, is_kept: impl Fn(&[usize]) -> bool) -> GrayImage {
    let labels = connected_components(marked, Connectivity::Eight, Luma([0]));
    let count = labels.iter().max().map_or(0, |most| *most as usize);
    let mut regions: Vec<Vec<usize>> = vec![Vec::new(); count + 1];
    for (k, label) in labels.iter().enumerate() {
        regions[*label as usize].push(k);
    }
    let mut kept = GrayImage::new(marked.width(), marked.height());
    let pixels: &mut [u8] = &mut kept;
    for region in regions.iter().skip(1).filter(|region| is_kept(region)) {
        for k in region {
            pixels[*k] = 255;
        }
    }
    kept
}
