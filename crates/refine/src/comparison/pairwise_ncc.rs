//! Normalised cross-correlation of overlapping frames: whether they show the same wall.
//!
//! Gauss–Newton ends in a minimum, which is not always the right one; neighbours may agree with
//! each other and not with the turn before. So once all frames are tracked, every pair that
//! overlaps is compared on the wall that both resolve alike: local contrast of the one against that
//! of the other. Pairs at right poses correlate as well as the texture allows, others do not, and a
//! low residual fused from several frames cannot hide it.

use crate::comparison::mosaic_grid::{MosaicGrid, pixel_size_m};
use crate::comparison::ncc_score::NccScore;
use crate::comparison::overlaps::{Batch, Overlaps};
use crate::comparison::unwrapped_frame::UnwrappedFrame;
use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::samples::viewpoint::{Viewpoint, is_resolved_alike};
use crate::thresholds::assessment::MIN_PIXEL_SHARE;
use crate::thresholds::pairwise_ncc::{
    COARSE_WINDOW_PX, FINE_LEVEL, FINE_WINDOW_PX, MIN_CORRELATION, MIN_SHARE_WITHOUT_OUTLIERS,
    STRIDE_PX,
};
use crate::tiles::residual_weighting::robust_correlation;
use nalgebra::Vector3;
use std::collections::{BTreeMap, BTreeSet};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::{Footprint, mean_radius_m};

/// The comparison of two frames where they overlap.
#[derive(Clone, Copy, Debug)]
pub struct PairNcc {
    /// The earlier frame.
    pub a: usize,
    /// The later one.
    pub b: usize,
    /// Wall samples that both show.
    pub samples: f64,
    /// True if they cannot show the same wall.
    pub contradicts: bool,
    /// Correlation of local contrast, corrected for noise.
    pub correlation: f64,
    /// The earlier frame's sharpness over the later one's; None where noise drowns fine detail.
    pub sharpness: Option<SharpnessRatio>,
}

/// The sharpness of a frame over that of another.
#[derive(Clone, Copy, Debug)]
pub struct SharpnessRatio {
    /// Ratio of the variances of their finest detail, gains removed.
    pub variance: f64,
    /// Ratio of the areas that the wall has in them, where they are compared.
    pub area: f64,
}

/// Compares those frames that are inliers and overlap: at pyramid level
/// `level`, in windows that hold a brick or two, and in finest detail.
///
/// The coarse comparison tells whether they show the same wall. The fine one is used only where
/// noise drowns the coarse one: of a repetitive wall it shows edges alone, and these coincide
/// wherever the pattern does, whatever is between them.
///
/// Two frames that do not show the same wall are compared once more without what stands out of it:
/// water is dark in one frame and glints in the other, and on a faint wall a few such patches in a
/// strip are all that is compared. The two contradict each other unless the wall between agrees. If
/// little of that is left, they neither agree nor contradict.
///
/// # Errors
/// [`ProblemError`].
pub fn compute_pairwise_ncc(
    context: &EstimationContext,
    level: usize,
    states: &FrameStates,
) -> Result<Vec<PairNcc>, ProblemError> {
    let any = |_, _| true;
    let coarse = Comparison {
        level,
        window_px: COARSE_WINDOW_PX,
        with_outliers: true,
    };
    let fine = Comparison {
        level: FINE_LEVEL.min(level),
        window_px: FINE_WINDOW_PX,
        with_outliers: true,
    };
    let of_coarse = compare_pairs(context, coarse, states, &any)?;
    let of_fine = by_pair(compare_pairs(context, fine, states, &any)?);
    let mut pairs: Vec<PairNcc> = of_coarse
        .into_iter()
        .filter_map(|coarse| {
            let fine = of_fine.get(&(coarse.a, coarse.b));
            let fine_correlation = fine.and_then(|fine| fine.correlation);
            let correlation = coarse.correlation.or(fine_correlation)?;
            Some(PairNcc {
                a: coarse.a,
                b: coarse.b,
                samples: coarse.samples,
                contradicts: correlation < MIN_CORRELATION,
                correlation,
                sharpness: fine_correlation.and(fine.map(|fine| fine.sharpness)),
            })
        })
        .collect();
    let contradicting = pairs.iter().filter(|pair| pair.contradicts);
    let contradicting: BTreeSet<(usize, usize)> =
        contradicting.map(|pair| (pair.a, pair.b)).collect();
    if contradicting.is_empty() {
        return Ok(pairs);
    }
    let without_outliers = Comparison {
        with_outliers: false,
        ..coarse
    };
    let again = |a, b| contradicting.contains(&(a, b));
    let compared = compare_pairs(context, without_outliers, states, &again)?;
    let compared = by_pair(compared);
    // Where little is left, and that agrees, the pair says nothing.
    pairs.retain_mut(|pair| match compared.get(&(pair.a, pair.b)) {
        Some(left) if left.correlation.is_some_and(|c| c >= MIN_CORRELATION) => {
            pair.contradicts = false;
            left.samples >= MIN_SHARE_WITHOUT_OUTLIERS * pair.samples
        }
        _ => true,
    });
    Ok(pairs)
}

