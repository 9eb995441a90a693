//! Everything that is fixed during a refinement: the input, the options, and what follows from
//! both.

use crate::error::RefineError;
use crate::input::{RefineInput, is_motionless};
use crate::model::context::{EstimationContext, total_displacement};
use crate::model::frame_states::FrameStates;
use crate::model::prior::Prior;
use crate::options::{RefineOptions, ShapeMode};
use crate::parameters::calibration::{
    BEND_INDEX, BEND_PARAMETERS, Calibration, DATUM_PARAMETERS, INTRINSIC_PARAMETERS, Kappa,
    RADIUS_INDEX,
};
use crate::parameters::shape_limits::BEND_RADIUS_RADII;
use crate::point_fit::fit::{FittedWall, PointFit};
use crate::points::wall_points::WallPoints;
use crate::samples::footprints::{extent_h_m, footprints};
use crate::stages::state::PipelineState;
use crate::thresholds::tracking::REGISTERED_SHARE;
use std::sync::Arc;
use tunnelstitch_core::frames::{FrameCache, PictureNoise};
use tunnelstitch_core::survey::{CalibrationGroup, DEFAULT_SHAPE_SIGMA_RADII};
use tunnelstitch_geometry::surface::{RadialField, bent, displaced};
use tunnelstitch_geometry::trajectory::{Jitter, Pose, Rig};

/// The input and the options of a refinement, with what follows from both.
pub struct Setup<'a> {
    /// Frames, poses, cameras and tunnel.
    pub input: RefineInput<'a>,
    /// The options.
    pub options: &'a RefineOptions,
    /// The frames' grey pyramids.
    pub frames: FrameCache,
    /// Noise of the initial poses and exposures.
    pub prior: Prior,
    /// The prior widened by the uncertainty of the shared parameters and, in a rig, of a registered
    /// frame, for registering frames before all are estimated.
    pub tracking_prior: Prior,
    /// The shared parameters that are asked for, and the priors of all.
    pub calibration: Calibration,
    /// 1-σ of the wall's deviation from its nominal shape, metres; 0 if it is exact.
    pub shape_sigma_m: f64,
    /// Known displacement of the wall, beyond which its shape is estimated: that of the input, with
    /// size and axis by measured points.
    pub displacement: Option<RadialField>,
    /// The displacement of the wall until its shape is estimated: with the fit to measured points.
    pub held_displacement: Option<RadialField>,
    /// The wall that fits measured points, if there are any.
    pub wall: Option<FittedWall>,
    /// The bands along the tunnel that have turned out to be hidden, angles θ from and to, radians;
    /// the input ignores them.
    pub hidden_bands: Vec<[f64; 2]>,
}

impl<'a> Setup<'a> {
    /// Prepares a refinement.
    ///
    /// # Errors
    /// [`RefineError::SingleFrame`], [`RefineError::PoseCount`], [`RefineError::NoMotion`],
    /// [`RefineError::OnlyRound`], [`RefineError::LensOfRig`], [`RefineError::GivenByPoints`],
    /// [`RefineError::Points`].
    pub fn new(input: RefineInput<'a>, options: &'a RefineOptions) -> Result<Self, RefineError> {
        if input.frames.len() < 2 {
            return Err(RefineError::SingleFrame);
        }
        let (frames, poses) = (input.frames.len(), input.initial.len());
        if frames != poses {
            return Err(RefineError::PoseCount { frames, poses });
        }
        if is_motionless(input.initial) {
            return Err(RefineError::NoMotion { frames });
        }
        let coarsest = options.coarsest_level(input.cameras.shorter_side());
        let frames = FrameCache::new(
            input.frames,
            input.cameras.size(),
            coarsest + 1,
            options.cache_bytes,
        );
        let prior = Prior::new(
            input.prior,
            input.rig.as_ref(),
            input.initial,
            input.pose_gaps,
            options,
        );
        let calibration = calibration_of(&input, options, &prior.initial)?;
        let tracking_prior = Prior {
            jitter: calibration.widen_jitter(&prior.jitter, prior.lever_arm_m()),
            rig: prior.rig.as_ref().map(|rig| loosened(rig, &prior.jitter)),
            ..prior.clone()
        };
        let shape_sigma_m = match options.shape {
            ShapeMode::Estimated => input.shape_sigma_m,
            ShapeMode::Fixed => 0.0,
        };
        let mut setup = Self {
            displacement: input.displacement.cloned(),
            held_displacement: input.displacement.cloned(),
            wall: None,
            hidden_bands: Vec::new(),
            input,
            options,
            shape_sigma_m,
            frames,
            prior,
            tracking_prior,
            calibration,
        };
        if let Some(points) = setup.input.points {
            setup.fit_wall(points)?;
        }
        Ok(setup)
    }

