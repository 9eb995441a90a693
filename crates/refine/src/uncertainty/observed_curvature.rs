//! The derivative D of the score over the normal matrix H, as observed at the end of a solve.
//!
//! The estimate is displaced by what noise may have done to it: by `δ = H⁻¹ z`, with
//! `z = Σ ε_b g_b` of the gradients of blocks of the wall, and random signs ε. In the mean over the
//! signs all directions count that pixels determine, each by its variance. There the score changes
//! by `D δ`, where the equations predict `H δ`. With g the pixels' part of the score, and P the
//! prior's and the points' part of H,
//!
//! `κ = δᵀ(g(x + δ) − g(x)) / δᵀ(H − P) δ`,
//!
//! over the poses' part of δ. Over all unknowns of all frames, what single tiles contribute by
//! chance averages out, so a share of the tiles is enough. κ is about 0.9 for Gaussian residuals,
//! as weights fall where residuals grow (`ψ' ≤ ω`), and far less where the slopes of a faint wall
//! are noise: then the score hardly changes, and the estimate is much less certain than H says.
//!
//! Steps of the solve show the same along one direction each, most of them far from its end; those
//! of the last ones are the weakest directions, which the prior determines.
//!
//! Source: P. J. Huber, "The behavior of maximum likelihood estimates under nonstandard
//! conditions", 1967; M. F. Hutchinson, "A stochastic estimator of the trace of the influence
//! matrix for Laplacian smoothing splines", Communications in Statistics 18(3), 1989 (the signs).

use crate::linear::sparse_cholesky::Factor;
use crate::model::problem_error::ProblemError;
use crate::parameters::calibration::Kappa;
use crate::parameters::frame_estimate::FrameStep;
use crate::solver::gauss_newton::Solution;
use crate::uncertainty::exposure_equations::POSE;

/// Curvature of a solution whose score does not change, or the wrong way: with it σ are a thousand
/// times those of a good solution, and nothing is believed.
const NO_CURVATURE: f64 = 1e-3;

/// Observes κ at a solution; `factor`: of its normal matrix, `scores`: z of every slot.
///
/// # Errors
/// A frame that has to be read again and cannot be.
pub fn observe_curvature(
    solution: &Solution,
    factor: &Factor,
    scores: &[FrameStep],
) -> Result<f64, ProblemError> {
    let (problem, at) = (&solution.problem, &solution.linearisation);
    let from = &solution.linearised_at;
    let step = factor.step(scores);
    let to = problem.stepped(from, &step, &Kappa::zeros());
    let mut predicted = problem.pattern().product(&at.normal.blocks, &step);
    let (others, _) = problem.other_information(from);
    let of_others = problem.pattern().product(&others, &step);
    drop(others);
    for (predicted, of_others) in predicted.iter_mut().zip(&of_others) {
        *predicted -= of_others;
    }
    let stride = problem.mean_change_share(at);
    let change = problem.pixel_gradient_change(at, (from, &to), (&step, &predicted), stride)?;
    let along = |gradient: &[FrameStep]| -> f64 {
        let poses = step.iter().zip(gradient).take(from.frames.len());
        poses
            .map(|(step, g)| step.rows(0, POSE).dot(&g.rows(0, POSE)))
            .sum()
    };
    let curvature = along(&change) / along(&predicted);
    // NaN, too, is none.
    let has_any = curvature > NO_CURVATURE;
    Ok(if has_any {
        curvature.min(1.0)
    } else {
        NO_CURVATURE
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::test_ring::Ring;
    use crate::samples::sampling::Sampling;
    use crate::solver::argmin_glue::solve;
    use crate::solver::stopping::Stopping;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, Normal};
    use tunnelstitch_core::frames::{FrameCache, GreyImage, Pyramid};

    /// Curvature at the coarser level, where the texture is not denoised, of pictures whose wall is
    /// multiplied by `contrast` and that have noise of `sigma` grey levels.
    fn curvature_of(contrast: f32, sigma: f32) -> f64 {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let noise = Normal::new(0.0f32, sigma).unwrap();
        let ring = Ring::new(1e-4);
        let mut picture = |frame: &GreyImage| {
            let values = frame.data().iter();
            let data = values.map(|v| contrast * v + noise.sample(&mut rng));
            Pyramid::new(
                GreyImage::new(frame.width(), frame.height(), data.collect()),
                2,
            )
        };
        let frames: Vec<Pyramid> = ring.wall.frames().iter().map(&mut picture).collect();
        let mut ring = Ring {
            frames: FrameCache::of_pyramids(frames),
            ..ring
        };
        for estimate in &mut ring.estimates {
            (estimate.log_gain, estimate.bias) = (0.0, 0.0);
        }
        let stopping = Stopping {
            max_iterations: 5,
            step_px: 1e-3,
            step_sigma: 0.1,
        };
        let solution = solve(ring.problem_of(Sampling::of(1)), stopping).unwrap();
        let (problem, at) = (&solution.problem, &solution.linearisation);
        let factor = problem.symbolic().factorise(&at.normal, 0.0);
        let scores = problem.score_scatter(at).signed;
        observe_curvature(&solution, &factor.unwrap(), &scores).unwrap()
    }

    #[test]
    fn score_changes_as_predicted_only_where_there_is_texture() {
        let textured = curvature_of(1.0, 1.0);
        assert!((0.8..=1.0).contains(&textured), "{textured}");
        let noisy = curvature_of(0.0, 8.0);
        assert!(noisy < 0.5, "{noisy}");
    }
}
