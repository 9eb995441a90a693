//! The derivative D of the score over the normal matrix H, as observed at an estimate.
//!
//! The estimate is displaced by what noise may have done to it: by `δ = H⁻¹ z`, with
//! `z = Σ ε_b g_b` of the gradients of blocks of the wall, and random signs ε. In the mean over the
//! signs all directions count that pixels determine, each by its variance. There the score changes
//! by `D δ`, where the equations predict `H δ`. With g the pixels' part of the score, and P the
//! prior's and the points' part of H,
//!
//! `κ = δᵀ(g(x + δ) − g(x)) / δᵀ(H − P) δ`,
//!
//! over the poses and the wall's shape: without that of the shape, a change of the poses' score
//! would look like a large motion along what the pixels hardly tell apart. Over all unknowns of all
//! frames, what single tiles contribute by chance averages out, so a share of the tiles is enough.
//! κ is about 0.9 for Gaussian residuals, as weights fall where residuals grow (`ψ' ≤ ω`), and far
//! less where the slopes of a faint wall are noise: then the score hardly changes, and the estimate
//! is much less certain than H says.
//!
//! What the score changes by beyond this, `d = g(x + δ) − g(x) − κ (H − P) δ`, is that of the
//! noise: samples that move by a pixel have other noise, and so has their product with slopes that
//! are noise, too. Relative to the change that is expected it is
//!
//! `η = √(dᵀ H⁻¹ d / κ² δᵀ(H − P) δ)`.
//!
//! Contributions of tiles to d are independent, so that a share of one tile in n, which counts n
//! times, shows n times the square. With a derivative `κ H (1 + N)`, N of the size η, a step leaves
//! η of the error; so, to first order in N, the estimate has `1 + η²` times the variance that it
//! has by κ. (σ of simulated faint walls with η of 0.1 to 0.5 is 1.0 to 1.2 times that by κ.)
//!
//! On a faint wall η falls from one pyramid level to the next coarser one, where noise is less and
//! goes together over more of the wall.
//!
//! Steps of the solve show the same along one direction each, most of them far from its end; those
//! of the last ones are the weakest directions, which the prior determines.
//!
//! Source: P. J. Huber, "The behavior of maximum likelihood estimates under nonstandard
//! conditions", 1967; M. F. Hutchinson, "A stochastic estimator of the trace of the influence
//! matrix for Laplacian smoothing splines", Communications in Statistics 18(3), 1989 (the signs).

use crate::linear::normal_equations::{Block, Pattern};
use crate::linear::sparse_cholesky::Factor;
use crate::model::problem_error::ProblemError;
use crate::parameters::calibration::Kappa;
use crate::parameters::frame_estimate::{EXPOSURE, FrameStep, POSE};
use crate::parameters::unknowns::Unknowns;
use crate::problem::linearisation::{Linearisation, OtherInformation};
use crate::problem::photometric_problem::PhotometricProblem;

/// Curvature of a solution whose score does not change, or the wrong way: with it σ are a thousand
/// times those of a good solution, and nothing is believed.
const NO_CURVATURE: f64 = 1e-3;

/// The derivative of the score, over the normal matrix.
#[derive(Clone, Copy, Debug)]
pub struct ObservedCurvature {
    /// Its mean κ.
    pub mean: f64,
    /// 1-σ η of its deviations from κ, over κ: root mean square over all directions.
    pub scatter: f64,
    /// Information about the pose of a frame, if the score changed as predicted.
    predicted_information: f64,
}

impl ObservedCurvature {
    /// The derivative where it is unknown, as of equations that are singular.
    pub const AS_PREDICTED: Self = Self {
        mean: 1.0,
        scatter: 0.0,
        predicted_information: 0.0,
    };

    /// The derivative of a score that does not change.
    const NONE: Self = Self {
        mean: NO_CURVATURE,
        scatter: 0.0,
        predicted_information: 0.0,
    };

    /// The derivative without scatter by which the variance of the estimate is the same.
    pub fn effective(&self) -> f64 {
        self.mean / (1.0 + self.scatter.powi(2)).sqrt()
    }

    /// Information of the pixels about the pose of a frame if those of all others are known:
    /// inverse variance, the geometric mean over frames and their unknowns.
    pub fn information(&self) -> f64 {
        self.predicted_information * self.effective().powi(2)
    }
}

