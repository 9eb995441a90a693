//! The Cramér–Rao bound: how exact any unbiased estimate of the poses can be.
//!
//! Each pixel reads `I = a S(x(ξ)) + b + n` with the wall's texture S (as a pixel sees it, averaged over its square)
//! unknown, and n Gaussian with variance σ². Parameters are the poses' ξ, exposures and S at every wall point.
//! The Fisher information of one observation is `σ⁻² ∂I ∂Iᵀ`, with `∂I/∂ξ_i = a φᵀ B_i` as in [`super::tile`] and
//! `∂I/∂S = a`. Eliminating S at each wall point by the Schur complement leaves for the poses
//!
//! `J_ij = σ⁻² Σ_x (w_i δ_ij − w_i w_j / Σ_k w_k) B_iᵀ φ φᵀ B_j`,   `w_i = q_i a_i²`,
//!
//! with q the pixels per wall sample: the normal matrix of the estimator, but with the slopes of the true texture. Its
//! null space is the gauge, fixed at the first frame. `cov(ξ̂) ⪰ J⁻¹` for any unbiased estimate, and with the prior's
//! information added the Bayesian bound (van Trees) for any estimate at all.
//!
//! # What can be reached
//!
//! The bound takes the slopes of the texture for known, and an estimator has them from the same pixels. Where the texture is a
//! Gaussian process with the spectrum P(f) that N frames see with noise of the spectrum σ² each, the information with the
//! texture integrated out is J with the part of each frequency multiplied by `Nρ/(1 + Nρ)`, `ρ = P/σ²` (Hahn and Tretter's
//! delays of N receivers, in two dimensions). Detail below the noise of the mean of all frames that see it counts for the bound,
//! but is of no use to an estimator that does not know it beforehand. So on faint walls the bound is not to be reached, the
//! less the more noise there is.
//!
//! Nor is it on sharp walls, the less the *less* noise there is: detail finer than pixels shows as something coarser (aliasing), and how
//! much of it there is must be told from the same pixels, which takes as many frames as there are frequencies that look alike.
//! `benches/reach.py` has the information of both together, `F_ij = tr(C⁻¹ ∂_i C C⁻¹ ∂_j C)` with C the covariance of what N frames
//! show at one frequency: where five frames see a point, no estimator that knows no more of the wall than its spectrum comes closer than 1.32,
//! 1.20 and 1.14 × the bound on brick with noise of 1, 2 and 4 grey levels, and 1.10, 1.23 and 1.52 × on concrete.
//!
//! Source: W. J. Bangs, "Array processing with generalized beamformers", thesis, Yale, 1971; W. R. Hahn and S. A. Tretter, "Optimum processing for delay-vector estimation in passive signal arrays", IEEE
//! Transactions on Information Theory 19(5), 1973; C. R. Rao, 1945; H. Cramér, 1946; H. L. van Trees, "Detection,
//! Estimation, and Modulation Theory", 1968.

use super::calibration::{Calibration, Kappa};
use super::covariance::Covariances;
use super::estimate::FrameEstimate;
use super::normal::Block;
use super::prior::{Prior, usual_step_s};
use super::problem::{Members, Problem, Sampling, Scene};
use super::run::RefineError;
use super::selected_inverse::SelectedInverse;
use crate::camera::Camera;
use crate::frames::{FrameCache, GreyImage, Pyramid};
use crate::survey::Survey;
use crate::trajectory::{Shutter, poses_of};
use nalgebra::Matrix6;
use std::borrow::Cow;

/// Wall samples per half pixel: slopes of the texture are differences over a quarter of a pixel to each side.
const DENSITY: f64 = 2.0;

