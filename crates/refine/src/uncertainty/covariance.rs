//! Covariance of the estimated poses.
//!
//! The estimate is where the score g, the gradient of the cost, is zero. Errors of the pixels that
//! add ε to the score move the estimate by `−D⁻¹ ε`, D the derivative of the score. So its
//! covariance is `D⁻¹ Q D⁻¹` with Q the covariance of ε.
//!
//! **D is not the normal matrix H.** Gauss–Newton weighs a residual by `ω = ψ(e)/e`, but as the
//! residual grows its weight falls: a score `Σ ψ(e) ∂e` has the derivative `Σ ψ'(e) ∂e ∂eᵀ`, and ψ'
//! is less than ω (0.89 of it in the mean, for Gaussian residuals). Slopes that are not quite those
//! of the wall, as on faint or very sharp walls, make a difference, too. D is observed at the end
//! of a solve: `D = κ H`, with κ about 0.9 ([`crate::uncertainty::observed_curvature`]).
//!
//! **Q** is estimated from the scatter of the gradients of parts of the cost, `V = Σ_b g_b g_bᵀ`
//! over blocks b of the wall (32 × 32 pixels: errors of neighbouring samples are correlated, those
//! of blocks hardly), whatever the residuals are like, over κ², plus the prior's own information P.
//! If the residuals were independent Gaussian noise of the assumed σ, V/κ² would be `H − P`. They
//! are not quite: where the wall is steep, aliasing and interpolation add errors that depend on the
//! position between pixels, with correlations of their own. One factor for all poses, the
//! dispersion `c_1`, makes up for that, `V/κ² ≈ c_1 (H − P)`, and
//!
//! `Σ = H⁻¹ Q H⁻¹ = c_1 H⁻¹ + (1 − c_1) H⁻¹ P H⁻¹`.
//!
//! With J the normal matrix of the poses with the exposures eliminated,
//!
//! `c_1 = tr(J⁻¹ E V Eᵀ)/(κ² (freedoms − tr(J⁻¹ E P Eᵀ)))`, `J = H_pp − H_pe H_ee⁻¹ H_ep`,
//! `E = (I, −H_pe H_ee⁻¹)`,
//!
//! the freedoms being six of each frame less those of the gauge. The exposures are left out because
//! their errors differ: where a wall is sharp, a frame that sees it obliquely is blurred, which
//! looks like a lower gain, block after block, and says nothing of its pose. As
//! `H⁻¹ = Eᵀ J⁻¹ E + diag(0, H_ee⁻¹)`,
//!
//! `tr(J⁻¹ E Q Eᵀ) = tr(H⁻¹ Q) − tr(H_ee⁻¹ Q_ee)`,
//!
//! for which only those blocks of `H⁻¹` and `H_ee⁻¹` are needed where H itself has blocks
//! ([`crate::linear::selected_inverse`]). `c_1` is about 0.35 on sharp bricks, where aliasing,
//! which the weight of every sample takes for independent, cancels over a block, and 0.7 on noisy
//! walls of low contrast. `H⁻¹ P H⁻¹`, which matters only where the prior decides, comes from draws
//! ([`crate::uncertainty::model_error`]).
//!
//! Source: P. J. Huber, "The behavior of maximum likelihood estimates under nonstandard
//! conditions", 1967 (`D⁻¹ Q D⁻¹`); F. R. Hampel, E. M. Ronchetti, P. J. Rousseeuw, W. A. Stahel,
//! "Robust Statistics: The Approach Based on Influence Functions", 1986, 6.3 (ψ' in D); R. W. M.
//! Wedderburn, "Quasi-likelihood functions", Biometrika 61(3), 1974 (one factor for all).

use crate::linear::factor_error::FactorError;
use crate::linear::normal_equations::{Block, NormalEquations, Pattern};
use crate::linear::selected_inverse::SelectedInverse;
use crate::linear::sparse_cholesky::{Factor, SymbolicFactorisation};
use crate::parameters::frame_estimate::{FRAME_PARAMETERS, POSE};
use crate::problem::linearisation::OtherInformation;
use crate::uncertainty::exposure_equations::ExposurePattern;
use crate::uncertainty::frame_sigma::FrameSigma;
use nalgebra::{Matrix6, Vector6};
use tunnelstitch_geometry::surface::GaugeMotion;

