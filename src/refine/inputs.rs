//! Everything that is fixed during a refinement: the survey, the options, and what follows from both.

use crate::frames::FrameCache;
use crate::refine::error::RefineError;
use crate::refine::model::context::EstimationContext;
use crate::refine::model::prior::{Prior, median_step_s};
use crate::refine::options::RefineOptions;
use crate::refine::parameters::calibration::{Calibration, Kappa};
use crate::refine::stages::state::PipelineState;
use crate::survey::{CalibrationGroup, Survey};
use crate::trajectory::{Pose, Shutter};

/// The survey and the options of a refinement, with what follows from both.
pub struct Inputs<'a> {
    /// The survey.
    pub survey: &'a Survey,
    /// How to refine.
    pub options: &'a RefineOptions,
    /// The frames' grey pyramids.
    pub frames: FrameCache,
    /// Noise of the initial poses and exposures.
    pub prior: Prior,
    /// The same widened by what the shared parameters may still be off, for registering frames before
    /// they are estimated.
    pub tracking_prior: Prior,
    /// When the rows of the frames are read.
    pub shutter: Shutter,
    /// The shared parameters that are estimated, and their priors.
    pub calibration: Calibration,
}

impl<'a> Inputs<'a> {
    /// Prepares the refinement of `survey`.
    ///
    /// # Errors
    /// [`RefineError::SingleFrame`], [`RefineError::OnlyRound`].
    pub fn new(survey: &'a Survey, options: &'a RefineOptions) -> Result<Self, RefineError> {
        if survey.frames.len() < 2 {
            return Err(RefineError::SingleFrame);
        }
        let coarsest = options.coarsest_level(survey.camera.shorter_side());
        let frames = FrameCache::new(
            &survey.frames,
            &survey.camera,
            coarsest + 1,
            options.cache_bytes,
        );
        let times_s: Vec<f64> = survey
            .initial
            .iter()
            .map(|stamped| stamped.time_s)
            .collect();
        let prior = Prior {
            jitter: survey.prior,
            initial: survey.initial_poses(),
            median_step_s: median_step_s(&times_s),
            times_s,
            log_gain_sigma: options.log_gain_sigma,
            bias_sigma: options.bias_sigma,
        };
        let calibration = calibration_of(survey, options, &prior.initial)?;
        let tracking_prior = Prior {
            jitter: calibration.widen_jitter(&prior.jitter, prior.lever_arm_m()),
            ..prior.clone()
        };
        Ok(Self {
            survey,
            options,
            frames,
            prior,
            tracking_prior,
            shutter: survey.shutter(),
            calibration,
        })
    }

    /// Number of frames.
    pub fn count(&self) -> usize {
        self.survey.frames.len()
    }

    /// The coarsest pyramid level.
    pub fn coarsest_level(&self) -> usize {
        self.options
            .coarsest_level(self.survey.camera.shorter_side())
    }

    /// The finest pyramid level of tracking.
    pub fn handover_level(&self) -> usize {
        self.options
            .handover_level(self.survey.camera.shorter_side())
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
        EstimationContext {
            surface: self.survey.surface.as_ref(),
            ignored: &self.survey.ignored,
            camera: self.survey.camera,
            shutter: &self.shutter,
            calibration: self.calibration,
            kappa: Kappa::zeros(),
            frames: &self.frames,
            prior: &self.prior,
            noise,
        }
    }

    /// The estimation context with the shared parameters as `state` has them.
    pub fn context(&self, state: &PipelineState) -> EstimationContext<'_> {
        EstimationContext {
            calibration: self.calibration_at(state),
            ..self.initial_context(state.noise)
        }
        .at(state.kappa)
    }
}

/// What is to be estimated of the survey's calibration.
///
/// # Errors
/// [`RefineError::OnlyRound`].
fn calibration_of(
    survey: &Survey,
    options: &RefineOptions,
    initial: &[Pose],
) -> Result<Calibration, RefineError> {
    let section = survey.file.calibrate.clone().unwrap_or_default();
    let groups = options.calibrate.as_ref().unwrap_or(&section.unknowns);
    let calibration = if groups.is_empty() {
        Calibration::none(&survey.camera)
    } else {
        Calibration::new(groups, &section, &survey.camera, initial)
    };
    for (group, unknown) in [
        (CalibrationGroup::Radius, "the radius"),
        (CalibrationGroup::Axis, "the axis"),
    ] {
        if groups.contains(&group) && !survey.file.tunnel.is_straight_and_round() {
            return Err(RefineError::OnlyRound { unknown });
        }
    }
    Ok(Calibration {
        readout_s: survey.shutter().readout_s(),
        ..calibration
    })
}
