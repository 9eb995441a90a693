//! The estimator's inputs, and the window of frames that a problem estimates.

use crate::model::prior::{Prior, predict};
use crate::parameters::calibration::{Calibration, Kappa};
use crate::parameters::frame_estimate::FrameEstimate;
use crate::parameters::shape::Shape;
use crate::points::observations::PointObservations;
use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;
use tunnelstitch_core::frames::{FrameCache, PictureNoise};
use tunnelstitch_geometry::camera::{Cameras, Sweep};
use tunnelstitch_geometry::surface::{Gauge, RadialField, Surface, WallRegions, bent, displaced};
use tunnelstitch_geometry::trajectory::{Pose, Shutter};

/// All inputs of the estimator.
#[derive(Clone)]
pub struct EstimationContext<'a> {
    /// The wall as planned.
    pub planned: Arc<dyn Surface>,
    /// The wall as planned, but for the curvature of the current κ.
    pub nominal: Arc<dyn Surface>,
    /// True if it is known to bend or to be displaced.
    pub is_deviation_known: bool,
    /// Its known displacement.
    pub displacement: Option<&'a RadialField>,
    /// Its further displacement, if it is to be estimated.
    pub shape: Option<Arc<Shape>>,
    /// Measured points, as observations of that.
    pub points: Option<Arc<PointObservations>>,
    /// The wall: with its shape, at the start of a solve.
    pub surface: Arc<dyn Surface>,
    /// Parts of the wall where frames are not compared.
    pub ignored: &'a WallRegions,
    /// The cameras at full size at the current κ, without motion during the readout.
    pub cameras: Cameras,
    /// Timing of the readout of the frames' rows.
    pub shutter: &'a Shutter,
    /// The shared parameters: which are estimated, and their prior.
    pub calibration: Calibration,
    /// Current values of the shared parameters.
    pub kappa: Kappa,
    /// The frames.
    pub frames: &'a FrameCache,
    /// Prior of poses and exposures.
    pub prior: &'a Prior,
    /// The noise of the pictures, estimated from single ones.
    pub noise: PictureNoise,
    /// Factor by which residuals are less informative than noise of their size, 1 or more: the
    /// dispersion of [`crate::uncertainty::model_error`], once it is known. The information of
    /// pixels is divided by it.
    pub dispersion: f64,
}

impl EstimationContext<'_> {
    /// Replaces the shared parameters, the cameras and the wall; no change if `kappa` gives no
    /// valid camera.
    pub fn at(&self, kappa: Kappa) -> Self {
        match self.calibration.cameras(&kappa) {
            Some(cameras) => Self {
                cameras,
                kappa,
                nominal: self.nominal_at(&kappa),
                surface: self.surface_at(&kappa, self.shape.as_deref()),
                ..self.clone()
            },
            None => self.clone(),
        }
    }

    /// The wall as planned, but for the curvature of κ.
    fn nominal_at(&self, kappa: &Kappa) -> Arc<dyn Surface> {
        bent(&self.planned, self.calibration.bend(kappa))
    }

    /// The wall with the curvature of κ, and a shape beyond its known displacement.
    pub fn surface_at(&self, kappa: &Kappa, shape: Option<&Shape>) -> Arc<dyn Surface> {
        let field = total_displacement(self.displacement, shape.and_then(Shape::field));
        displaced(&self.nominal_at(kappa), field)
    }

    /// The rigid motions that change no image. They move what is estimated with the poses, but not
    /// a bend or a displacement that is known.
    pub fn gauge(&self) -> Gauge {
        match self.is_deviation_known {
            true => Gauge::default(),
            false => self.planned.gauge(),
        }
    }

    /// Motion of the camera during the readout of frame `frame`, from the `estimates` of the frames
    /// `window`.
    ///
    /// Neighbours outside the window (those not yet registered, for example) are predicted by the
    /// initial steps from the frame.
    pub fn sweep(&self, frame: usize, window: &Range<usize>, estimates: &[FrameEstimate]) -> Sweep {
        let readout_s = self.calibration.readout_s(&self.kappa);
        if readout_s == 0.0 {
            Sweep::default()
        } else {
            self.sweep_rate(frame, window, estimates).scaled(readout_s)
        }
    }

    /// Motion of the camera during a readout of one second, as [`EstimationContext::sweep`].
    pub fn sweep_rate(
        &self,
        frame: usize,
        window: &Range<usize>,
        estimates: &[FrameEstimate],
    ) -> Sweep {
        let estimate = |k: usize| estimates.get(k.checked_sub(window.start)?);
        let datum = self.calibration.datum(&self.kappa);
        let initial = |k: usize| {
            let pose = self.prior.initial.get(k)?;
            Some(datum.to_nominal_tunnel(pose))
        };
        self.shutter.rate(frame, |k| {
            let predicted = |own: &Pose| Some(predict(own, &initial(frame)?, &initial(k)?));
            match estimate(k) {
                Some(estimate) => Some(estimate.pose),
                None => predicted(&estimate(frame)?.pose),
            }
        })
    }
}

/// The sum of a known displacement and a further one on a lattice of the same origin.
pub fn total_displacement(
    known: Option<&RadialField>,
    further: Option<RadialField>,
) -> Option<RadialField> {
    match (known, further) {
        (Some(known), Some(further)) => Some(known.plus(&further)),
        (known, further) => further.or(known.cloned()),
    }
}

/// The frames of a problem.
pub struct FrameWindow<'m> {
    /// Consecutive frames.
    pub participants: Range<usize>,
    /// Those of them that are estimated; the others are held fixed.
    pub active: Range<usize>,
    /// Estimates of the participants.
    pub estimates: &'m [FrameEstimate],
    /// True for the participants whose pixels are compared; the others have only their prior.
    pub compared: Cow<'m, [bool]>,
}
