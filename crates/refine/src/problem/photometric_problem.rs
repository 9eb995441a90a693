//! The photometric problem over a window of frames at one pyramid level.

use crate::joint::joint_block::WallModel;
use crate::linear::factor_error::FactorError;
use crate::linear::normal_equations::Pattern;
use crate::linear::sparse_cholesky::SymbolicFactorisation;
use crate::model::context::{EstimationContext, FrameWindow};
use crate::model::problem_error::ProblemError;
use crate::parameters::calibration::{BEND_INDEX, Kappa, SHARED_PARAMETERS};
use crate::parameters::frame_estimate::{FrameEstimate, FrameStep};
use crate::parameters::shape::Shape;
use crate::parameters::unknowns::Unknowns;
use crate::points::equations::PointEquations;
use crate::problem::assumed_texture::AssumedTexture;
use crate::problem::linearisation::Linearisation;
use crate::problem::set_up::{min_density, normal_pattern, pixel_size_on_wall, pose_frames};
use crate::problem::unknown_texture::UnknownTexture;
use crate::samples::excluded_tiles::ExcludedTiles;
use crate::samples::sampling::Sampling;
use crate::samples::tile_coverage::{FrameImages, TileCoverage};
use crate::samples::visibility::Exclusions;
use crate::tiles::denoising::Denoiser;
use crate::tiles::frame_samples::SampledFrame;
use crate::tiles::grid::{BLOCK, WallGrid};
use crate::tiles::residual_weighting::NoiseModel;
use std::ops::Range;
use std::sync::Arc;
use tunnelstitch_core::frames::Pyramid;
use tunnelstitch_core::survey::MaskedWall;
use tunnelstitch_geometry::camera::{Camera, Cameras, Sweep};
use tunnelstitch_geometry::surface::Surface;

/// The objective ([`crate::tiles::tile`]) for a window of frames on a fixed set of wall
/// samples.
///
/// `participants` are sampled; of them the `active` frames are estimated and the others held fixed.
/// The wall is processed in stretches along the tunnel, so that memory for frames and samples does
/// not grow with its length.
///
/// With a rolling shutter, the motion of each camera during its readout is that of the initial
/// estimates and stays constant. A step of a frame by ξ changes its neighbours' motion by
/// `readout/(2 interval) ξ`, a few hundredths; the next solve removes the rest.
pub struct PhotometricProblem<'a> {
    /// Inputs of the estimator.
    pub(super) context: EstimationContext<'a>,
    /// Resolution and share of the samples.
    pub(super) sampling: Sampling,
    /// Images of the participants.
    pub(super) images: FrameImages<'a>,
    /// The cameras at the pyramid level.
    pub(super) cameras: Cameras,
    /// Lattice of the samples.
    pub(super) grid: WallGrid,
    /// Frames that are sampled.
    pub(super) participants: Range<usize>,
    /// Frames of them that are estimated.
    pub(super) active: Range<usize>,
    /// Initial estimates of all participants.
    pub(super) estimates: Vec<FrameEstimate>,
    /// Motion of each participant's camera during a readout of one second.
    pub(super) rates: Vec<Sweep>,
    /// Observations of the samples.
    pub(crate) coverage: TileCoverage<'a>,
    /// Tiles that the outlier mask has excluded frames from.
    pub(super) excluded_tiles: ExcludedTiles,
    /// The first active frame that is compared, counted from the first active one; the gauge is
    /// constrained there.
    pub(super) gauge_slot: Option<usize>,
    /// Number of frames that are compared.
    pub(super) compared: usize,
    /// Sparsity pattern of the normal matrix.
    pub(super) pattern: Pattern,
    /// Symbolic factorisation of the normal matrix.
    pub(super) symbolic: SymbolicFactorisation,
    /// Noise of a pixel, 1-σ in grey levels.
    pub(super) sigma: f64,
    /// Variance of unit weight, grey levels²: `σ²` where samples are weighted by their variances
    /// ([`crate::tiles::residual_weighting::NoiseHistogram::unit_variance`]).
    pub(super) unit_variance: f64,
    /// Noise model of the residuals.
    pub(super) noise: NoiseModel,
    /// Filter of the fused texture for its slopes.
    pub(super) denoiser: Option<Denoiser>,
    /// Roughness and stiffness of the wall, if it is solved for jointly with the poses.
    pub(super) wall_model: Option<WallModel>,
    /// Information of the slopes, if the texture is known by its spectrum only.
    pub(super) unknown_texture: Option<UnknownTexture>,
    /// The texture that takes the place of the frames' pixels.
    pub(super) assumed_texture: Option<AssumedTexture>,
    /// True if the shared parameters are estimated.
    pub(super) estimates_shared: bool,
    /// The wall's shape, if it is estimated.
    pub(super) shape: Option<Arc<Shape>>,
    /// Equations of measured points in its coefficients.
    pub(super) points: Option<Arc<PointEquations>>,
    /// Cost and normal equations at the initial unknowns, if they are known already.
    pub(super) initial: Option<Linearisation>,
}