fn by_pair(compared: Vec<Compared>) -> BTreeMap<(usize, usize), Compared> {
    let compared = compared.into_iter();
    compared.map(|one| ((one.a, one.b), one)).collect()
}

/// A way to compare frames.
#[derive(Clone, Copy, Debug)]
struct Comparison {
    /// Pyramid level.
    level: usize,
    /// Half width of the window of local contrast, pixels.
    window_px: usize,
    /// True to compare all that the frames show; false to leave out what stands out of the wall.
    with_outliers: bool,
}

/// The result of one comparison of two frames.
struct Compared {
    a: usize,
    b: usize,
    samples: f64,
    correlation: Option<f64>,
    sharpness: SharpnessRatio,
}

/// Compares the pairs for which `is_wanted` is true.
fn compare_pairs(
    context: &EstimationContext,
    comparison: Comparison,
    states: &FrameStates,
    is_wanted: &(dyn Fn(usize, usize) -> bool + Sync),
) -> Result<Vec<Compared>, ProblemError> {
    let Comparison {
        level,
        window_px,
        with_outliers,
    } = comparison;
    let cameras = context.cameras.at_level(level);
    let overlaps = Overlaps::of(context, &cameras, states)?;
    let mut pairs = Vec::new();
    let mut unwrapped_frames: BTreeMap<usize, UnwrappedFrame> = BTreeMap::new();
    for Batch { partners, needed } in overlaps.batches(is_wanted) {
        // Frames that the batch before has unwrapped are kept.
        unwrapped_frames.retain(|k, _| needed.binary_search(k).is_ok());
        let missing: Vec<usize> = needed
            .into_iter()
            .filter(|k| !unwrapped_frames.contains_key(k))
            .collect();
        let added: Vec<(usize, UnwrappedFrame)> = missing
            .par_map(|&k| {
                let sweep = states.sweep(context, k);
                let unwrapped = UnwrappedFrame::with_window(
                    context,
                    level,
                    k,
                    &sweep,
                    window_px,
                    with_outliers,
                )?;
                Ok((k, unwrapped))
            })
            .into_iter()
            .collect::<Result<_, ProblemError>>()?;
        unwrapped_frames.extend(added);
        let frames = PosedFrames {
            context,
            states,
            footprints: &overlaps.footprints,
            unwrapped_frames: &unwrapped_frames,
        };
        let compared: Vec<Vec<Compared>> =
            partners.par_map(|(a, partners)| frames.compare_with_partners(*a, partners));
        pairs.extend(compared.into_iter().flatten());
    }
    Ok(pairs)
}

/// Unwrapped frames at their present poses.
struct PosedFrames<'a> {
    context: &'a EstimationContext<'a>,
    states: &'a FrameStates,
    footprints: &'a [Option<Footprint>],
    unwrapped_frames: &'a BTreeMap<usize, UnwrappedFrame>,
}

