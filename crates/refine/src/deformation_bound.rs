//! Bound of the wall's deformation: what the frames of a survey could tell of it at their initial
//! poses, before anything is refined.
//!
//! The normal equations of poses, exposures, lens and shape are those of a refinement, with the
//! information of an assumed texture ([`crate::problem::assumed_texture`]). With all scales of the
//! shape at the strength of the prior ([`crate::parameters::shape`]), the deformation at a point, a
//! sum `fᵀc` of coefficients without the mean, cos θ and sin θ of every section, has the variance
//! `fᵀ H⁻¹ f`: the Bayesian Cramér–Rao bound (van Trees) for poses and shape that are both unknown.
//!
//! Frames of one turn see the wall along parallel rays; only those of another turn, from elsewhere
//! along the tunnel, tell its shape. So the bound is also computed as if the camera advanced half
//! as much per turn.

use crate::error::RefineError;
use crate::input::RefineInput;
use crate::linear::bordered_system::SchurComplement;
use crate::linear::sparse_cholesky::Factor;
use crate::model::context::FrameWindow;
use crate::options::RefineOptions;
use crate::parameters::frame_estimate::{FRAME_PARAMETERS, FrameEstimate};
use crate::parameters::shape::ShapeModel;
use crate::parameters::shape_functions::ShapeStep;
use crate::parameters::shape_limits::FIRST_FINEST_COLUMNS;
use crate::problem::assumed_texture::AssumedTexture;
use crate::problem::photometric_problem::PhotometricProblem;
use crate::problem::set_up::pixel_size_on_wall;
use crate::samples::sampling::Sampling;
use crate::stages::begin::begin;
use crate::stages::setup::Setup;
use crate::stages::shape;
use nalgebra::SMatrix;
use std::borrow::Cow;
use std::f64::consts::TAU;
use tunnelstitch_core::frames::FrameCache;
use tunnelstitch_core::survey::Survey;
use tunnelstitch_geometry::numerics::median::upper_median;
use tunnelstitch_geometry::surface::{Footprint, WallPoint};
use tunnelstitch_geometry::trajectory::StampedPose;

/// Largest number of frames, from the middle of a survey: five turns of the paper's.
const MAX_FRAMES: usize = 60;
/// Rows of nodes at which the deformation is looked at, at the most.
const MAX_ROWS: usize = 8;
/// Shorter side of the pictures to which information is assigned, pixels: it is spread over the
/// whole picture, whatever its size.
const SHORTER_SIDE: u32 = 60;
/// Harmonics of the section whose amplitude is bounded, from the ovality on.
const HARMONIC_ORDERS: usize = 4;
/// Right sides that are solved for at once.
const BATCH: usize = 16;

/// Texture and noise of pictures of the wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureTexture {
    /// RMS of the texture's slope along either axis, grey levels per pixel.
    pub slope_grey_per_px: f64,
    /// Noise of a pixel, 1-σ in grey levels.
    pub noise_grey: f64,
}

/// The least uncertainty that the deformation of a wall can be measured with.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct DeformationBound {
    /// Distance of the nodes of deformation, metres.
    pub node_m: f64,
    /// 1-σ of the deformation at a node, median between the first and the last camera, metres.
    pub node_sigma_m: f64,
    /// That 1-σ before any frame is seen, metres.
    pub prior_sigma_m: f64,
    /// 1-σ of the amplitudes of cos mθ and sin mθ over the survey, root mean square of both,
    /// m = 2 … 5, metres.
    pub harmonic_sigma_m: [f64; HARMONIC_ORDERS],
    /// [`DeformationBound::node_sigma_m`] if the camera advanced half as much per turn; None if
    /// the tunnel is not straight.
    pub half_advance_sigma_m: Option<f64>,
}

/// Bounds the uncertainty of the deformation of a survey's wall; None if it is said to be exact, or
/// if no frames overlap.
///
/// # Errors
/// [`RefineError`]: poses that cannot be refined.
pub fn deformation_bound(
    survey: &Survey,
    texture: &PictureTexture,
) -> Result<Option<DeformationBound>, RefineError> {
    let frames = middle_frames(survey);
    let initial: Vec<StampedPose> = frames.iter().map(|k| survey.initial[*k]).collect();
    let Some(bound) = bound_at(survey, &frames, &initial, texture)? else {
        return Ok(None);
    };
    let closer = match survey.nominal.gauge().shift {
        true => bound_at(survey, &frames, &with_half_advance(&initial), texture)?,
        false => None,
    };
    Ok(Some(DeformationBound {
        half_advance_sigma_m: closer.map(|closer| closer.node_sigma_m),
        ..bound
    }))
}