impl<'a> PhotometricProblem<'a> {
    /// Selects the wall samples for the given estimates and estimates the noise from the residuals
    /// there.
    ///
    /// # Errors
    /// [`ProblemError`].
    pub fn new(
        context: &EstimationContext<'a>,
        sampling: Sampling,
        window: FrameWindow,
    ) -> Result<Self, ProblemError> {
        let Sampling { level, density, .. } = sampling;
        let cameras = context.cameras.at_level(level);
        let rate = |frame| context.sweep_rate(frame, &window.participants, window.estimates);
        let rates: Vec<Sweep> = window.participants.clone().map(rate).collect();
        let posed = pose_frames(context, &cameras, &window, &rates)?;
        let FrameWindow {
            participants,
            active,
            estimates,
            compared,
        } = window;
        let compared_frames = compared.iter().filter(|compared| **compared).count();
        let gauge_slot = active
            .clone()
            .position(|frame| compared[frame - participants.start]);
        let poses = posed.iter().flatten();
        let poses = poses.map(|frame| (frame.index, &frame.pose));
        let pixel_size_m = pixel_size_on_wall(context.surface.as_ref(), &cameras, poses);
        let density = density.max(min_density(cameras.size()[1]));
        let grid = WallGrid::new(context.surface.as_ref(), pixel_size_m, density);
        // Where the last solve begins is not to matter.
        let grid = match sampling.variance_weighting {
            true => grid.squared(),
            false => grid,
        };
        let images = FrameImages {
            frames: context.frames,
            first: participants.start,
        };
        let exclusions = Exclusions {
            ignored: context.ignored,
            masks: context.frames.masks(),
        };
        let coverage = TileCoverage::new(
            Arc::clone(&context.surface),
            grid,
            cameras.clone(),
            images,
            exclusions,
            posed,
        );
        let shape = context.shape.clone().filter(|_| sampling.shape);
        let frames = (participants.start, &active);
        let points = shape.as_deref().zip(context.points.as_ref());
        let points = points
            .map(|(shape, points)| Arc::new(PointEquations::new(Arc::clone(points), &shape.model)));
        let of_shape = shape.as_deref().map(|shape| (shape, points.as_deref()));
        let pattern = normal_pattern(context, &coverage, &grid, frames, of_shape);
        let symbolic =
            SymbolicFactorisation::new(&pattern).map_err(|source| ProblemError::Factor {
                first: active.start,
                last: active.end - 1,
                source,
            })?;
        let mut problem = Self {
            context: context.clone(),
            sampling,
            images,
            cameras,
            grid,
            estimates: estimates.to_vec(),
            rates,
            coverage,
            excluded_tiles: ExcludedTiles::default(),
            gauge_slot,
            compared: compared_frames,
            pattern,
            symbolic,
            participants,
            active,
            sigma: 1.0,
            unit_variance: 1.0,
            noise: NoiseModel {
                floor: 1.0,
                steepness: 0.0,
            },
            denoiser: None,
            wall_model: None,
            unknown_texture: None,
            assumed_texture: None,
            estimates_shared: false,
            shape,
            points,
            initial: None,
        };
        problem.estimate_noise()?;
        if sampling.joint {
            problem.wall_model = problem.estimate_wall_model()?;
        }
        Ok(problem)
    }

    /// Sets the noise of a pixel to `sigma` grey levels, for frames that were rendered without
    /// noise: no residual is rejected, and the slopes are not denoised.
    pub fn with_known_noise(self, sigma: f64) -> Self {
        Self {
            sigma,
            unit_variance: sigma * sigma,
            noise: NoiseModel {
                floor: f32::MAX,
                steepness: 0.0,
            },
            denoiser: None,
            ..self
        }
    }

