//! Resolution of the wall samples that a problem uses.

use crate::tiles::interpolation::Interpolation;
use serde::{Deserialize, Serialize};

/// Resolution and weighting of the wall samples of a problem.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sampling {
    /// Pyramid level of the frames; 0 is full size.
    pub level: usize,
    /// Wall samples per pixel along each axis.
    pub density: f64,
    /// Interpolation between a frame's pixels.
    pub interpolation: Interpolation,
    /// True if samples are weighted by their variance, which lowers the weight of steep ones
    /// ([`crate::tiles::residual_weighting::NoiseModel`]).
    ///
    /// Only for frames that are aligned already: before that, the residuals at steep samples are
    /// what aligns them.
    pub variance_weighting: bool,
    /// True if the wall is solved for at the density of the samples, jointly with the poses
    /// ([`crate::joint::joint_block`]); at full size only.
    pub joint: bool,
    /// True if the wall's shape is estimated with the poses, if it has any
    /// ([`crate::parameters::shape`]).
    pub shape: bool,
}

impl Sampling {
    /// One sample per pixel of a pyramid level, all over the wall.
    pub fn of(level: usize) -> Self {
        Self {
            level,
            density: 1.0,
            interpolation: Interpolation::Bilinear,
            variance_weighting: false,
            joint: false,
            shape: false,
        }
    }
}