    /// Fits the wall to measured points, and takes over its bend and its displacement.
    ///
    /// # Errors
    /// [`RefineError::GivenByPoints`], [`RefineError::Points`]; an initial pose outside the tunnel.
    fn fit_wall(&mut self, points: &WallPoints) -> Result<(), RefineError> {
        let free = &self.calibration.free;
        for (k, unknown) in [(RADIUS_INDEX, "the radius"), (RADIUS_INDEX + 1, "the axis")] {
            if free[k] {
                return Err(RefineError::GivenByPoints { unknown });
            }
        }
        let frames = FrameStates::at(&self.prior.initial, vec![None; self.count()]);
        let [from, to] = extent_h_m(&footprints(
            &self.initial_context(PictureNoise::default()),
            &frames,
        )?);
        let radius_m = self.input.nominal_radius_m;
        let wall = PointFit {
            points,
            planned: &self.input.surface,
            known: self.displacement.as_ref(),
            may_bend: self.may_bend(),
            middle_h_m: self.calibration.middle_h_m,
            extent_h_m: [from - radius_m, to + radius_m],
            shape_sigma_m: match self.input.shape_sigma_m {
                0.0 => DEFAULT_SHAPE_SIGMA_RADII * radius_m,
                given_m => given_m,
            },
            radius_m,
            alpha: self.options.false_alarm_rate,
        }
        .run()?;
        if let Some((bend, _)) = wall.bend {
            self.input.surface = bent(&self.input.surface, Some(bend));
            self.input.bend = Some(bend);
            if !self.input.as_built {
                for prior in [&mut self.prior, &mut self.tracking_prior] {
                    let initial = prior.initial.iter_mut();
                    initial.for_each(|pose| *pose = bend.bent(pose));
                }
            }
        }
        let displacement = &wall.displacement;
        self.held_displacement = total_displacement(Some(displacement), wall.shape.field());
        self.displacement = Some(displacement.clone());
        self.wall = Some(wall);
        Ok(())
    }

    /// Number of frames.
    pub fn count(&self) -> usize {
        self.input.frames.len()
    }

    /// The coarsest pyramid level.
    pub fn coarsest_level(&self) -> usize {
        self.options
            .coarsest_level(self.input.cameras.shorter_side())
    }

    /// The finest pyramid level of tracking.
    pub fn handover_level(&self) -> usize {
        self.options
            .handover_level(self.input.cameras.shorter_side())
    }

    /// The shared parameters with those fixed that have turned out unobservable.
    pub fn calibration_at(&self, state: &PipelineState) -> Calibration {
        Calibration {
            free: state.free,
            tested: state.tested,
            ..self.calibration.clone()
        }
    }

