//! Pairwise Lucas–Kanade registration: how far two overlapping frames are displaced against each
//! other, and with which uncertainty.
//!
//! Gauss–Newton compares each frame with the wall fused from all. Where the trajectory is bent,
//! that wall is blurred, the robust loss rejects what does not fit, and every residual looks small.
//! A pair of frames shows its displacement: an affine field
//!
//! `d(x) = P (1, s, h)ᵀ`,   P: 2 × 3,
//!
//! that minimises `Σ q ω (a I_a(x) + b − I_b(x + d(x)))²` at a fine pyramid level, with the
//! exposure a, b, the biweight ω of [`crate::tiles::residual_weighting::Loss`] for what is not
//! wall, and the pixels q of a sample in the frame that resolves less of it. With N the normal
//! matrix, corrected for the noise in its slopes, and v the variance of the residuals, P has the
//! covariance `v N⁻¹` if they are noise. Glints are not: steeper than a faint wall, they move
//! with the camera. So the influence of every sample is bounded to that of one a few times as
//! steep as the median. With g the contributions of n patches of samples to the gradient, the
//! covariance is `C = n/(n − 8) N⁻¹ (Σ g gᵀ) N⁻¹` where that makes σ larger, whatever the
//! residuals are like.
//!
//! The root mean square of the displacement over the overlap is `e = √(pᵀWp)`, to which errors
//! alone contribute `σ = √tr(C W)`. By the triangle inequality, frames that are aligned to τ show
//! `e > τ + t σ` no more often than Student's variable of n − 8 degrees of freedom exceeds t.
//!
//! Source: J. G. MacKinnon and H. White, "Some heteroskedasticity-consistent covariance matrix
//! estimators with improved finite sample properties", Journal of Econometrics 29(3), 1985 (the
//! factor); B. D. Lucas and T. Kanade, "An iterative image registration technique with an
//! application to stereo vision", 1981.

use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::thresholds::pairwise_lucas_kanade::LEVEL;
use crate::validation::alignment::Alignment;
use crate::validation::lucas_kanade_template::{PosedImage, Template};
use crate::validation::overlaps::{Batch, Overlaps};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;
use tunnelstitch_core::frames::Pyramid;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// Measures the displacements of those of some consecutive frames that are inliers and overlap;
/// `finest`: the finest level of tracking.
///
/// # Errors
/// [`ProblemError`].
pub fn align_pairs(
    context: &EstimationContext,
    finest: usize,
    states: &FrameStates,
    frame_range: &Range<usize>,
) -> Result<Vec<Alignment>, ProblemError> {
    let level = LEVEL.min(finest);
    let cameras = context.cameras.at_level(level);
    let overlaps = Overlaps::of(context, &cameras, states, frame_range)?;
    let mut alignments = Vec::new();
    for Batch { partners, needed } in overlaps.batches(|_, _| true) {
        let pyramids: BTreeMap<usize, Arc<Pyramid>> = needed
            .par_map(|&k| Ok((k, context.frames.get(k)?)))
            .into_iter()
            .collect::<Result<_, ProblemError>>()?;
        let of_batch: Vec<Vec<Alignment>> = partners.par_map(|(a, partners)| {
            let image = |k: usize| PosedImage {
                context,
                level,
                camera: cameras.of(k).with_sweep(&states.sweep(context, k)),
                pyramid: &pyramids[&k],
                pose: &states.estimates[k].pose,
            };
            let Some(footprint) = &overlaps.footprints[*a] else {
                return Vec::new();
            };
            let template = Template::new(&image(*a), footprint);
            let align = |b: &usize| {
                let mut alignment = template.align(&image(*b))?;
                (alignment.a, alignment.b) = (*a, *b);
                Some(alignment)
            };
            partners.iter().filter_map(align).collect()
        });
        alignments.extend(of_batch.into_iter().flatten());
    }
    Ok(alignments)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::RefineOptions;
    use crate::test_scene::{bricks, displaced_by_a_brick, faint_wall_with_glints, with_context};
    use crate::validation::inconsistent_frames::find_inconsistent_frames;
    use tunnelstitch_core::frames::GreyImage;
    use tunnelstitch_core::test_wall::{TestWall, waves};
    use tunnelstitch_geometry::trajectory::Pose;

    /// Alignments of these pictures at the given poses.
    fn align(wall: &TestWall, pictures: Vec<GreyImage>, poses: &[Pose]) -> Vec<Alignment> {
        let all = 0..poses.len();
        with_context(wall, pictures, poses, |context, states| {
            align_pairs(context, 0, states, &all).unwrap()
        })
    }

    #[track_caller]
    fn assert_inconsistent(alignments: &[Alignment], frames: usize, expected: &[usize]) {
        let found = find_inconsistent_frames(alignments, &[], frames, &RefineOptions::default());
        let found: Vec<usize> = found.into_iter().map(|(frame, _)| frame).collect();
        assert_eq!(found, expected, "{alignments:#?}");
    }

    #[test]
    fn frames_at_true_poses_are_aligned() {
        let wall = TestWall::ring(waves);
        let found = align(&wall, wall.frames(), &wall.poses);
        assert!(found.len() >= 14);
        for pair in found {
            assert!(pair.error_px < 0.05, "{pair:?}");
        }
    }

    #[test]
    fn frames_of_bricks_at_true_poses_are_consistent() {
        let wall = TestWall::ring(bricks);
        let found = align(&wall, wall.frames(), &wall.poses);
        assert!(
            found.iter().all(|pair| pair.correlation > 0.8),
            "{found:#?}"
        );
        assert_inconsistent(&found, wall.poses.len(), &[]);
    }

    /// All joints lie on joints.
    #[test]
    fn frame_displaced_by_a_brick_is_found() {
        let wall = TestWall::ring(bricks);
        let poses = displaced_by_a_brick(&wall.poses, 5);
        let found = align(&wall, wall.frames(), &poses);
        assert_inconsistent(&found, poses.len(), &[5]);
    }

    /// Dark in some frames and bright in others, with the wall between as it is.
    #[test]
    fn glints_and_water_do_not_displace() {
        let (wall, pictures) = faint_wall_with_glints();
        let found = align(&wall, pictures, &wall.poses);
        assert_inconsistent(&found, wall.poses.len(), &[]);
    }

    /// A frame shifted along the tunnel by 10 mm is 1 cm · f / 1 m ≈ 1 px off all it overlaps.
    #[test]
    fn displacement_of_a_frame_is_measured() {
        let wall = TestWall::ring(waves);
        let mut poses = wall.poses.clone();
        poses[5].t_wc.y += 0.01;
        let expected = 0.01 * wall.camera.fy;
        let mut seen = 0;
        for pair in align(&wall, wall.frames(), &poses) {
            if pair.a == 5 || pair.b == 5 {
                seen += 1;
                let ratio = pair.error_px / expected;
                assert!((0.7..1.4).contains(&ratio), "{pair:?} {expected}");
            } else {
                assert!(pair.error_px < 0.05, "{pair:?}");
            }
        }
        assert!(seen >= 2);
    }
}