/// Covariances of the poses' steps `ξ = (ω, ρ)`
/// ([`tunnelstitch_geometry::trajectory::Pose::retract`]): rad², rad·m, m².
#[derive(Clone, Debug)]
pub struct Covariances {
    /// Covariance of every frame, all others marginalised.
    pub frames: Vec<Matrix6<f64>>,
    /// Covariance of every frame (rows) with the next (columns); NaN where the two have nothing in
    /// common.
    pub next: Vec<Matrix6<f64>>,
    /// Variance factor c.
    pub variance_factor: f64,
}

impl Covariances {
    /// Unknown covariances of `frames` frames: NaN.
    pub fn unknown(frames: usize) -> Self {
        let unknown = Matrix6::from_element(f64::NAN);
        Self {
            frames: vec![unknown; frames],
            next: vec![unknown; frames.saturating_sub(1)],
            variance_factor: f64::NAN,
        }
    }

    /// Scales all positions by `scale`.
    pub fn scaled(mut self, scale: f64) -> Self {
        let d = Matrix6::from_diagonal(&Vector6::new(1.0, 1.0, 1.0, scale, scale, scale));
        for covariance in self.frames.iter_mut().chain(&mut self.next) {
            *covariance = d * *covariance * d;
        }
        self
    }

    /// Moves all poses along the gauge: positions rotate with it, `ρ → R_n ρ`; rotations are in the
    /// cameras' own axes.
    pub fn moved(mut self, motion: &GaugeMotion) -> Self {
        let turn = motion.rotation();
        let mut t = Matrix6::identity();
        t.fixed_view_mut::<3, 3>(3, 3)
            .copy_from(turn.to_rotation_matrix().matrix());
        for covariance in self.frames.iter_mut().chain(&mut self.next) {
            *covariance = t * *covariance * t.transpose();
        }
        self
    }

    /// Formats the covariances as `covariance.csv`: one line per frame and one per pair of
    /// neighbours.
    ///
    /// Columns: `frame_a`, `frame_b` (the same for a frame by itself, the next for a pair), 1-σ of
    /// the frame on the wall in mm (empty for pairs), then the 36 elements row by row, rows `ξ_a`
    /// and columns `ξ_b` with `ξ = (ω_x, ω_y, ω_z, ρ_x, ρ_y, ρ_z)`, rad and m, in the convention
    /// `R ← R exp(ω)`, `t ← t + ρ`.
    pub fn csv(&self, sigmas: &[FrameSigma]) -> String {
        let names = ["wx", "wy", "wz", "x", "y", "z"];
        let mut text = "frame_a,frame_b,wall_sigma_mm".to_owned();
        for a in names {
            for b in names {
                text += &format!(",{a}_{b}");
            }
        }
        text.push('\n');
        let mut line = |a: usize, b: usize, wall: String, covariance: &Matrix6<f64>| {
            text += &format!("{a},{b},{wall}");
            for value in covariance.transpose().iter() {
                text += &format!(",{value:.9e}");
            }
            text.push('\n');
        };
        for (k, covariance) in self.frames.iter().enumerate() {
            let wall = sigmas
                .get(k)
                .map_or(String::new(), |s| format!("{:.6}", 1e3 * s.wall_m));
            line(k, k, wall, covariance);
            if let Some(next) = self.next.get(k) {
                line(k, k + 1, String::new(), next);
            }
        }
        text
    }
}

/// The inverse of the normal matrix, as far as covariances are made of it, and the dispersion of
/// the pixels' scores.
pub struct NoiseCovariance {
    /// `H⁻¹`; its blocks of poses are those of `J⁻¹`.
    pub inverse: SelectedInverse,
    /// Variance factor c: the covariance over `J⁻¹`.
    pub variance_factor: f64,
    /// Dispersion `c_1` of the pixels' scores.
    pub pixel_dispersion: f64,
    /// Number of freedoms of poses and shape that the pixels determine.
    pub determined: f64,
}

/// Share of the freedoms below which nothing is known of the pixels' dispersion: less than rounding
/// leaves of it.
const MIN_DETERMINED: f64 = 1e-6;

