//! Cramér–Rao bound: the covariance that no unbiased estimate of the poses undercuts.
//!
//! Each pixel has the value `I = a S(x(ξ)) + b + n` with the wall's texture S (averaged over the
//! square of a pixel) unknown, and n Gaussian with variance σ². Parameters are the poses' ξ, the
//! exposures and S at every wall point. The Fisher information of one observation is `σ⁻² ∂I ∂Iᵀ`,
//! with `∂I/∂ξ_i = a φᵀ B_i` as in [`crate::tiles::tile`] and `∂I/∂S = a`. Eliminating S at
//! each wall point by the Schur complement leaves for the poses
//!
//! `J_ij = σ⁻² Σ_x (w_i δ_ij − w_i w_j / Σ_k w_k) B_iᵀ φ φᵀ B_j`,   `w_i = q_i a_i²`,
//!
//! with q the pixels per wall sample: the normal matrix of the estimator, but with the slopes of
//! the true texture. Its null space is the gauge, fixed at the first frame. `cov(ξ̂) ⪰ J⁻¹` for any
//! unbiased estimate, and with the prior's information added the Bayesian bound (van Trees) for any
//! estimate at all.
//!
//! # The bound for an unknown texture
//!
//! This bound takes the slopes of the texture as known, but an estimator has them from the same
//! pixels. The bound with the texture integrated out, as a Gaussian process with the wall's own
//! spectrum, is derived in [`crate::problem::unknown_texture`]: a tile that N frames see
//! keeps a share of the information in M that belongs to displacements. On faint walls the share
//! falls with more noise; on sharp walls, because of aliasing, it falls with *less* noise. An
//! estimator that knows no more of the wall than its spectrum cannot undercut it; one that knows
//! more, for example that edges are straight, can. `benches/reach.py` computes the share
//! independently.
//!
//! # The bound for an unknown wall
//!
//! Where the wall deviates from its drawing by a random field of known size, the coefficients of
//! its shape ([`crate::parameters::shape`]) are unknowns beside the poses, with the field's prior
//! ([`crate::parameters::wall_prior`]), which ties all of them to each other. All three bounds then
//! are those of poses with the wall unknown.
//!
//! # Accuracy of the bound
//!
//! Slopes are differences over an eighth of a pixel to each side of frames with 4 × 4 times the
//! pixels, interpolated by a cubic. That loses 6 % of the information for the spectrum of bricks,
//! 2.5 % for that of concrete, so both bounds are too large by half of that.
//!
//! Source: C. R. Rao, 1945; H. Cramér, 1946; H. L. van Trees, "Detection, Estimation, and
//! Modulation Theory", 1968.

use crate::error::RefineError;
use crate::linear::normal_equations::{Block, NormalEquations, Pattern};
use crate::linear::selected_inverse::SelectedInverse;
use crate::linear::sparse_cholesky::SymbolicFactorisation;
use crate::model::context::{EstimationContext, FrameWindow};
use crate::model::frame_states::FrameStates;
use crate::model::prior::Prior;
use crate::options::RefineOptions;
use crate::parameters::calibration::{Calibration, Kappa};
use crate::parameters::shape::Shape;
use crate::parameters::wall_prior::{FieldInformation, WallPrior};
use crate::problem::photometric_problem::PhotometricProblem;
use crate::problem::unknown_texture::UnknownTexture;
use crate::samples::footprints::{extent_h_m, footprints};
use crate::samples::sampling::Sampling;
use crate::tiles::interpolation::Interpolation;
use crate::uncertainty::covariance::Covariances;
use nalgebra::Matrix6;
use std::borrow::Cow;
use std::sync::Arc;
use tunnelstitch_core::frames::{FrameCache, GreyImage, PictureNoise, Pyramid};
use tunnelstitch_core::survey::Survey;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::trajectory::{Shutter, poses_of};

/// Factor by which the frames of the bound have more pixels along each axis.
pub const FINER: u32 = 4;
/// Wall samples per fine pixel: slopes of the texture are differences over an eighth of a pixel to
/// each side.
const DENSITY: f64 = 2.0;