impl PosedFrames<'_> {
    /// The viewpoint of a frame; wall points will be given relative to `origin`.
    fn viewpoint(&self, frame: usize, origin: &Vector3<f64>) -> Viewpoint {
        let radius_m = mean_radius_m(self.context.surface.as_ref());
        Viewpoint::new(&self.states.estimates[frame].pose, origin, radius_m)
    }

    /// Compares frame `a` with its partners.
    fn compare_with_partners(&self, a: usize, partners: &[usize]) -> Vec<Compared> {
        let context = self.context;
        let (Some(own), Some(footprint)) = (self.unwrapped_frames.get(&a), &self.footprints[a])
        else {
            return Vec::new();
        };
        let pose = &self.states.estimates[a].pose;
        let pixel_size_m = pixel_size_m(context, own.camera(), pose);
        let grid = MosaicGrid::over(footprint, STRIDE_PX * pixel_size_m);
        let points = grid.world_points(context);
        let origin = points[points.len() / 2];
        let normals = grid.column_normals(context);
        let sampler = own.sampler_at(context, pose, &origin);
        let viewpoint = self.viewpoint(a, &origin);
        let samples: Vec<Sample> = points
            .iter()
            .enumerate()
            .filter(|(k, _)| !context.ignored.contains(&grid.wall_point(*k)))
            .filter_map(|(k, x_w)| {
                let point = (x_w - origin).cast().into();
                let own = sampler.contrast_and_detail(&point)?;
                let normal = normals[k % grid.columns];
                Some(Sample {
                    point,
                    normal,
                    area_share: viewpoint.area_share(&point, &normal),
                    own,
                })
            })
            .collect();
        let compare = |b: &usize| self.compare(a, *b, &origin, &samples);
        partners.iter().filter_map(compare).collect()
    }

    /// Compares the samples of frame `a` with frame `b`; None if too few of them are shared.
    fn compare(
        &self,
        a: usize,
        b: usize,
        origin: &Vector3<f64>,
        samples: &[Sample],
    ) -> Option<Compared> {
        let unwrapped = self.unwrapped_frames.get(&b)?;
        let pose = &self.states.estimates[b].pose;
        let sampler = unwrapped.sampler_at(self.context, pose, origin);
        let viewpoint = self.viewpoint(b, origin);
        let mut ncc_score = NccScore::default();
        let (mut own_detail, mut other_detail) = (0.0f64, 0.0f64);
        let (mut own_area, mut other_area) = (0.0f64, 0.0f64);
        let mut shared = Vec::with_capacity(samples.len());
        for sample in samples {
            let area_share = viewpoint.area_share(&sample.point, &sample.normal);
            if !is_resolved_alike(sample.area_share, area_share) {
                continue;
            }
            if let Some((y, noise_y, other)) = sampler.contrast_and_detail(&sample.point) {
                let (x, noise_x, own) = sample.own;
                ncc_score.add((x, noise_x), (y, noise_y));
                shared.push((x, y));
                own_detail += f64::from(own).powi(2);
                other_detail += f64::from(other).powi(2);
                own_area += f64::from(sample.area_share);
                other_area += f64::from(area_share);
            }
        }
        let gain = |k: usize| self.states.estimates[k].log_gain.exp();
        let gain_ratio = gain(b) / gain(a);
        let min_samples = MIN_PIXEL_SHARE * samples.len() as f64;
        (ncc_score.samples >= min_samples).then(|| Compared {
            a,
            b,
            samples: ncc_score.samples,
            correlation: robust_corrected_correlation(&ncc_score, &shared),
            sharpness: SharpnessRatio {
                variance: gain_ratio * gain_ratio * own_detail
                    / other_detail.max(f64::MIN_POSITIVE),
                area: own_area / other_area,
            },
        })
    }
}

/// A wall point that a frame shows.
struct Sample {
    /// The point relative to the origin, metres.
    point: [f32; 3],
    /// The unit normal of the wall.
    normal: Vector3<f32>,
    /// Area in the frame, over that seen squarely from the axis ([`Viewpoint::area_share`]).
    area_share: f32,
    /// Local contrast in the frame, the variance of its noise, and fine detail.
    own: (f32, f32, f32),
}

/// The correlation corrected for noise, of all samples or of most, whichever is greater: a few
/// glints outweigh a faint wall.
fn robust_corrected_correlation(ncc_score: &NccScore, shared: &[(f32, f32)]) -> Option<f64> {
    let of_all = ncc_score.corrected_correlation()?;
    let of_most = robust_correlation(shared) / ncc_score.texture_share();
    Some(of_all.max(of_most.min(1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scene::{bricks, displaced_by_a_brick, faint_wall_with_glints, with_context};
    use tunnelstitch_core::frames::GreyImage;
    use tunnelstitch_core::test_wall::TestWall;
    use tunnelstitch_geometry::trajectory::Pose;

    /// Compares these frames at these poses.
    fn compare_frames(wall: &TestWall, pictures: Vec<GreyImage>, poses: &[Pose]) -> Vec<PairNcc> {
        with_context(wall, pictures, poses, |context, states| {
            compute_pairwise_ncc(context, 0, states).unwrap()
        })
    }

    #[test]
    fn frames_at_true_poses_correlate() {
        let wall = TestWall::ring(bricks);
        let pairs = compare_frames(&wall, wall.frames(), &wall.poses);
        assert!(pairs.len() >= 14);
        for pair in pairs {
            assert!(!pair.contradicts && pair.correlation > 0.8, "{pair:?}");
        }
    }

    /// All joints lie on joints.
    #[test]
    fn frame_displaced_by_a_brick_contradicts_the_others() {
        let wall = TestWall::ring(bricks);
        let poses = displaced_by_a_brick(&wall.poses, 5);
        let pairs = compare_frames(&wall, wall.frames(), &poses);
        assert!(pairs.iter().filter(|p| p.a == 5 || p.b == 5).count() >= 2);
        for pair in pairs {
            assert_eq!(pair.contradicts, pair.a == 5 || pair.b == 5, "{pair:?}");
        }
    }

    /// Dark in some frames and bright in others, with the wall between as it is.
    #[test]
    fn glints_and_water_do_not_contradict() {
        let (wall, pictures) = faint_wall_with_glints();
        let pairs = compare_frames(&wall, pictures, &wall.poses);
        // Of a strip hardly wider than a glint nothing is left to compare.
        let long_strips = || pairs.iter().filter(|pair| pair.samples > 80.0);
        assert!(long_strips().any(|pair| pair.correlation < MIN_CORRELATION));
        for pair in long_strips() {
            assert!(!pair.contradicts, "{pair:?}");
        }
    }
}
