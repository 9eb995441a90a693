//! A photometric problem over a ring of frames, for tests.

use crate::model::context::{EstimationContext, FrameWindow};
use crate::model::prior::Prior;
use crate::parameters::calibration::{Calibration, Kappa, SHARED_PARAMETERS};
use crate::parameters::frame_estimate::FrameEstimate;
use crate::parameters::shape::Shape;
use crate::problem::photometric_problem::PhotometricProblem;
use crate::samples::sampling::Sampling;
use crate::test_scene::{independent_prior, test_context};
use crate::tiles::interpolation::Interpolation;
use nalgebra::Vector6;
use std::borrow::Cow;
use std::sync::Arc;
use tunnelstitch_core::frames::{FrameCache, GreyImage, Pyramid};
use tunnelstitch_core::test_wall::{TestWall, waves};

/// A ring of frames of a smooth wall, each with an exposure of its own, and estimates near the
/// truth.
pub struct Ring {
    pub wall: TestWall,
    pub frames: FrameCache,
    pub prior: Prior,
    pub calibration: Calibration,
    pub estimates: Vec<FrameEstimate>,
}

/// Deterministic number from −1 to 1.
pub fn number(k: usize, salt: f64) -> f64 {
    (12.9898 * (k as f64 + 1.0) + 78.233 * salt).sin()
}

impl Ring {
    /// Estimates off by up to `off_by` rad and m from the truth.
    pub fn new(off_by: f64) -> Self {
        let wall = TestWall::ring(waves);
        let exposed = |(k, frame): (usize, GreyImage)| {
            let (gain, bias) = ((0.1 * number(k, 1.0)).exp(), 4.0 * number(k, 2.0));
            let data = frame.data().iter().map(|v| gain as f32 * v + bias as f32);
            let image = GreyImage::new(frame.width(), frame.height(), data.collect());
            (gain, bias, Pyramid::new(image, 1))
        };
        let (mut frames, mut estimates) = (Vec::new(), Vec::new());
        for (k, frame) in wall.frames().into_iter().enumerate() {
            let (gain, bias, pyramid) = exposed((k, frame));
            frames.push(pyramid);
            let xi = Vector6::from_fn(|n, _| off_by * number(k, 3.0 + n as f64));
            estimates.push(FrameEstimate {
                pose: wall.poses[k].retract(&xi),
                log_gain: gain.ln() + off_by * number(k, 9.0),
                bias: bias + 1e3 * off_by * number(k, 10.0),
            });
        }
        let prior = independent_prior(&wall.poses);
        Self {
            calibration: Calibration {
                free: [true; SHARED_PARAMETERS],
                sigma: Kappa::repeat(1.0),
                ..Calibration::none(wall.camera)
            },
            wall,
            frames: FrameCache::of_pyramids(frames),
            prior,
            estimates,
        }
    }

    /// The problem of all frames at full size.
    pub fn problem(&self) -> PhotometricProblem<'_> {
        self.problem_of(self.sampling())
    }

    /// Two samples per pixel.
    pub fn sampling(&self) -> Sampling {
        Sampling {
            density: 2.0,
            ..Sampling::of(0)
        }
    }

    /// Sampling of a solve for wall and poses together.
    pub fn joint_sampling(&self) -> Sampling {
        Sampling {
            interpolation: Interpolation::Bicubic,
            variance_weighting: true,
            joint: true,
            ..self.sampling()
        }
    }

    /// The problem with this sampling.
    pub fn problem_of(&self, sampling: Sampling) -> PhotometricProblem<'_> {
        self.problem_from(sampling, None)
    }

    /// The problem of all frames and of the wall's shape at full size.
    pub fn problem_with_shape(&self, shape: Shape) -> PhotometricProblem<'_> {
        let sampling = Sampling {
            shape: true,
            ..self.sampling()
        };
        self.problem_from(sampling, Some(Arc::new(shape)))
    }

    fn problem_from(
        &self,
        sampling: Sampling,
        shape: Option<Arc<Shape>>,
    ) -> PhotometricProblem<'_> {
        let context = EstimationContext {
            shape,
            calibration: self.calibration.clone(),
            ..test_context(&self.wall, &self.frames, &self.prior)
        };
        let all = 0..self.estimates.len();
        let window = FrameWindow {
            participants: all.clone(),
            active: all,
            estimates: &self.estimates,
            compared: Cow::Owned(vec![true; self.estimates.len()]),
        };
        PhotometricProblem::new(&context, sampling, window).unwrap()
    }
}
