//! Everything that is fixed during a refinement: the input, the options, and what follows from
//! both.

use crate::error::RefineError;
use crate::input::RefineInput;
use crate::model::context::EstimationContext;
use crate::model::prior::{Prior, median_step_s};
use crate::options::{RefineOptions, ShapeMode};
use crate::parameters::calibration::{Calibration, Kappa};
use crate::stages::state::PipelineState;
use std::sync::Arc;
use tunnelstitch_core::frames::FrameCache;
use tunnelstitch_core::survey::CalibrationGroup;
use tunnelstitch_geometry::surface::displaced;
use tunnelstitch_geometry::trajectory::{Pose, poses_of};

/// The input and the options of a refinement, with what follows from both.
pub struct Setup<'a> {
    /// Frames, poses, camera and tunnel.
    pub input: RefineInput<'a>,
    /// The options.
    pub options: &'a RefineOptions,
    /// The frames' grey pyramids.
    pub frames: FrameCache,
    /// Noise of the initial poses and exposures.
    pub prior: Prior,
    /// The prior widened by the uncertainty of the shared parameters, for registering frames before
    /// these are estimated.
    pub tracking_prior: Prior,
    /// The shared parameters that are asked for, and the priors of all.
    pub calibration: Calibration,
    /// 1-σ of the wall's deviation from its nominal shape, metres; 0 if it is exact.
    pub shape_sigma_m: f64,
}

impl<'a> Setup<'a> {
    /// Prepares a refinement.
    ///
    /// # Errors
    /// [`RefineError::SingleFrame`], [`RefineError::PoseCount`], [`RefineError::OnlyRound`].
    pub fn new(input: RefineInput<'a>, options: &'a RefineOptions) -> Result<Self, RefineError> {
        if input.frames.len() < 2 {
            return Err(RefineError::SingleFrame);
        }
        let (frames, poses) = (input.frames.len(), input.initial.len());
        if frames != poses {
            return Err(RefineError::PoseCount { frames, poses });
        }
        let coarsest = options.coarsest_level(input.camera.shorter_side());
        let frames = FrameCache::new(
            input.frames,
            &input.camera,
            coarsest + 1,
            options.cache_bytes,
        );
        let times_s: Vec<f64> = input.initial.iter().map(|stamped| stamped.time_s).collect();
        let prior = Prior {
            jitter: input.prior,
            initial: poses_of(input.initial),
            median_step_s: median_step_s(&times_s),
            times_s,
            log_gain_sigma: options.log_gain_sigma,
            bias_sigma: options.bias_sigma,
        };
        let calibration = calibration_of(&input, options, &prior.initial)?;
        let tracking_prior = Prior {
            jitter: calibration.widen_jitter(&prior.jitter, prior.lever_arm_m()),
            ..prior.clone()
        };
        let shape_sigma_m = match options.shape {
            ShapeMode::Estimated => input.shape_sigma_m,
            ShapeMode::Fixed => 0.0,
        };
        Ok(Self {
            input,
            options,
            shape_sigma_m,
            frames,
            prior,
            tracking_prior,
            calibration,
        })
    }

    /// Number of frames.
    pub fn count(&self) -> usize {
        self.input.frames.len()
    }

    /// The coarsest pyramid level.
    pub fn coarsest_level(&self) -> usize {
        self.options
            .coarsest_level(self.input.camera.shorter_side())
    }

    /// The finest pyramid level of tracking.
    pub fn handover_level(&self) -> usize {
        self.options
            .handover_level(self.input.camera.shorter_side())
    }

    /// The shared parameters with those fixed that have turned out unobservable.
    pub fn calibration_at(&self, state: &PipelineState) -> Calibration {
        Calibration {
            free: state.free,
            ..self.calibration
        }
    }

    /// The estimation context before anything is estimated, with the sensor's noise of 1-σ `noise`
    /// grey levels.
    pub fn initial_context(&self, noise: f64) -> EstimationContext<'_> {
        let nominal = Arc::clone(&self.input.surface);
        let surface = displaced(&nominal, self.input.displacement.cloned());
        EstimationContext {
            nominal,
            displacement: self.input.displacement,
            shape: None,
            surface,
            ignored: self.input.ignored,
            camera: self.input.camera,
            shutter: &self.input.shutter,
            calibration: self.calibration,
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
        let surface = match &state.shape {
            Some(shape) => initial.surface_with(shape),
            None => Arc::clone(&initial.surface),
        };
        EstimationContext {
            shape: state.shape.clone().map(Arc::new),
            surface,
            calibration: self.calibration_at(state),
            dispersion: state.dispersion,
            ..initial
        }
        .at(state.kappa)
    }
}

/// The shared parameters to be estimated, with their priors.
///
/// # Errors
/// [`RefineError::OnlyRound`].
fn calibration_of(
    input: &RefineInput,
    options: &RefineOptions,
    initial: &[Pose],
) -> Result<Calibration, RefineError> {
    let section = &input.calibrate;
    let groups = options.calibrate.as_ref().unwrap_or(&section.unknowns);
    let calibration = Calibration::new(groups, section, &input.camera, initial);
    let is_straight_and_round = input.surface.gauge().degrees_of_freedom() == 2;
    for (group, unknown) in [
        (CalibrationGroup::Radius, "the radius"),
        (CalibrationGroup::Axis, "the axis"),
    ] {
        if groups.contains(&group) && !is_straight_and_round {
            return Err(RefineError::OnlyRound { unknown });
        }
    }
    Ok(Calibration {
        readout_s: input.shutter.readout_s(),
        ..calibration
    })
}