/// Indices of up to [`MAX_FRAMES`] frames that show some wall, from the middle of the survey; of a
/// rig, of moments all of whose frames do.
fn middle_frames(survey: &Survey) -> Vec<usize> {
    let shows_wall = |k: usize| {
        let pose = &survey.initial[k].pose;
        Footprint::trace(survey.surface.as_ref(), survey.cameras.of(k), pose).is_ok()
    };
    let count = survey.initial.len();
    let first = count.saturating_sub(MAX_FRAMES) / 2;
    let cameras = survey.cameras.count();
    let moments = (first - first % cameras..count).step_by(cameras);
    let moments = moments.map(|k| k..k + cameras);
    let shown = moments.filter(|moment| moment.clone().all(shows_wall));
    shown.take(MAX_FRAMES / cameras).flatten().collect()
}

/// Poses that advance half as much along a straight tunnel.
fn with_half_advance(initial: &[StampedPose]) -> Vec<StampedPose> {
    let middle = initial.get(initial.len() / 2);
    let middle_m = middle.map_or(0.0, |middle| middle.pose.t_wc.y);
    let closer = |stamped: &StampedPose| {
        let mut closer = *stamped;
        closer.pose.t_wc.y = 0.5 * (middle_m + stamped.pose.t_wc.y);
        closer
    };
    initial.iter().map(closer).collect()
}

/// The bound of frames `frames` at the poses `initial`.
fn bound_at(
    survey: &Survey,
    frames: &[usize],
    initial: &[StampedPose],
    texture: &PictureTexture,
) -> Result<Option<DeformationBound>, RefineError> {
    let files = survey.frames.only(frames);
    let full = survey.cameras.of_frames(frames);
    let level = (full.shorter_side() / SHORTER_SIDE).max(1).ilog2();
    let cameras = full.at_level(level as usize);
    let options = RefineOptions::default();
    let input = RefineInput {
        cameras,
        frames: &files,
        initial,
        pose_gaps: &[],
        ..RefineInput::from(survey)
    };
    let setup = Setup {
        frames: FrameCache::blank(&files, input.cameras.size()),
        ..Setup::new(input, &options)?
    };
    let mut state = begin(&setup);
    let estimates = initial.iter().map(|stamped| stamped.pose);
    state.frames.estimates = estimates.map(FrameEstimate::at).collect();
    shape::begin(&setup, &mut state)?;
    let Some(model) = state.shape.as_ref().map(|shape| shape.model.clone()) else {
        return Ok(None);
    };
    let context = setup.context(&state);
    let window = FrameWindow {
        participants: 0..frames.len(),
        active: 0..frames.len(),
        estimates: &state.frames.estimates,
        compared: Cow::Owned(vec![true; frames.len()]),
    };
    let sampling = Sampling {
        shape: true,
        ..Sampling::of(0)
    };
    let poses = initial.iter().enumerate();
    let poses = poses.map(|(k, stamped)| (k, &stamped.pose));
    let pixel_size_m = pixel_size_on_wall(survey.surface.as_ref(), &full, poses);
    let problem = PhotometricProblem::new(&context, sampling, window)?
        .with_shared_parameters()
        .with_assumed_texture(AssumedTexture {
            slope_grey_per_m: texture.slope_grey_per_px / pixel_size_m,
            // As many pixels as at full size.
            noise_grey: texture.noise_grey / f64::from(1 << level),
        });
    if problem.tiles() == 0 {
        return Ok(None);
    }
    let at = problem.linearise_at(&problem.initial_unknowns())?;
    let factor = problem
        .symbolic()
        .factorise(&at.normal, 0.0)
        .map_err(|source| problem.factor_error(source))?;
    let information = ShapeInformation {
        schur: at.border.map(|border| border.eliminate(&factor, 0.0)),
        factor,
        first_slot: frames.len(),
    };
    let nodes = Nodes::between(&model, survey, initial);
    Ok(information.bound(&model, &nodes))
}

/// Nodes of the finest lattice.
struct Nodes {
    /// Angle θ of the columns, radians.
    thetas: Vec<f64>,
    /// Chainage of the rows, metres.
    rows_m: Vec<f64>,
    perimeter_m: f64,
}

impl Nodes {
    /// The nodes between the first and the last camera.
    fn between(model: &ShapeModel, survey: &Survey, initial: &[StampedPose]) -> Self {
        let chainage = |stamped: &StampedPose| survey.surface.chainage_m(&stamped.pose.t_wc);
        let (from, to) = initial
            .iter()
            .map(chainage)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(from, to), h| {
                (from.min(h), to.max(h))
            });
        let spacing_m = model.spacing_m(FIRST_FINEST_COLUMNS);
        let rows = (((to - from) / spacing_m) as usize + 1).min(MAX_ROWS);
        let row = |k: usize| from + (k as f64 + 0.5) / rows as f64 * (to - from);
        let column = |k: usize| k as f64 / FIRST_FINEST_COLUMNS as f64;
        Self {
            thetas: (0..FIRST_FINEST_COLUMNS).map(|k| TAU * column(k)).collect(),
            rows_m: (0..rows).map(row).collect(),
            perimeter_m: spacing_m * FIRST_FINEST_COLUMNS as f64,
        }
    }

    /// θ and place of every node.
    fn iter(&self) -> impl Iterator<Item = (f64, WallPoint)> + '_ {
        self.rows_m.iter().flat_map(|h_m| {
            self.thetas.iter().map(|theta| {
                let s_m = theta / TAU * self.perimeter_m;
                (*theta, WallPoint { s_m, h_m: *h_m })
            })
        })
    }
}

