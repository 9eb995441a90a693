//! What is estimated of each frame.

use crate::trajectory::Pose;
use nalgebra::{SVector, Vector6};
use serde::{Deserialize, Serialize};

/// Unknowns of a frame: rotation (3), translation (3), log-gain, bias.
pub const UNKNOWNS: usize = 8;

/// A step of one frame's unknowns: `(ω, ρ, δα, δβ)` in radians, metres, 1, grey levels.
pub type FrameStep = SVector<f64, UNKNOWNS>;

/// Pose and exposure of one frame.
///
/// A grey value `I` of the frame stands for the wall's value `(I − b)/a` with `a = exp(log_gain)`.
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

    /// Moves along a step; see [`Pose::retract`].
    pub fn retract(&self, step: &FrameStep) -> Self {
        let xi: Vector6<f64> = step.fixed_rows::<6>(0).into();
        Self {
            pose: self.pose.retract(&xi),
            log_gain: self.log_gain + step[6],
            bias: self.bias + step[7],
        }
    }
}