/// Covariances that no estimate of the true poses undercuts.
#[derive(Clone, Debug)]
pub struct PoseBounds {
    /// Cramér–Rao bound of unbiased estimates, with the slopes of the texture known.
    pub known: Covariances,
    /// Cramér–Rao bound with the texture unknown but for its spectrum.
    pub unknown: Covariances,
    /// Bayesian bound (van Trees) of estimates that also know the survey's prior, with the slopes
    /// of the texture known.
    pub bayesian: Covariances,
}

/// Computes the bounds for a survey that has true poses.
///
/// `fine` are its frames without noise and with [`FINER`] times as many pixels along each axis: the
/// slopes of what a pixel sees can only be had from finer pixels. `noise_grey`: σ of a pixel, grey
/// levels; `texture`: the spectrum of the wall's texture; `wall`: what is known of its deformation,
/// which the fine frames do not show.
///
/// # Errors
/// [`RefineError`]; also [`RefineError::NoOverlap`] for a survey without true poses.
pub fn pose_bounds(
    survey: &Survey,
    fine: &[GreyImage],
    noise_grey: f64,
    texture: &UnknownTexture,
    wall: &WallPrior,
) -> Result<PoseBounds, RefineError> {
    let Some(truth) = &survey.truth else {
        return Err(RefineError::NoOverlap);
    };
    let count = truth.len();
    let options = RefineOptions::default();
    let prior = Prior::new(
        survey.prior,
        survey.rig.as_ref(),
        &survey.initial,
        &survey.pose_gaps,
        &options,
    );
    let cameras = survey.cameras.map(finer_camera);
    let frames = fine
        .iter()
        .map(|frame| Pyramid::new(average_pixels(frame), 1));
    let frames = FrameCache::of_pyramids(frames);
    // The motion during readout hardly changes the information.
    let shutter = Shutter::default();
    let flat = EstimationContext {
        planned: Arc::clone(&survey.nominal),
        is_deviation_known: survey.bend.is_some() || survey.displacement.is_some(),
        nominal: Arc::clone(&survey.nominal),
        displacement: survey.displacement.as_ref(),
        shape: None,
        points: None,
        surface: Arc::clone(&survey.surface),
        ignored: &survey.ignored,
        cameras: cameras.clone(),
        shutter: &shutter,
        calibration: Calibration::none(cameras),
        kappa: Kappa::zeros(),
        frames: &frames,
        prior: &prior,
        dispersion: 1.0,
        noise: PictureNoise::default(),
    };
    let frames = FrameStates::at(&poses_of(truth), vec![None; count]);
    let extent_h_m = extent_h_m(&footprints(&flat, &frames)?);
    let model = wall.model(survey.nominal.perimeter_m(), extent_h_m);
    let information = wall.information(&model);
    let context = EstimationContext {
        shape: (model.blocks() > 0).then(|| Arc::new(Shape::nominal(model))),
        ..flat
    };
    let estimates = frames.estimates;
    let window = FrameWindow {
        participants: 0..count,
        active: 0..count,
        estimates: &estimates,
        compared: Cow::Owned(vec![true; count]),
    };
    let sampling = Sampling {
        density: DENSITY,
        shape: true,
        interpolation: Interpolation::Bicubic,
        ..Sampling::of(0)
    };
    // One pixel is FINER² fine pixels.
    let noise_grey = f64::from(FINER) * noise_grey;
    let problem = PhotometricProblem::new(&context, sampling, window)?.with_known_noise(noise_grey);
    let unknowns = problem.unknowns_of(&estimates);
    let field = FieldPrior::new(problem.pattern(), count, information);
    let (prior, _) = problem.prior_information(&unknowns, problem.pattern());
    let with_prior = problem.linearise(&estimates)?.normal;
    let bayesian = invert(&problem, &field, &with_prior, count)?;
    let pixels = subtract_pose_prior(problem.pattern(), &prior, with_prior, count);
    let known = invert(&problem, &field, &pixels, count)?;
    let problem = problem.with_unknown_texture(texture);
    let with_prior = problem.linearise(&estimates)?.normal;
    let pixels = subtract_pose_prior(problem.pattern(), &prior, with_prior, count);
    Ok(PoseBounds {
        known,
        unknown: invert(&problem, &field, &pixels, count)?,
        bayesian,
    })
}