/// Computes the inverse of the normal matrix and the dispersion at a solution.
///
/// `normal`: H, with its `factor` and with `tied` freedoms of the gauge tied; `scatter`: V of the
/// pixels; both on `pattern`, whose first `frames` slots are frames, the others the wall's shape;
/// `prior`: makes P, once V is no longer in memory. `curvature`: κ.
///
/// # Errors
/// [`FactorError`] if the equations of the exposures are singular.
pub fn compute_covariances(
    pattern: &Pattern,
    frames: usize,
    (normal, factor): (&NormalEquations, &Factor),
    tied: usize,
    scatter: Vec<Block>,
    prior: impl FnOnce() -> OtherInformation,
    curvature: f64,
) -> Result<NoiseCovariance, FactorError> {
    let exposures = ExposurePattern::new(pattern, frames);
    let of_exposures = inverse_of_exposures(pattern, &exposures, normal)?;
    let inverse = SelectedInverse::new(factor);
    // tr(J⁻¹ E Q Eᵀ).
    let trace = |pattern: &Pattern, blocks: &[Block]| {
        trace_of_product(pattern, &inverse, blocks)
            - trace_of_product(
                &exposures.slots,
                &of_exposures,
                &exposures.blocks(pattern, blocks),
            )
    };
    let of_pixels = trace(pattern, &scatter) / curvature.powi(2);
    drop(scatter);
    let prior = prior();
    let of_prior = trace(&prior.pattern, &prior.blocks);
    let of_shape = (pattern.columns() - frames) * FRAME_PARAMETERS;
    let freedoms = (frames * POSE + of_shape - tied) as f64;
    // The freedoms that pixels determine, by their share of the information.
    let determined = freedoms - of_prior;
    Ok(NoiseCovariance {
        inverse,
        variance_factor: (of_pixels + of_prior) / freedoms,
        pixel_dispersion: if determined > MIN_DETERMINED * freedoms {
            of_pixels / determined
        } else {
            1.0
        },
        determined,
    })
}

/// `H_ee⁻¹`, e being the exposures.
fn inverse_of_exposures(
    pattern: &Pattern,
    exposures: &ExposurePattern,
    normal: &NormalEquations,
) -> Result<SelectedInverse, FactorError> {
    let symbolic = SymbolicFactorisation::new(&exposures.slots)?;
    let equations = exposures.equations(pattern, normal);
    Ok(SelectedInverse::new(&symbolic.factorise(&equations, 0.0)?))
}

