//! How far a frame is pulled hither and thither.
//!
//! Where the model is wrong (a camera's focal length, a turn closed a period off and bent), patches
//! of the wall pull a frame hither and thither, and it rests between. Were it noise, the scatter of
//! what the patches pull would be `V_k ≈ H_k`, the frame's own blocks on the diagonal, all other
//! frames held. With `q = tr(H_k⁻¹ V_k)/6` over the pose ([`pull`]) a patch lies `√q` times as far
//! off as by noise. By noise, N patches of information I px⁻² each, which together fix six
//! unknowns, leave the mean point of the picture the variance `σ² = 6/(N I)`, and a patch by
//! itself, in both directions, is uncertain by `2/I = N σ²/3`. So what patches are off by, beyond
//! noise, is
//!
//! `strain² = (q − 1) N σ²/3`   px².

use crate::numerics::median::upper_median;
use crate::refine::linear::normal_equations::Block;
use crate::refine::model::context::EstimationContext;
use crate::refine::model::rejection::RejectionReason;
use crate::refine::parameters::frame_estimate::FrameEstimate;
use crate::refine::solver::gauss_newton::Solution;
use crate::refine::tiles::grid::BLOCK;
use crate::refine::tiles::tile_arrays::SAMPLES;
use crate::refine::uncertainty::covariance::frame_sigma;
use nalgebra::Matrix6;

/// Largest overdispersion that can be borne of a frame by itself, if it is that many times what noise does
/// ([`Overdispersion`]): a glint on a faint wall makes it a pixel and five to ten times, in one patch of a
/// frame that is right.
const MOST_STRAIN: Overdispersion = Overdispersion {
    times: 12.0,
    px: 0.25,
};
/// Largest overdispersion of the median frame, pixels. Right surveys have none, whatever wall, light and
/// noise; a focal length 0.3 % off makes it 0.05, one 1 % off 0.13.
const MOST_USUAL_STRAIN_PX: f64 = 0.04;
/// Wall samples of a patch: of the blocks over which the scatter is told.
const PATCH: i64 = BLOCK * BLOCK * SAMPLES as i64;

/// How far patches of the wall pull a frame's pose apart: see the [module](self).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overdispersion {
    /// What patches are off by, in terms of what they are by noise: √q.
    pub times: f64,
    /// What they are off by beyond noise, pixels, root mean square.
    pub px: f64,
}

impl Overdispersion {
    /// From q, the number N of patches, and σ of the mean point of the picture by noise, all other
    /// frames held.
    fn new(q: f64, patches: f64, sigma_px: f64) -> Self {
        Self {
            times: q.sqrt(),
            px: ((q - 1.0).max(0.0) * patches / 3.0).sqrt() * sigma_px,
        }
    }

    /// Of a frame with its own block of the normal matrix, `information`, and of V, `scatter`, over
    /// a number of `patches`. None if the frame is not fixed by the others.
    fn of_frame(
        scene: &EstimationContext,
        estimate: &FrameEstimate,
        (information, scatter): (&Block, &Block),
        patches: f64,
    ) -> Option<Self> {
        let (q, covariance) = pull(information, scatter)?;
        let sigma = frame_sigma(scene.surface, &scene.camera, estimate, &covariance, None);
        (q.is_finite() && sigma.wall_px.is_finite()).then(|| Self::new(q, patches, sigma.wall_px))
    }
}

/// q and, by noise alone, the covariance of the pose with all other frames held.
///
/// The exposure goes along: with `E = (I, −H_pe H_ee⁻¹)`, pulls on the pose p that the exposure e
/// does not make up for have the scatter `E V Eᵀ`; and `E` is `Z_pp⁻¹ (Z_pp Z_pe)` with
/// `Z = H_k⁻¹`.
fn pull(information: &Block, scatter: &Block) -> Option<(f64, Matrix6<f64>)> {
    let inverse = information.cholesky()?.inverse();
    let rows = inverse.fixed_rows::<6>(0);
    let pose = rows.fixed_columns::<6>(0).into_owned();
    let moved = rows * scatter * rows.transpose();
    let q = pose.cholesky()?.solve(&moved).trace() / 6.0;
    Some((q, pose))
}