/// Subtracts the prior of the poses of `count` frames from the normal equations; exposures and
/// shape keep theirs.
fn subtract_pose_prior(
    pattern: &Pattern,
    prior: &[Block],
    mut normal: NormalEquations,
    count: usize,
) -> NormalEquations {
    // Blocks are in the order of their columns, those of the frames first.
    let of_frames: usize = (0..count).map(|column| pattern.rows(column).len()).sum();
    let blocks = normal.blocks.iter_mut().zip(prior);
    for (block, prior) in blocks.take(of_frames) {
        *block -= pose_part(prior);
    }
    normal
}

/// The prior of the wall's deformation, and the pattern of equations with it.
struct FieldPrior {
    pattern: Pattern,
    /// Blocks by row and column of the pattern.
    information: FieldInformation,
}

impl FieldPrior {
    /// The prior in equations on `without`, where the wall's coefficients come behind `frames`
    /// slots.
    fn new(without: &Pattern, frames: usize, information: FieldInformation) -> Self {
        let place = |((row, column), block)| ((frames + row, frames + column), block);
        let information: FieldInformation = information.into_iter().map(place).collect();
        let columns = without.columns();
        let pairs = (0..columns).flat_map(|k| without.rows(k).iter().map(move |row| (*row, k)));
        let of_field = information.iter().map(|(place, _)| *place);
        Self {
            pattern: Pattern::new(columns, pairs.chain(of_field)),
            information,
        }
    }

    /// The equations with the prior; `normal` is on the pattern `without`.
    fn added_to(&self, without: &Pattern, normal: &NormalEquations) -> NormalEquations {
        let mut sum = NormalEquations::zeros(&self.pattern);
        let mut blocks = normal.blocks.iter();
        for column in 0..without.columns() {
            for (row, block) in without.rows(column).iter().zip(&mut blocks) {
                sum.add_block(&self.pattern, *row, column, block);
            }
        }
        for ((row, column), block) in &self.information {
            sum.add_block(&self.pattern, *row, *column, block);
        }
        sum
    }
}

/// Inverts an information matrix with the prior of the wall, for each of `count` frames and for
/// each pair of neighbours.
fn invert(
    problem: &PhotometricProblem,
    field: &FieldPrior,
    normal: &NormalEquations,
    count: usize,
) -> Result<Covariances, RefineError> {
    let normal = field.added_to(problem.pattern(), normal);
    let symbolic = SymbolicFactorisation::new(&field.pattern);
    let symbolic = symbolic.map_err(|source| problem.factor_error(source))?;
    let factor = symbolic.factorise(&normal, 0.0);
    let inverse = SelectedInverse::new(&factor.map_err(|source| problem.factor_error(source))?);
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
fn pose_part(block: &Block) -> Block {
    let mut pose = Block::zeros();
    pose.fixed_view_mut::<6, 6>(0, 0)
        .copy_from(&block.fixed_view::<6, 6>(0, 0));
    pose
}

/// The camera of frames with pixels [`FINER`] times as fine, each averaged with its neighbours to
/// the right and below: pixel `(u', v')` is centred at `(u'/FINER, v'/FINER)` of the camera's own.
fn finer_camera(camera: &Camera) -> Camera {
    let scale = f64::from(FINER);
    Camera {
        width: FINER * (camera.width - 1) + 1,
        height: FINER * (camera.height - 1) + 1,
        cx: scale * camera.cx,
        cy: scale * camera.cy,
        ..camera.upsampled(FINER)
    }
}

/// Averages [`FINER`] × [`FINER`] fine pixels to the value of a full pixel, at every fine pixel.
fn average_pixels(fine: &GreyImage) -> GreyImage {
    let n = FINER as usize;
    let (width, height) = (fine.width() + 1 - n, fine.height() + 1 - n);
    let mut columns = vec![0.0; fine.width()];
    let mut data = Vec::with_capacity(width * height);
    for y in 0..height {
        for (x, column) in columns.iter_mut().enumerate() {
            *column = (y..y + n).map(|y| fine.at(x, y)).sum::<f32>() / (n * n) as f32;
        }
        data.extend(
            columns
                .windows(n)
                .map(|columns| columns.iter().sum::<f32>()),
        );
    }
    GreyImage::new(width, height, data)
}
