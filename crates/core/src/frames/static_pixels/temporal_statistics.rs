//! Temporal mean and spread of the pixels over the frames.

use crate::frames::grey::GreyImage;
use crate::frames::mask::{Mask, PyramidMask};
use image::GrayImage;
use rayon::prelude::*;
use std::sync::Arc;
use tunnelstitch_geometry::numerics::median::median;

/// Largest width of the pictures on which static pixels are sought; wider ones are halved.
const MAX_WIDTH: usize = 480;
/// Share of the frames that is left out at either end of a pixel's sorted values.
const TRIMMED_SHARE: f64 = 0.1;
/// Smallest median of a frame, grey levels: darker ones show no wall.
const MIN_LEVEL: f32 = 4.0;
/// Largest number of frames that are kept as they are.
const MAX_SAMPLES: usize = 8;
/// Interquartile range of a Gaussian, multiples of σ.
const QUARTILES_TO_SIGMA: f32 = 1.349;

/// Mean and spread of each pixel over the frames, in units of the frames' medians.
#[derive(Debug)]
pub struct TemporalStatistics {
    full: [usize; 2],
    level: usize,
    frames: usize,
    /// Trimmed mean.
    pub(super) mean: GreyImage,
    /// Robust 1-σ of the values, with or without the frames' gains, whichever is smaller: what is
    /// burnt into the pictures has no gain, what the lens has in front of it has.
    pub(super) spread: GreyImage,
    /// A few of the frames, divided by their medians.
    pub(super) samples: Vec<GreyImage>,
    /// True for pixels that a mask does not hide yet.
    pub(super) open: Vec<bool>,
}

impl TemporalStatistics {
    /// Halves a frame until it is as small as the statistics are.
    pub fn reduce(frame: GreyImage) -> GreyImage {
        let halvings = 0..halvings(frame.width());
        halvings.fold(frame, |picture, _| picture.halved())
    }

    /// Computes the statistics of frames of the size `full`, each halved by
    /// [`TemporalStatistics::reduce`], in which clipped pixels have values; None of none that is
    /// bright enough. Pixels that `mask` hides are not open.
    ///
    /// With `I_t` a frame, `m_t` its median and `m` the median of these, the values of a pixel are
    /// `I_t/m_t` and, without the gain, `I_t/m`.
    pub fn new(
        full: [usize; 2],
        pictures: Vec<GreyImage>,
        mask: Option<&Arc<Mask>>,
    ) -> Option<Self> {
        let level = halvings(full[0]);
        let medians = pictures
            .par_iter()
            .map(|picture| median(&mut picture.data().to_vec()));
        let medians: Vec<f32> = medians.collect();
        let with_medians = pictures.into_iter().zip(medians);
        let lit: Vec<(GreyImage, f32)> = with_medians
            .filter(|(_, median)| *median >= MIN_LEVEL)
            .collect();
        let common = median(&mut lit.iter().map(|(_, level)| *level).collect::<Vec<_>>());
        let (width, height) = (lit.first()?.0.width(), lit[0].0.height());
        let values: Vec<[f32; 2]> = (0..width * height)
            .into_par_iter()
            .map_with([Vec::new(), Vec::new()], |[gained, raw], k| {
                let of = |scale: fn(f32, f32) -> f32, into: &mut Vec<f32>| {
                    into.clear();
                    into.extend(lit.iter().map(|(p, m)| p.data()[k] / scale(*m, common)));
                    into.sort_unstable_by(f32::total_cmp);
                };
                of(|own, _| own, gained);
                of(|_, common| common, raw);
                [trimmed_mean(gained), sigma(gained).min(sigma(raw))]
            })
            .collect();
        let step = lit.len().div_ceil(MAX_SAMPLES);
        let samples = lit.iter().step_by(step).map(|(picture, median)| {
            let data = picture.data().iter().map(|value| value / median);
            GreyImage::new(width, height, data.collect())
        });
        let samples = samples.collect();
        let image = |k: usize| GreyImage::new(width, height, values.iter().map(|v| v[k]).collect());
        let hidden = mask.map(|mask| PyramidMask::new(Arc::clone(mask)).halved(level));
        Some(Self {
            full,
            level,
            frames: lit.len(),
            mean: image(0),
            spread: image(1),
            samples,
            open: (0..width * height)
                .map(|k| {
                    hidden
                        .as_ref()
                        .is_none_or(|m| m.is_wall(k % width, k / width))
                })
                .collect(),
        })
    }

    /// Number of frames that are bright enough.
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Width and height of the statistics, pixels.
    pub(super) fn size(&self) -> [usize; 2] {
        [self.mean.width(), self.mean.height()]
    }

    /// Median of the pixels' spread.
    pub(super) fn typical_spread(&self) -> f32 {
        median(&mut self.spread.data().to_vec())
    }

    /// The mask of full-size pixels that hides those that are not 0 in `hidden`.
    pub(super) fn full_size_mask(&self, hidden: &GrayImage) -> Mask {
        let ([width, height], [w, h]) = (self.full, self.size());
        let wall: Vec<bool> = (0..width * height)
            .map(|k| {
                let u = ((k % width) >> self.level).min(w - 1);
                let v = ((k / width) >> self.level).min(h - 1);
                hidden.get_pixel(u as u32, v as u32).0[0] == 0
            })
            .collect();
        Mask::new(width, height, &wall)
    }
}

/// Number of halvings after which a picture is small enough.
fn halvings(width: usize) -> usize {
    let is_wide = |count: &usize| width >> count > MAX_WIDTH;
    (0..usize::BITS as usize).take_while(is_wide).count()
}

/// Mean without the smallest and the largest values; the values are sorted.
fn trimmed_mean(sorted: &[f32]) -> f32 {
    let trimmed = (TRIMMED_SHARE * sorted.len() as f64) as usize;
    let kept = &sorted[trimmed..sorted.len() - trimmed];
    kept.iter().sum::<f32>() / kept.len() as f32
}

/// Robust 1-σ of sorted values, from their interquartile range.
fn sigma(sorted: &[f32]) -> f32 {
    let quarter = sorted.len() / 4;
    (sorted[sorted.len() - 1 - quarter] - sorted[quarter]) / QUARTILES_TO_SIGMA
}