/// Each frame's overdispersion at a solution; none of those that show nothing. `scene`: with the solution's
/// own κ.
pub fn overdispersions(scene: &EstimationContext, solution: &Solution) -> Vec<Overdispersion> {
    let at = &solution.linearisation;
    let pattern = solution.problem.pattern();
    let patch = PATCH as f64 * solution.problem.compared_share();
    let of = |(k, estimate): (usize, &FrameEstimate)| {
        let place = pattern.block_index(k, k)?;
        let blocks = (&at.normal.blocks[place], &at.scatter[place]);
        let patches = at.frames[k].samples as f64 / patch;
        Overdispersion::of_frame(scene, estimate, blocks, patches)
    };
    let frames = solution.estimates.iter().enumerate();
    frames.map(|frame| of(frame).unwrap_or_default()).collect()
}

/// Which of the frames inliers so far are under more overdispersion than can be borne; where their median
/// is, all are.
pub fn overdispersed(
    overdispersions: &[Overdispersion],
    rejections: &[Option<RejectionReason>],
) -> Vec<bool> {
    let inliers = (0..rejections.len()).filter(|k| rejections[*k].is_none());
    let usual = upper_median(inliers.map(|k| overdispersions[k].px).collect());
    let all = usual.is_some_and(|px| px > MOST_USUAL_STRAIN_PX);
    let beyond = |overdispersion: &Overdispersion| {
        overdispersion.px > MOST_STRAIN.px && overdispersion.times > MOST_STRAIN.times
    };
    (0..rejections.len())
        .map(|k| rejections[k].is_none() && (all || beyond(&overdispersions[k])))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// WallRegions that all pull at random, each by its own noise, are no overdispersion; those that pull by
    /// half a pixel more are half a pixel.
    #[test]
    fn strain_is_what_patches_are_off_by_beyond_noise() {
        // N patches, each with information I px⁻² about both directions of a picture that can move
        // in six ways.
        let (patches, information) = (300.0, 40.0);
        let sigma_px = f64::sqrt(6.0 / (patches * information));
        assert_eq!(Overdispersion::new(1.0, patches, sigma_px).px, 0.0);
        let off_px = 0.5;
        // Pull I · off in each of the two directions, so its square over that by noise, I.
        let q = 1.0 + 0.5 * information * off_px * off_px;
        assert!((Overdispersion::new(q, patches, sigma_px).px - off_px).abs() < 1e-12);
        let scatter = Block::identity() * 12.0;
        let (q, pose) = pull(&(Block::identity() * 4.0), &scatter).unwrap();
        assert!((q - 3.0).abs() < 1e-12);
        assert!((pose - Matrix6::identity() * 0.25).norm() < 1e-12);
        assert!(pull(&Block::zeros(), &scatter).is_none());
        // What the exposure makes up for is no pull on the pose.
        let (mut information, mut scatter) = (Block::identity(), Block::identity());
        for (row, column) in [(0, 7), (7, 0)] {
            information[(row, column)] = 0.5;
            scatter[(row, column)] = 0.5;
        }
        let along = Block::from_fn(|r, c| information[(r, 7)] * information[(7, c)]);
        let (q, _) = pull(&information, &(scatter + along * 100.0)).unwrap();
        assert!((q - 1.0).abs() < 1e-12, "{q}");
    }

    #[test]
    fn what_strains_the_median_frame_strains_all() {
        let mut rejections = vec![None; 4];
        rejections[0] = Some(RejectionReason::Featureless);
        let overdispersion = |times, px| Overdispersion { times, px };
        let of =
            |overdispersions: [Overdispersion; 4]| overdispersed(&overdispersions, &rejections);
        let (none, usual, much) = (
            overdispersion(1.5, 0.01),
            overdispersion(10.0, 0.1),
            overdispersion(20.0, 0.5),
        );
        let (faint, clean) = (overdispersion(8.0, 1.0), overdispersion(20.0, 0.02));
        assert_eq!(of([much, none, none, none]), [false; 4]);
        assert_eq!(of([none, none, much, usual]), [false, true, true, true]);
        assert_eq!(of([none, none, much, none]), [false, false, true, false]);
        assert_eq!(of([usual, none, usual, none]), [false; 4]);
        assert_eq!(of([none, clean, faint, clean]), [false; 4]);
        assert_eq!(overdispersed(&[], &[]), [false; 0]);
    }
}
