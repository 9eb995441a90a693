//! Everything that the estimator is given, and the window of frames that a problem is about.

use crate::camera::{Camera, Sweep};
use crate::frames::FrameCache;
use crate::refine::model::prior::{Prior, predict};
use crate::refine::parameters::calibration::{Calibration, Kappa};
use crate::refine::parameters::frame_estimate::FrameEstimate;
use crate::refine::tiles::interpolation::Interpolation;
use crate::surface::{Surface, WallRegions};
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
    /// it ([`crate::refine::samples::tile_selection`]).
    pub information: f64,
    /// Between pixels.
    pub interpolation: Interpolation,
    /// Whether samples weigh by their variance, steep ones less
    /// ([`crate::refine::tiles::residual_weighting::NoiseModel`]): only once the frames are aligned; before that,
    /// residuals at steep places are what aligns them.
    pub variance_weighting: bool,
    /// Whether the wall is solved for at the density of the samples, jointly with the poses
    /// ([`crate::refine::joint::joint_block`]): at full size only.
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
            variance_weighting: false,
            joint: false,
        }
    }
}

/// Everything the estimator is given.
#[derive(Clone, Copy)]
pub struct EstimationContext<'a> {
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
}

impl EstimationContext<'_> {
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
pub struct FrameWindow<'m> {
    /// A run of frames.
    pub participants: Range<usize>,
    /// Those of them that are estimated; the others are held.
    pub active: Range<usize>,
    /// Estimates of the participants.
    pub estimates: &'m [FrameEstimate],
    /// Which participants' pixels are compared; for the others only the prior speaks.
    pub compared: Cow<'m, [bool]>,
}
