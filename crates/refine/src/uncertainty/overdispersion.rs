//! Overdispersion of a frame: residuals that scatter more than noise.
//!
//! Where the model is wrong (a camera's focal length, a turn closed a period off and bent), patches
//! of the wall pull a frame in different directions, and it rests between them. If that were noise,
//! the scatter of the patches' scores would be `V_k ≈ H_k`, the frame's own blocks on the diagonal,
//! all other frames held (White's information-matrix test). With `q = tr(H_k⁻¹ V_k)/6` over the
//! pose ([`compute_dispersion`]) a patch is displaced `√q` times as far as by noise. By noise, N
//! patches of information I px⁻² each, which together determine six unknowns, leave the middle of
//! the picture the variance `σ² = 6/(N I)`, and a patch by itself, in both directions, the variance
//! `2/I = N σ²/3`. So the displacement of patches beyond noise is
//!
//! `overdispersion² = (q − 1) N σ²/3`   px².
//!
//! Source: H. White, "Maximum likelihood estimation of misspecified models", Econometrica 50(1),
//! 1982.

use crate::linear::normal_equations::Block;
use crate::model::context::EstimationContext;
use crate::parameters::frame_estimate::FrameEstimate;
use crate::problem::score_scatter::ScoreScatter;
use crate::solver::gauss_newton::Solution;
use crate::tiles::grid::BLOCK;
use crate::tiles::tile_arrays::SAMPLES;
use crate::uncertainty::frame_sigma::compute_frame_sigma;
use nalgebra::Matrix6;

/// Wall samples of a patch: of the blocks over which the scatter is estimated.
const PATCH: i64 = BLOCK * BLOCK * SAMPLES as i64;

/// Overdispersion of a frame; see the [module](self).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overdispersion {
    /// Displacement of patches over that by noise: √q.
    pub ratio: f64,
    /// Displacement of patches beyond noise, pixels, root mean square.
    pub px: f64,
}

impl Overdispersion {
    /// The overdispersion for q, the number N of patches, and σ of the middle of the picture by
    /// noise, all other frames held.
    fn new(q: f64, patches: f64, sigma_px: f64) -> Self {
        Self {
            ratio: q.sqrt(),
            px: ((q - 1.0).max(0.0) * patches / 3.0).sqrt() * sigma_px,
        }
    }

    /// The overdispersion of a frame with its own block of the normal matrix, `information`, and of
    /// V, `scatter`, over a number of `patches`. None if the others do not determine its pose.
    fn of_frame(
        context: &EstimationContext,
        (k, estimate): (usize, &FrameEstimate),
        (information, scatter): (&Block, &Block),
        patches: f64,
    ) -> Option<Self> {
        let (q, covariance) = compute_dispersion(information, scatter)?;
        let sigma = compute_frame_sigma(
            context.surface.as_ref(),
            context.cameras.of(k),
            estimate,
            &covariance,
        );
        (q.is_finite() && sigma.wall_px.is_finite()).then(|| Self::new(q, patches, sigma.wall_px))
    }
}

/// Computes q and, by noise alone, the covariance of the pose with all other frames held.
///
/// The exposure is eliminated: with `E = (I, −H_pe H_ee⁻¹)`, scores of the pose p that the exposure
/// e does not compensate have the scatter `E V Eᵀ`; and `E` is `Z_pp⁻¹ (Z_pp Z_pe)` with
/// `Z = H_k⁻¹`.
fn compute_dispersion(information: &Block, scatter: &Block) -> Option<(f64, Matrix6<f64>)> {
    let inverse = information.cholesky()?.inverse();
    let rows = inverse.fixed_rows::<6>(0);
    let pose = rows.fixed_columns::<6>(0).into_owned();
    let pose_scatter = rows * scatter * rows.transpose();
    let q = pose.cholesky()?.solve(&pose_scatter).trace() / 6.0;
    Some((q, pose))
}

/// Computes the overdispersion of every frame at a solution; 0 for those that show nothing.
/// `context`: with the solution's own κ.
pub fn compute_overdispersions(
    context: &EstimationContext,
    solution: &Solution,
    scatter: &ScoreScatter,
) -> Vec<Overdispersion> {
    let at = &solution.linearisation;
    let pattern = solution.problem.pattern();
    let dispersion = solution.problem.dispersion();
    let of_frame = |(k, estimate): (usize, &FrameEstimate)| {
        let place = pattern.block_index(k, k)?;
        // With all information of the pixels.
        let information = at.normal.blocks[place] * dispersion;
        let scatter = scatter.blocks[place] * dispersion.powi(2);
        let blocks = (&information, &scatter);
        let patches = at.frames[k].samples as f64 / PATCH as f64;
        Overdispersion::of_frame(context, (k, estimate), blocks, patches)
    };
    let frames = solution.unknowns.frames.iter().enumerate();
    frames
        .map(|frame| of_frame(frame).unwrap_or_default())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// WallRegions displaced by noise alone have no overdispersion; those displaced by half a pixel
    /// more have one of half a pixel.
    #[test]
    fn overdispersion_is_displacement_beyond_noise() {
        // N patches, each with information I px⁻² in both directions, determine six unknowns.
        let (patches, information) = (300.0, 40.0);
        let sigma_px = f64::sqrt(6.0 / (patches * information));
        assert_eq!(Overdispersion::new(1.0, patches, sigma_px).px, 0.0);
        let displacement_px = 0.5;
        // The score is I · displacement in each of the two directions; its variance by noise is I.
        let q = 1.0 + 0.5 * information * displacement_px * displacement_px;
        assert!((Overdispersion::new(q, patches, sigma_px).px - displacement_px).abs() < 1e-12);
        let scatter = Block::identity() * 12.0;
        let (q, pose) = compute_dispersion(&(Block::identity() * 4.0), &scatter).unwrap();
        assert!((q - 3.0).abs() < 1e-12);
        assert!((pose - Matrix6::identity() * 0.25).norm() < 1e-12);
        assert!(compute_dispersion(&Block::zeros(), &scatter).is_none());
        // Scores that the exposure compensates do not count.
        let (mut information, mut scatter) = (Block::identity(), Block::identity());
        for (row, column) in [(0, 7), (7, 0)] {
            information[(row, column)] = 0.5;
            scatter[(row, column)] = 0.5;
        }
        let along = Block::from_fn(|r, c| information[(r, 7)] * information[(7, c)]);
        let (q, _) = compute_dispersion(&information, &(scatter + along * 100.0)).unwrap();
        assert!((q - 1.0).abs() < 1e-12, "{q}");
    }
}