    /// Reduces the information to that of a texture which is known by its spectrum only.
    pub fn with_unknown_texture(self, texture: &UnknownTexture) -> Self {
        Self {
            unknown_texture: Some(texture.clone()),
            ..self
        }
    }

    /// Assumes a texture of the wall in place of what the pixels show.
    pub fn with_assumed_texture(self, texture: AssumedTexture) -> Self {
        Self {
            assumed_texture: Some(texture),
            ..self.with_known_noise(texture.noise_grey)
        }
    }

    /// Estimates or tests the context's shared parameters as well, if all participants are active.
    pub fn with_shared_parameters(self) -> Self {
        Self {
            estimates_shared: (0..SHARED_PARAMETERS)
                .any(|k| self.context.calibration.has_equations(k))
                && self.held_frame_count() == 0,
            ..self
        }
    }

    /// The shared parameters that are tested only.
    pub fn tested(&self) -> &[bool; SHARED_PARAMETERS] {
        &self.context.calibration.tested
    }

    /// Share of the noise in the energy of the slopes that align frames, 0 to 1; 0 if they are not
    /// filtered.
    pub fn slope_noise(&self) -> f64 {
        self.denoiser
            .as_ref()
            .map_or(0.0, |denoiser| denoiser.slope_noise)
    }

    /// Cost and normal equations at the initial unknowns, if they are known already.
    pub fn initial_linearisation(&self) -> Option<&Linearisation> {
        self.initial.as_ref()
    }

    /// Takes cost and normal equations at the initial unknowns; only once.
    pub fn take_initial_linearisation(&mut self) -> Option<Linearisation> {
        self.initial.take()
    }

    /// Initial values of the unknowns.
    pub fn initial_unknowns(&self) -> Unknowns {
        let first = self.active.start - self.participants.start;
        self.unknowns_of(&self.estimates[first..first + self.active.len()])
    }

    /// Estimates of the active frames with the initial values of all other unknowns.
    pub fn unknowns_of(&self, active: &[FrameEstimate]) -> Unknowns {
        let shape = self.shape.as_ref();
        Unknowns {
            frames: active.to_vec(),
            kappa: self.context.kappa,
            shape: shape.map_or_else(Vec::new, |shape| shape.coefficients.clone()),
        }
    }

    /// The wall with the shape of some unknowns.
    pub(super) fn surface_at(&self, unknowns: &Unknowns) -> Arc<dyn Surface> {
        let shape = self.shape.as_ref().map(|shape| Shape {
            model: shape.model.clone(),
            coefficients: unknowns.shape.clone(),
        });
        match &shape {
            None if unknowns.kappa == self.context.kappa => Arc::clone(&self.context.surface),
            None => (self.context).surface_at(&unknowns.kappa, self.context.shape.as_deref()),
            shape => self.context.surface_at(&unknowns.kappa, shape.as_ref()),
        }
    }

    /// The unknowns after a step of every slot and of the shared parameters; frames are carried
    /// along with the tunnel's curvature.
    pub(crate) fn stepped(
        &self,
        unknowns: &Unknowns,
        step: &[FrameStep],
        shared: &Kappa,
    ) -> Unknowns {
        let (from, to) = (&unknowns.kappa, unknowns.kappa + shared);
        let mut stepped = unknowns.stepped(step, shared);
        for frame in &mut stepped.frames {
            frame.pose = self.context.calibration.carry(&frame.pose, from, &to);
        }
        stepped
    }

    /// The shape that is estimated, at its initial values.
    pub fn shape(&self) -> Option<&Shape> {
        self.shape.as_deref()
    }

    /// Equations of measured points in the coefficients of the shape, if there are any.
    pub fn points(&self) -> Option<&PointEquations> {
        self.points.as_deref()
    }

    /// The block pattern of the normal matrix.
    pub fn pattern(&self) -> &Pattern {
        &self.pattern
    }

    /// The symbolic factorisation of the normal matrix.
    pub fn symbolic(&self) -> &SymbolicFactorisation {
        &self.symbolic
    }

    /// Number of selected tiles.
    pub fn tiles(&self) -> usize {
        self.coverage.tiles
    }

    /// True if the wall is solved for jointly with the poses: if the sampling requests it and the
    /// wall has detail finer than pixels.
    pub fn is_joint(&self) -> bool {
        self.wall_model.is_some()
    }