/// Covariances that no unbiased estimate of the true poses of `survey` undercuts; `bayesian`: no estimate that also knows
/// the survey's prior.
///
/// `doubled` are its frames without noise and with twice as many pixels along each axis: the
/// slopes of what a pixel sees can only be had from finer pixels. `noise_grey`: σ of a pixel, grey levels.
///
/// # Errors
/// [`RefineError`]; [`RefineError::NoOverlap`] for a survey without true poses, too.
pub fn pose_bound(
    survey: &Survey,
    doubled: &[GreyImage],
    noise_grey: f64,
    bayesian: bool,
) -> Result<Covariances, RefineError> {
    let Some(truth) = &survey.truth else {
        return Err(RefineError::NoOverlap);
    };
    let count = truth.len();
    let times_s: Vec<f64> = survey
        .initial
        .iter()
        .map(|stamped| stamped.time_s)
        .collect();
    let options = super::RefineOptions::default();
    let prior = Prior {
        jitter: survey.prior,
        initial: survey.initial_poses(),
        usual_step_s: usual_step_s(&times_s),
        times_s,
        log_gain_sigma: options.log_gain_sigma,
        bias_sigma: options.bias_sigma,
    };
    let camera = doubled_camera(&survey.camera);
    let frames = doubled
        .iter()
        .map(|frame| Pyramid::new(as_pixels_see(frame), 1));
    let frames = FrameCache::of_pyramids(frames.collect());
    // The rows' own poses change next to nothing of what can be known.
    let shutter = Shutter::default();
    let scene = Scene {
        surface: survey.surface.as_ref(),
        ignored: &survey.ignored,
        camera,
        shutter: &shutter,
        calibration: Calibration::none(&camera),
        kappa: Kappa::zeros(),
        frames: &frames,
        prior: &prior,
        noise: 0.0,
        fused_gradient: true,
    };
    let estimates: Vec<FrameEstimate> =
        poses_of(truth).into_iter().map(FrameEstimate::at).collect();
    let members = Members {
        participants: 0..count,
        active: 0..count,
        estimates: &estimates,
        compared: Cow::Owned(vec![true; count]),
    };
    let sampling = Sampling {
        density: DENSITY,
        ..Sampling::of(0)
    };
    // A quarter of the doubled pixels are pixels.
    let problem = Problem::new(&scene, sampling, members)?.exact(2.0 * noise_grey);
    let mut normal = problem.linearise(&estimates)?.normal;
    let pattern = problem.pattern();
    if !bayesian {
        let (prior, _) = problem.prior_information(&estimates, &Kappa::zeros());
        for (block, prior) in normal.blocks.iter_mut().zip(&prior) {
            *block -= of_pose(prior);
        }
    }
    let inverse =
        SelectedInverse::new(pattern, &normal).map_err(|source| problem.factor_error(source))?;
    let pose = |row: usize, column: usize| {
        let block = inverse.block(row, column);
        block.map_or(Matrix6::from_element(f64::NAN), |block| {
            block.fixed_view::<6, 6>(0, 0).into_owned()
        })
    };
    Ok(Covariances {
        frames: (0..count).map(|k| pose(k, k)).collect(),
        next: (1..count).map(|k| pose(k - 1, k)).collect(),
        variance_factor: 1.0,
    })
}

/// The part of a block that belongs to poses.
fn of_pose(block: &Block) -> Block {
    let mut pose = Block::zeros();
    pose.fixed_view_mut::<6, 6>(0, 0)
        .copy_from(&block.fixed_view::<6, 6>(0, 0));
    pose
}

/// The camera of frames with pixels half as wide, each averaged with its neighbours to the right and below: pixel
/// `(u', v')` is centred at `(u'/2, v'/2)` of the camera's own.
fn doubled_camera(camera: &Camera) -> Camera {
    Camera {
        width: 2 * camera.width - 1,
        height: 2 * camera.height - 1,
        fx: 2.0 * camera.fx,
        fy: 2.0 * camera.fy,
        cx: 2.0 * camera.cx,
        cy: 2.0 * camera.cy,
        lens: camera.lens,
        sweep: camera.sweep,
    }
}

/// What full pixels see at every half pixel: means over 2 × 2 half pixels.
fn as_pixels_see(doubled: &GreyImage) -> GreyImage {
    let (width, height) = (doubled.width() - 1, doubled.height() - 1);
    let mut data = Vec::with_capacity(width * height);
    for y in 0..height {
        for x in 0..width {
            let sum = doubled.at(x, y)
                + doubled.at(x + 1, y)
                + doubled.at(x, y + 1)
                + doubled.at(x + 1, y + 1);
            data.push(0.25 * sum);
        }
    }
    GreyImage::new(width, height, data)
}
