//! Pose and exposure of one frame, and a step of them.

use nalgebra::{SVector, Vector6};
use serde::{Deserialize, Serialize};
use tunnelstitch_geometry::trajectory::Pose;

/// Number of parameters of a frame: rotation (3), translation (3), log-gain, bias.
pub const FRAME_PARAMETERS: usize = 8;

/// Those of the pose, before those of the exposure.
pub const POSE: usize = 6;

/// Those of the exposure.
pub const EXPOSURE: usize = FRAME_PARAMETERS - POSE;

/// A step of one frame's parameters: `(ω, ρ, δα, δβ)` in radians, metres, 1, grey levels.
pub type FrameStep = SVector<f64, FRAME_PARAMETERS>;

/// Pose and exposure of one frame.
///
/// A grey value `I` of the frame corresponds to the wall's grey value `(I − b)/a`,
/// `a = exp(log_gain)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameEstimate {
    /// Camera-to-world pose.
    pub pose: Pose,
    /// Logarithm of the gain `a`.
    pub log_gain: f64,
    /// Bias `b`, grey levels.
    pub bias: f64,
}

impl FrameEstimate {
    /// A pose with gain 1 and bias 0.
    pub fn at(pose: Pose) -> Self {
        Self {
            pose,
            log_gain: 0.0,
            bias: 0.0,
        }
    }

    /// Applies a step: the pose on the manifold ([`Pose::retract`]), the exposure by addition.
    pub fn retract(&self, step: &FrameStep) -> Self {
        let xi: Vector6<f64> = step.fixed_rows::<6>(0).into();
        Self {
            pose: self.pose.retract(&xi),
            log_gain: self.log_gain + step[6],
            bias: self.bias + step[7],
        }
    }

    /// The step from `self` to `other`; inverse of [`FrameEstimate::retract`].
    pub fn local(&self, other: &Self) -> FrameStep {
        let mut step = FrameStep::zeros();
        step.fixed_rows_mut::<6>(0)
            .copy_from(&self.pose.local(&other.pose));
        step[6] = other.log_gain - self.log_gain;
        step[7] = other.bias - self.bias;
        step
    }
}