/// `tr(H⁻¹ Q)` of a symmetric matrix Q with the upper `blocks` on `pattern`.
fn trace_of_product(pattern: &Pattern, inverse: &SelectedInverse, blocks: &[Block]) -> f64 {
    let mut trace = 0.0;
    for column in 0..pattern.columns() {
        for &row in pattern.rows(column) {
            let z = inverse.block(row, column);
            if let Some((place, z)) = pattern.block_index(row, column).zip(z) {
                // Off the diagonal each block stands for its transpose, too.
                let multiplicity = if row == column { 1.0 } else { 2.0 };
                trace += multiplicity * z.component_mul(&blocks[place]).sum();
            }
        }
    }
    trace
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::bordered_system::SharedBorder;
    use crate::parameters::frame_estimate::EXPOSURE;
    use nalgebra::DMatrix;

    fn information(pattern: &Pattern, blocks: &[Block]) -> OtherInformation {
        OtherInformation {
            pattern: pattern.clone(),
            blocks: blocks.to_vec(),
            border: SharedBorder::zeros(pattern.columns()),
        }
    }

    fn factorise<'n>(pattern: &Pattern, normal: &'n NormalEquations) -> Factor<'n> {
        let symbolic = SymbolicFactorisation::new(pattern).unwrap();
        symbolic.factorise(normal, 0.0).unwrap()
    }

    #[test]
    fn csv_has_a_line_per_frame_and_pair_and_39_columns() {
        let mut covariances = Covariances::unknown(3);
        covariances.next[1] = Matrix6::from_fn(|r, c| (10 * r + c) as f64);
        let text = covariances.csv(&[]);
        let lines: Vec<Vec<&str>> = text.lines().map(|l| l.split(',').collect()).collect();
        assert_eq!(lines.len(), 6);
        assert!(lines.iter().all(|line| line.len() == 39));
        assert_eq!(lines[4][..2], ["1", "2"]);
        // Row by row: the second number is row 0, column 1.
        assert_eq!(lines[4][4].parse(), Ok(1.0));
        assert_eq!(lines[4][9].parse(), Ok(10.0));
        assert_eq!(lines[0][4], "wx_wy");
    }

    /// If the scatter is as modelled, so is the covariance; twice the scatter makes twice the
    /// covariance, half the curvature twice the error by pixels; scatter of the exposures does not
    /// count.
    #[test]
    fn variance_factor_follows_scatter_and_curvature() {
        let pattern = Pattern::new(3, [(0, 1), (1, 2)]);
        let mut normal = NormalEquations::zeros(&pattern);
        for k in 0..3 {
            normal.add_block(&pattern, k, k, &(Block::identity() * 4.0));
        }
        for k in 0..2 {
            normal.add_block(&pattern, k, k + 1, &(Block::identity() * -1.0));
        }
        let none = vec![Block::zeros(); pattern.blocks()];
        let factor = factorise(&pattern, &normal);
        let normal = (&normal, &factor);
        let at = |scatter: &[Block], prior: &[Block], curvature: f64| {
            let scatter = scatter.to_vec();
            let prior = || information(&pattern, prior);
            let found = compute_covariances(&pattern, 3, normal, 0, scatter, prior, curvature);
            let found = found.unwrap();
            let factor = found.variance_factor;
            let block = |j, k| found.inverse.block(j, k).unwrap() * factor;
            (factor, [block(0, 0), block(1, 1), block(0, 1)])
        };
        let one = at(&normal.0.blocks, &none, 1.0);
        assert!((one.0 - 1.0).abs() < 1e-12);
        let two = at(&normal.0.blocks, &normal.0.blocks, 1.0);
        assert!((two.1[1] - one.1[1] * 2.0).norm() < 1e-12);
        let bent = at(&normal.0.blocks, &normal.0.blocks, 0.5);
        assert!((bent.1[1] - one.1[1] * 5.0).norm() < 1e-12);
        assert!((one.1[0][(0, 0)] - 15.0 / 56.0).abs() < 1e-12);
        assert!((one.1[2][(0, 0)] - 4.0 / 56.0).abs() < 1e-12);
        let mut exposed = normal.0.blocks.clone();
        for (block, normal) in exposed.iter_mut().zip(&normal.0.blocks) {
            let exposures = normal.fixed_view::<EXPOSURE, EXPOSURE>(POSE, POSE) * 9.0;
            let mut part = block.fixed_view_mut::<EXPOSURE, EXPOSURE>(POSE, POSE);
            part += exposures;
        }
        let same = at(&exposed, &none, 1.0);
        assert!((same.0 - 1.0).abs() < 1e-12);
        // With the gauge tied, two of 18 freedoms are no freedoms.
        let scatter = normal.0.blocks.clone();
        let tied = {
            let prior = || information(&pattern, &none);
            compute_covariances(&pattern, 3, normal, 2, scatter, prior, 1.0).unwrap()
        };
        assert!((tied.variance_factor - 18.0 / 16.0).abs() < 1e-12);
    }

    /// Compared with the sandwich itself, where poses and exposures are correlated.
    #[test]
    fn variance_factor_is_that_of_the_poses_with_exposures_eliminated() {
        let pattern = Pattern::new(2, [(0, 1)]);
        let matrix = |salt: f64| {
            let n = 2 * FRAME_PARAMETERS;
            let number = |r: usize, c: usize| (12.9898 * (r + n * c) as f64 + salt).sin();
            let root = DMatrix::from_fn(n, n, number);
            &root * root.transpose() + DMatrix::identity(n, n)
        };
        let blocks = |dense: &DMatrix<f64>| {
            let block = |row: usize, column: usize| {
                let view = dense.fixed_view::<FRAME_PARAMETERS, FRAME_PARAMETERS>(
                    row * FRAME_PARAMETERS,
                    column * FRAME_PARAMETERS,
                );
                view.into_owned()
            };
            vec![block(0, 0), block(0, 1), block(1, 1)]
        };
        let (h, q) = (matrix(0.1), matrix(0.7));
        let mut normal = NormalEquations::zeros(&pattern);
        normal.blocks = blocks(&h);
        let none = vec![Block::zeros(); pattern.blocks()];
        let factor = factorise(&pattern, &normal);
        let normal = (&normal, &factor);
        let found = {
            let prior = || information(&pattern, &none);
            compute_covariances(&pattern, 2, normal, 0, blocks(&q), prior, 1.0).unwrap()
        };
        let poses: Vec<usize> = (0..2 * FRAME_PARAMETERS)
            .filter(|k| k % FRAME_PARAMETERS < POSE)
            .collect();
        let inverse = h.try_inverse().unwrap();
        let sandwich = &inverse * q * &inverse;
        let part = |m: &DMatrix<f64>| m.select_rows(&poses).select_columns(&poses);
        let relative = part(&inverse).try_inverse().unwrap() * part(&sandwich);
        let expected = relative.trace() / poses.len() as f64;
        assert!((found.variance_factor / expected - 1.0).abs() < 1e-9);
    }
}