    /// The wall where the outlier mask has excluded frames, of the problem's lattice.
    pub fn masked_wall(&self) -> MaskedWall {
        let perimeter_m = self.context.surface.perimeter_m();
        self.excluded_tiles.masked_wall(&self.grid, perimeter_m)
    }

    /// Height of a block of the wall ([`crate::tiles::grid::BLOCK`]), metres.
    pub fn block_size_m(&self) -> f64 {
        BLOCK as f64 * self.grid.tile_size_m().1
    }

    /// Estimated noise of a pixel, 1-σ in grey levels.
    pub fn sigma(&self) -> f64 {
        self.sigma
    }

    /// Dispersion by which the information of the pixels is divided, 1 or more.
    pub fn dispersion(&self) -> f64 {
        self.context.dispersion
    }

    /// Information of a pixel's grey value: the inverse of the variance of unit weight times the
    /// dispersion.
    pub fn information(&self) -> f64 {
        1.0 / (self.unit_variance * self.context.dispersion)
    }

    /// Turns a factorisation failure into an error that names the frames.
    pub fn factor_error(&self, source: FactorError) -> ProblemError {
        ProblemError::Factor {
            first: self.active.start,
            last: self.active.end - 1,
            source,
        }
    }

    /// The camera at full size with the motion of a participant.
    pub fn camera_of(&self, participant: usize) -> Camera {
        let readout_s = self.context.calibration.readout_s(&self.context.kappa);
        let sweep = self.rates[participant].scaled(readout_s);
        let frame = self.participants.start + participant;
        self.context.cameras.of(frame).with_sweep(&sweep)
    }

    /// The frames of a stretch at the given estimates of all participants, taken by `cameras` (of
    /// the level) with a readout of `readout_s` seconds, along the wall `surface`.
    pub(super) fn sampled_frames<'s>(
        &self,
        stretch: usize,
        pyramids: &'s [Arc<Pyramid>],
        estimates: &[FrameEstimate],
        cameras: &Cameras,
        (surface, readout_s): (&dyn Surface, f64),
    ) -> Vec<SampledFrame<'s>> {
        let frames = self.coverage.frames(stretch).iter();
        let may_bend = self.context.calibration.has_equations(BEND_INDEX);
        frames
            .zip(pyramids)
            .map(|(k, pyramid)| {
                let frame = SampledFrame::new(
                    pyramid.level(self.sampling.level),
                    cameras
                        .of(self.participants.start + *k)
                        .with_sweep(&self.rates[*k].scaled(readout_s)),
                    &estimates[*k],
                )
                .with_interpolation(self.sampling.interpolation);
                match may_bend {
                    true => frame.with_straightened(surface),
                    false => frame,
                }
            })
            .collect()
    }

    /// The frames of a stretch at the initial estimates.
    pub(super) fn initial_sampled_frames<'s>(
        &self,
        stretch: usize,
        pyramids: &'s [Arc<Pyramid>],
    ) -> Vec<SampledFrame<'s>> {
        let readout_s = self.context.calibration.readout_s(&self.context.kappa);
        let wall = (self.context.surface.as_ref(), readout_s);
        self.sampled_frames(stretch, pyramids, &self.estimates, &self.cameras, wall)
    }

    /// Estimates of all participants, with those of the active frames replaced.
    pub(super) fn with_active(&self, active: &[FrameEstimate]) -> Vec<FrameEstimate> {
        let mut estimates = self.estimates.clone();
        let first = self.active.start - self.participants.start;
        estimates[first..first + active.len()].copy_from_slice(active);
        estimates
    }

    /// Number of participants that are held fixed.
    pub(super) fn held_frame_count(&self) -> usize {
        self.participants.len() - self.active.len()
    }

    /// Index of a participant among the active frames, if it is one.
    pub(super) fn slot(&self, participant: usize) -> Option<usize> {
        let frame = self.participants.start + participant;
        self.active
            .contains(&frame)
            .then(|| frame - self.active.start)
    }

    /// Number of degrees of freedom of the poses that the gauge constraint removes.
    pub fn constrained_gauge_freedoms(&self) -> usize {
        match self.held_frame_count() {
            0 if self.context.points.is_some() => self.context.planned.gauge().degrees_of_freedom(),
            0 => self.context.gauge().degrees_of_freedom(),
            _ => 0,
        }
    }
}
