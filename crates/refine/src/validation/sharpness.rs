//! Sharpness of overlapping frames against each other: the fine detail that one shows of the wall
//! over that which the other shows.

use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::thresholds::assessment::MIN_PIXEL_SHARE;
use crate::thresholds::blurred_frames::WINDOW_PX;
use crate::thresholds::pairwise_lucas_kanade::{LEVEL, STRIDE_PX};
use crate::tracking::mosaic_grid::{MosaicGrid, pixel_size_m};
use crate::tracking::ncc_score::NccScore;
use crate::tracking::unwrapped_frame::UnwrappedFrame;
use crate::validation::overlaps::{Batch, Overlaps};
use nalgebra::Vector3;
use std::collections::BTreeMap;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// The sharpness of two frames where they overlap.
#[derive(Clone, Copy, Debug)]
pub struct SharpnessRatio {
    /// The earlier frame.
    pub a: usize,
    /// The later one.
    pub b: usize,
    /// Variance of the earlier frame's fine detail over the later one's, gains removed.
    pub ratio: f64,
}

/// Compares the sharpness of all inliers that overlap, at a fine pyramid level, with at most
/// `finest` levels above it; pairs of which noise drowns the detail are left out.
///
/// # Errors
/// [`ProblemError`].
pub fn compare_sharpness(
    context: &EstimationContext,
    finest: usize,
    states: &FrameStates,
) -> Result<Vec<SharpnessRatio>, ProblemError> {
    let level = LEVEL.min(finest);
    let camera = context.camera.at_level(level);
    let overlaps = Overlaps::of(context, &camera, states, &(0..states.estimates.len()))?;
    let mut ratios = Vec::new();
    let mut unwrapped_frames: BTreeMap<usize, UnwrappedFrame> = BTreeMap::new();
    for Batch { partners, needed } in overlaps.batches() {
        // Frames that the batch before has unwrapped are kept.
        unwrapped_frames.retain(|k, _| needed.binary_search(k).is_ok());
        let missing: Vec<usize> = needed
            .into_iter()
            .filter(|k| !unwrapped_frames.contains_key(k))
            .collect();
        let added: Vec<(usize, UnwrappedFrame)> = missing
            .par_map(|&k| {
                let sweep = states.sweep(context, k);
                let unwrapped = UnwrappedFrame::with_window(context, level, k, &sweep, WINDOW_PX)?;
                Ok((k, unwrapped))
            })
            .into_iter()
            .collect::<Result<_, ProblemError>>()?;
        unwrapped_frames.extend(added);
        let frames = PosedFrames {
            context,
            states,
            overlaps: &overlaps,
            unwrapped_frames: &unwrapped_frames,
        };
        let compared: Vec<Vec<SharpnessRatio>> =
            partners.par_map(|(a, partners)| frames.compare_with_partners(*a, partners));
        ratios.extend(compared.into_iter().flatten());
    }
    Ok(ratios)
}

/// Unwrapped frames at their present poses.
struct PosedFrames<'a> {
    context: &'a EstimationContext<'a>,
    states: &'a FrameStates,
    overlaps: &'a Overlaps,
    unwrapped_frames: &'a BTreeMap<usize, UnwrappedFrame>,
}