/// Observes κ and η where the problem is linearised, `at` the unknowns `from`; `factor`: of the
/// normal matrix there, `scores`: z of every slot.
///
/// # Errors
/// A frame that has to be read again and cannot be.
pub fn observe_curvature(
    problem: &PhotometricProblem,
    (at, from): (&Linearisation, &Unknowns),
    factor: &Factor,
    scores: &[FrameStep],
) -> Result<ObservedCurvature, ProblemError> {
    let frames = from.frames.len();
    let pattern = problem.pattern();
    let step = factor.step(scores);
    let to = problem.stepped(from, &step, &Kappa::zeros());
    let mut predicted = pattern.product(&at.normal.blocks, &step);
    let others = problem.other_information(from);
    let of_others = others.pattern.product(&others.blocks, &step);
    let of_frames = information_of_frames((pattern, &at.normal.blocks), &others, frames);
    drop(others);
    for (predicted, of_others) in predicted.iter_mut().zip(&of_others) {
        *predicted -= of_others;
    }
    let stride = problem.mean_change_share(at);
    let change = problem.pixel_gradient_change(at, (from, &to), (&step, &predicted), stride)?;
    let [observed, expected] =
        [change, predicted].map(|gradient| without_exposures(gradient, frames));
    let along = |gradient: &[FrameStep]| dot(&step, gradient);
    let mean = along(&observed) / along(&expected);
    if mean.is_nan() || mean <= NO_CURVATURE {
        return Ok(ObservedCurvature::NONE);
    }
    let mut beyond = vec![FrameStep::zeros(); step.len()];
    for ((beyond, observed), expected) in beyond.iter_mut().zip(&observed).zip(&expected) {
        *beyond = observed - expected * mean;
    }
    let square = -dot(&factor.step(&beyond), &beyond) / stride.unwrap_or(1) as f64;
    let dispersion = -dot(&step[..frames], scores) / (POSE * frames) as f64;
    Ok(ObservedCurvature {
        mean: mean.min(1.0),
        scatter: (square / (mean.powi(2) * along(&expected))).sqrt(),
        predicted_information: of_frames / dispersion,
    })
}

/// Geometric mean of `det(H_kk − P_kk)^(1/6)` of the poses of all frames of which pixels tell all
/// of it; the blocks of H on their pattern, and P.
fn information_of_frames(
    (pattern, normal): (&Pattern, &[Block]),
    others: &OtherInformation,
    frames: usize,
) -> f64 {
    let logarithms = (0..frames).filter_map(|k| {
        let (own, of_others) = (
            pattern.block_index(k, k)?,
            others.pattern.block_index(k, k)?,
        );
        let of_pixels = normal[own] - others.blocks[of_others];
        let determinant = of_pixels.fixed_view::<POSE, POSE>(0, 0).determinant();
        (determinant > 0.0).then(|| determinant.ln() / POSE as f64)
    });
    let (sum, count) = logarithms.fold((0.0, 0.0), |(sum, count), ln| (sum + ln, count + 1.0));
    f64::exp(sum / f64::max(count, 1.0))
}

/// Gradients of the slots, the first `frames` of which are frames, without those of exposures.
fn without_exposures(mut gradient: Vec<FrameStep>, frames: usize) -> Vec<FrameStep> {
    for of_frame in &mut gradient[..frames] {
        of_frame.rows_mut(POSE, EXPOSURE).fill(0.0);
    }
    gradient
}

/// Sum of the products of steps and gradients, as far as there are both.
fn dot(steps: &[FrameStep], gradients: &[FrameStep]) -> f64 {
    steps.iter().zip(gradients).map(|(s, g)| s.dot(g)).sum()
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
    fn curvature_of(contrast: f32, sigma: f32) -> ObservedCurvature {
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
        let scores = problem.signed_scores(at);
        let at_end = (at, &solution.linearised_at);
        observe_curvature(problem, at_end, &factor.unwrap(), &scores).unwrap()
    }

    #[test]
    fn score_changes_as_predicted_only_where_there_is_texture() {
        let textured = curvature_of(1.0, 1.0);
        assert!((0.8..=1.0).contains(&textured.mean), "{textured:?}");
        assert!(textured.scatter < 0.2, "{textured:?}");
        let noisy = curvature_of(0.0, 8.0);
        assert!(noisy.effective() < 0.5, "{noisy:?}");
        assert!(noisy.scatter > 0.5, "{noisy:?}");
    }

    #[test]
    fn scatter_of_the_curvature_makes_the_estimate_less_certain() {
        let observed = ObservedCurvature {
            mean: 0.9,
            scatter: 0.5,
            predicted_information: 1.0,
        };
        let expected = 0.9 / 1.25f64.sqrt();
        assert!((observed.effective() - expected).abs() < 1e-12);
        assert_eq!(ObservedCurvature::AS_PREDICTED.effective(), 1.0);
    }
}