    /// The estimation context before anything is estimated, with pictures of this `noise`.
    pub fn initial_context(&self, noise: PictureNoise) -> EstimationContext<'_> {
        let planned = Arc::clone(&self.input.surface);
        let displacement = self.held_displacement.as_ref();
        EstimationContext {
            surface: displaced(&planned, displacement.cloned()),
            nominal: Arc::clone(&planned),
            planned,
            is_deviation_known: self.input.bend.is_some() || displacement.is_some(),
            displacement,
            shape: None,
            points: (self.wall.as_ref()).map(|wall| Arc::clone(&wall.observations)),
            ignored: self.input.ignored,
            cameras: self.input.cameras.clone(),
            shutter: &self.input.shutter,
            calibration: self.calibration.clone(),
            kappa: Kappa::zeros(),
            frames: &self.frames,
            prior: &self.prior,
            noise,
            dispersion: 1.0,
        }
    }

    /// The estimation context with shared parameters and shape as `state` has them.
    pub fn context(&self, state: &PipelineState) -> EstimationContext<'_> {
        let initial = self.initial_context(state.noise);
        EstimationContext {
            displacement: match &state.shape {
                Some(_) => self.displacement.as_ref(),
                None => initial.displacement,
            },
            shape: state.shape.clone().map(Arc::new),
            calibration: self.calibration_at(state),
            dispersion: state.dispersion,
            ..initial
        }
        .at(state.kappa)
    }

    /// True if a curvature can be estimated: if the tunnel is planned straight, and nothing else
    /// is asked for or was measured that says where its axis is.
    pub fn may_bend(&self) -> bool {
        let datum = INTRINSIC_PARAMETERS..INTRINSIC_PARAMETERS + DATUM_PARAMETERS;
        let is_straight = self.input.surface.gauge().shift && self.input.bend.is_none();
        is_straight && self.wall.is_none() && !self.calibration.free[datum].contains(&true)
    }

    /// Replaces the shared parameters of a state, and carries its frames along with the curvature.
    pub fn replace_kappa(&self, state: &mut PipelineState, kappa: Kappa) {
        for estimate in &mut state.frames.estimates {
            estimate.pose = self.calibration.carry(&estimate.pose, &state.kappa, &kappa);
        }
        state.kappa = kappa;
    }
}

/// A rig for registering frames one after another: the place of a camera by that of another one is
/// as uncertain as the other's, which until all are solved together is a share of the noise of a
/// step.
fn loosened(rig: &Rig, jitter: &Jitter) -> Rig {
    let [x, y, z] = jitter.translation_sigma_m;
    let rotation_rad = REGISTERED_SHARE * jitter.rotation_sigma_rad;
    let translation_m = REGISTERED_SHARE * x.min(y).min(z);
    rig.clone().with_sigmas(
        rig.rotation_sigma_rad.hypot(rotation_rad),
        rig.translation_sigma_m.hypot(translation_m),
    )
}

/// The shared parameters to be estimated, with their priors.
///
/// # Errors
/// [`RefineError::OnlyRound`], [`RefineError::LensOfRig`].
pub fn calibration_of(
    input: &RefineInput,
    options: &RefineOptions,
    initial: &[Pose],
) -> Result<Calibration, RefineError> {
    let section = &input.calibrate;
    let groups = options.calibrate.as_ref().unwrap_or(&section.unknowns);
    let lens = |group: &&CalibrationGroup| {
        use CalibrationGroup::{Centre, Distortion, Focal};
        matches!(group, Focal | Centre | Distortion)
    };
    if input.cameras.is_rig() && groups.iter().any(|group| lens(&group)) {
        return Err(RefineError::LensOfRig);
    }
    let calibration = Calibration::new(groups, section, &input.cameras, initial);
    let is_straight_and_round = input.surface.gauge().degrees_of_freedom() == 2;
    for (group, unknown) in [
        (CalibrationGroup::Radius, "the radius"),
        (CalibrationGroup::Axis, "the axis"),
    ] {
        if groups.contains(&group) && !is_straight_and_round {
            return Err(RefineError::OnlyRound { unknown });
        }
    }
    let mut sigma = calibration.sigma;
    let bend_sigma = 1.0 / (BEND_RADIUS_RADII * input.nominal_radius_m);
    sigma
        .fixed_rows_mut::<BEND_PARAMETERS>(BEND_INDEX)
        .fill(bend_sigma);
    Ok(Calibration {
        sigma,
        readout_s: input.shutter.readout_s(),
        ..calibration
    })
}