impl PosedFrames<'_> {
    /// Compares frame `a` with its partners.
    fn compare_with_partners(&self, a: usize, partners: &[usize]) -> Vec<SharpnessRatio> {
        let context = self.context;
        let (Some(own), Some(footprint)) =
            (self.unwrapped_frames.get(&a), &self.overlaps.footprints[a])
        else {
            return Vec::new();
        };
        let pose = &self.states.estimates[a].pose;
        let pixel_size_m = pixel_size_m(context, own.camera(), pose);
        let grid = MosaicGrid::over(footprint, STRIDE_PX * pixel_size_m);
        let points = grid.world_points(context);
        let origin = points[points.len() / 2];
        let sampler = own.sampler_at(context, pose, &origin);
        let samples: Vec<Sample> = points
            .iter()
            .enumerate()
            .filter(|(k, _)| !context.ignored.contains(&grid.wall_point(*k)))
            .filter_map(|(_, x_w)| {
                let offset = x_w - origin;
                let point = [offset.x as f32, offset.y as f32, offset.z as f32];
                Some((point, sampler.contrast_and_detail(&point)?))
            })
            .collect();
        let compare = |b: &usize| {
            let ratio = self.compare(a, *b, &origin, &samples)?;
            Some(SharpnessRatio { a, b: *b, ratio })
        };
        partners.iter().filter_map(compare).collect()
    }

    /// The ratio of the samples of frame `a` to frame `b`; None if too few of them are shared, or
    /// too noisy.
    fn compare(
        &self,
        a: usize,
        b: usize,
        origin: &Vector3<f64>,
        samples: &[Sample],
    ) -> Option<f64> {
        let unwrapped = self.unwrapped_frames.get(&b)?;
        let pose = &self.states.estimates[b].pose;
        let sampler = unwrapped.sampler_at(self.context, pose, origin);
        let mut ncc_score = NccScore::default();
        let (mut own_detail, mut other_detail) = (0.0f64, 0.0f64);
        for (point, (x, noise_x, own)) in samples {
            if let Some((y, noise_y, other)) = sampler.contrast_and_detail(point) {
                ncc_score.add((*x, *noise_x), (y, noise_y));
                own_detail += f64::from(*own).powi(2);
                other_detail += f64::from(other).powi(2);
            }
        }
        let min_samples = MIN_PIXEL_SHARE * samples.len() as f64;
        if ncc_score.samples < min_samples || !ncc_score.shows_texture() {
            return None;
        }
        let gain = |k: usize| self.states.estimates[k].log_gain.exp();
        let gain_ratio = gain(b) / gain(a);
        Some(gain_ratio * gain_ratio * own_detail / other_detail.max(f64::MIN_POSITIVE))
    }
}

/// A wall point relative to the origin, with local contrast, the variance of its noise, and fine
/// detail.
type Sample = ([f32; 3], (f32, f32, f32));

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scene::{bricks, frame_states, independent_prior, test_context};
    use crate::validation::blurred_frames::find_blurred_frames;
    use tunnelstitch_core::frames::{FrameCache, GreyImage, Pyramid};
    use tunnelstitch_core::test_wall::TestWall;

    /// The mean of each pixel's 7 × 7 surroundings.
    fn blurred(image: &GreyImage) -> GreyImage {
        let (w, h) = (image.width(), image.height());
        let near = |k: usize, end: usize| k.saturating_sub(3)..(k + 4).min(end);
        let mean = |k: usize| {
            let (x, y) = (k % w, k / w);
            let rows = near(y, h).flat_map(|y| near(x, w).map(move |x| image.data()[y * w + x]));
            let values: Vec<f32> = rows.collect();
            values.iter().sum::<f32>() / values.len() as f32
        };
        GreyImage::new(w, h, (0..w * h).map(mean).collect())
    }

    #[test]
    fn a_blurred_frame_has_less_detail_than_those_it_overlaps() {
        let wall = TestWall::ring(bricks);
        let mut pictures = wall.frames();
        pictures[5] = blurred(&pictures[5]);
        let pyramids = pictures.into_iter().map(|frame| Pyramid::new(frame, 1));
        let frames = FrameCache::of_pyramids(pyramids.collect());
        let prior = independent_prior(&wall.poses);
        let context = test_context(&wall, &frames, &prior);
        let ratios = compare_sharpness(&context, 0, &frame_states(&wall.poses)).unwrap();
        assert!(ratios.len() >= 14);
        let found = find_blurred_frames(&ratios, wall.poses.len());
        let found: Vec<usize> = found.into_iter().map(|(frame, _)| frame).collect();
        assert_eq!(found, [5], "{ratios:#?}");
    }
}