/// The factorised information of all unknowns, of which the shape is looked at.
struct ShapeInformation<'f> {
    factor: Factor<'f>,
    /// The information of the shared parameters, if there are any.
    schur: Option<SchurComplement>,
    /// Slot of the shape's first block.
    first_slot: usize,
}

/// Sums of coefficients: a column each.
type Sums = SMatrix<f64, FRAME_PARAMETERS, BATCH>;

impl ShapeInformation<'_> {
    /// The bound; None if the shared parameters are not determined.
    fn bound(&self, model: &ShapeModel, nodes: &Nodes) -> Option<DeformationBound> {
        let at_nodes: Vec<Vec<ShapeStep>> = nodes
            .iter()
            .map(|(_, wall)| model.deformation_at(wall))
            .collect();
        let waves: Vec<Vec<ShapeStep>> = (0..2 * HARMONIC_ORDERS)
            .map(|component| mean_wave(component, nodes, &at_nodes))
            .collect();
        let variances = self.variances(&at_nodes)?;
        let of_waves = self.variances(&waves)?;
        let prior = at_nodes.iter().map(|f| prior_variance(model, f));
        Some(DeformationBound {
            node_m: model.spacing_m(FIRST_FINEST_COLUMNS),
            node_sigma_m: upper_median(variances)?.sqrt(),
            prior_sigma_m: upper_median(prior.collect())?.sqrt(),
            harmonic_sigma_m: std::array::from_fn(|k| {
                (0.5 * (of_waves[2 * k] + of_waves[2 * k + 1])).sqrt()
            }),
            half_advance_sigma_m: None,
        })
    }

    /// Variance of each of some sums of coefficients.
    fn variances(&self, sums: &[Vec<ShapeStep>]) -> Option<Vec<f64>> {
        let mut variances = Vec::with_capacity(sums.len());
        for batch in sums.chunks(BATCH) {
            let blocks = batch.first().map_or(0, Vec::len);
            let mut right = vec![Sums::zeros(); self.first_slot + blocks];
            for (k, sum) in batch.iter().enumerate() {
                for (target, block) in right[self.first_slot..].iter_mut().zip(sum) {
                    target.set_column(k, block);
                }
            }
            let solved = self.factor.solve(&right);
            let mut of_batch = vec![0.0; batch.len()];
            for (right, solved) in right.iter().zip(&solved) {
                for (k, variance) in of_batch.iter_mut().enumerate() {
                    *variance += right.column(k).dot(&solved.column(k));
                }
            }
            if let Some(SchurComplement { w, schur }) = &self.schur {
                let shared = w.iter().zip(&right).map(|(w, right)| w.transpose() * right);
                let shared: SMatrix<f64, _, BATCH> = shared.sum();
                let solved = schur.cholesky()?.solve(&shared);
                for (k, variance) in of_batch.iter_mut().enumerate() {
                    *variance += shared.column(k).dot(&solved.column(k));
                }
            }
            variances.extend(of_batch);
        }
        Some(variances)
    }
}

/// The mean amplitude of a wave around the section over all nodes, as a sum of coefficients:
/// cos mθ for even components, sin mθ for odd ones, from m = 2 on.
fn mean_wave(component: usize, nodes: &Nodes, at_nodes: &[Vec<ShapeStep>]) -> Vec<ShapeStep> {
    let order = (2 + component / 2) as f64;
    let count = at_nodes.len() as f64;
    let mut wave = vec![ShapeStep::zeros(); at_nodes.first().map_or(0, Vec::len)];
    for ((theta, _), at_node) in nodes.iter().zip(at_nodes) {
        let (sin, cos) = (order * theta).sin_cos();
        let weight = if component.is_multiple_of(2) {
            cos
        } else {
            sin
        };
        for (sum, block) in wave.iter_mut().zip(at_node) {
            *sum += block * (2.0 * weight / count);
        }
    }
    wave
}

/// Variance of a sum of coefficients by their prior.
fn prior_variance(model: &ShapeModel, sum: &[ShapeStep]) -> f64 {
    let sigmas_m = model.block_sigmas_m().into_iter();
    let squares = sum.iter().zip(sigmas_m);
    squares
        .map(|(block, sigma_m)| block.norm_squared() * sigma_m.powi(2))
        .sum()
}
