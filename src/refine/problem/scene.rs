//! What a problem is made of.

use crate::camera::{Camera, Sweep};
use crate::frames::{FrameCache, FrameError};
use crate::persist::checkpoint::CheckpointError;
use crate::refine::calibration::{Calibration, Kappa};
use crate::refine::estimate::FrameEstimate;
use crate::refine::factor::FactorError;
use crate::refine::interpolation::Interpolation;
use crate::refine::prior::{Prior, predict};
use crate::surface::{Surface, SurfaceError, WallRegions};
use crate::trajectory::{Pose, Shutter};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::ops::Range;

/// How finely a problem looks at the wall.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sampling {
    /// Pyramid level of the frames; 0 is full size.
    pub level: usize,
    /// Wall samples per pixel along each axis.
    pub density: f64,
    /// Share of the information that is used: the tiles that tell most are chosen until they hold
    /// it ([`crate::refine::choice`]).
    pub information: f64,
    /// Between pixels.
    pub interpolation: Interpolation,
    /// Whether samples weigh by their variance, steep ones less
    /// ([`crate::refine::robust::NoiseModel`]): only once the frames are aligned; before that,
    /// residuals at steep places are what aligns them.
    pub by_variance: bool,
    /// Whether the wall is solved for at the density of the samples, jointly with the poses
    /// ([`crate::refine::joint`]): at full size only.
    pub joint: bool,
}

impl Sampling {
    /// A pyramid level with one sample per pixel, everywhere.
    pub fn of(level: usize) -> Self {
        Self {
            level,
            density: 1.0,
            information: 1.0,
            interpolation: Interpolation::Bilinear,
            by_variance: false,
            joint: false,
        }
    }
}

/// Everything the estimator is given.
#[derive(Clone, Copy)]
pub struct Scene<'a> {
    /// The tunnel.
    pub surface: &'a dyn Surface,
    /// Parts of the wall by which frames are not compared.
    pub ignored: &'a WallRegions,
    /// The camera at full size, as far as it is known by now, at rest.
    pub camera: Camera,
    /// When the rows of the frames are read.
    pub shutter: &'a Shutter,
    /// What all frames share and may be estimated.
    pub calibration: Calibration,
    /// Its unknowns by now; the camera is that of these.
    pub kappa: Kappa,
    /// The frames.
    pub frames: &'a FrameCache,
    /// Noise of the initial poses and exposures.
    pub prior: &'a Prior,
    /// The sensor's noise, 1-σ in grey levels, as single pictures show it.
    pub noise: f64,
    /// Whether the derivative takes the gradient of the fused texture, or each frame's own.
    pub fused_gradient: bool,
}

impl Scene<'_> {
    /// The same with the shared unknowns at `kappa`; as it is where they make no camera.
    pub fn at(self, kappa: Kappa) -> Self {
        match self.calibration.camera(&kappa) {
            Some(camera) => Self {
                camera,
                kappa,
                ..self
            },
            None => self,
        }
    }

    /// How the camera moves while frame `frame` is read, with the frames `run` at their
    /// `estimates`.
    ///
    /// Neighbours outside the run (not placed yet, say) are where the initial steps from the frame
    /// lead.
    pub fn sweep(&self, frame: usize, run: &Range<usize>, estimates: &[FrameEstimate]) -> Sweep {
        let readout_s = self.calibration.readout_s(&self.kappa);
        if readout_s == 0.0 {
            Sweep::default()
        } else {
            self.sweep_rate(frame, run, estimates).scaled(readout_s)
        }
    }

    /// The same if the readout took a second.
    pub fn sweep_rate(
        &self,
        frame: usize,
        run: &Range<usize>,
        estimates: &[FrameEstimate],
    ) -> Sweep {
        let estimate = |k: usize| estimates.get(k.checked_sub(run.start)?);
        let metric = self.calibration.metric(&self.kappa);
        let initial = |k: usize| {
            let pose = self.prior.initial.get(k)?;
            Some(metric.place_nominal(pose))
        };
        self.shutter.rate(frame, |k| {
            let expected = |own: &Pose| Some(predict(own, &initial(frame)?, &initial(k)?));
            match estimate(k) {
                Some(estimate) => Some(estimate.pose),
                None => expected(&estimate(frame)?.pose),
            }
        })
    }
}

/// The frames that take part in a problem.
pub struct Members<'m> {
    /// A run of frames.
    pub participants: Range<usize>,
    /// Those of them that are estimated; the others are held.
    pub active: Range<usize>,
    /// Estimates of the participants.
    pub estimates: &'m [FrameEstimate],
    /// Which participants' pixels are compared; for the others only the prior speaks.
    pub compared: Cow<'m, [bool]>,
}

/// Why a problem cannot be set up or solved.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ProblemError {
    /// A frame cannot be read any more.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// A frame's pose does not go with the tunnel.
    #[error("frame {frame}: {source}; check the initial poses, radius_m and the calibration")]
    Placement {
        /// The frame.
        frame: usize,
        /// What is wrong.
        source: SurfaceError,
    },
    /// The normal equations have no solution.
    #[error(
        "frames {first} to {last}: {source}; check that the poses are camera-to-world, radius_m, the calibration, and that [prior] is neither absurdly wide nor narrow"
    )]
    Factor {
        /// First estimated frame.
        first: usize,
        /// Last estimated frame.
        last: usize,
        /// What is wrong.
        source: FactorError,
    },
    /// The iteration broke off for a reason of its own.
    #[error("the solver stopped: {0}")]
    Solver(String),
    /// What is done cannot be kept, or not be continued.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}
