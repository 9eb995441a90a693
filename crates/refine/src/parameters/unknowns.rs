//! The unknowns of a solve.

use crate::parameters::calibration::Kappa;
use crate::parameters::frame_estimate::{FrameEstimate, FrameStep};
use crate::parameters::shape_functions::ShapeStep;
use serde::{Deserialize, Serialize};

/// The unknowns of a solve: the active frames, the parameters that all frames share, and the shape
/// of the wall.
///
/// The normal equations have a slot for each frame and, behind them, for each block of the shape
/// ([`crate::linear::normal_equations`]).
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Unknowns {
    /// Estimates of the active frames.
    pub frames: Vec<FrameEstimate>,
    /// The shared parameters.
    pub kappa: Kappa,
    /// Coefficients of the shape, block by block; empty unless it is estimated.
    pub shape: Vec<ShapeStep>,
}

impl Unknowns {
    /// The steps of every slot and of the shared parameters to other unknowns, without regard to
    /// the curvature that carries the frames along.
    pub fn local(&self, other: &Self) -> (Vec<FrameStep>, Kappa) {
        let frames = self.frames.iter().zip(&other.frames);
        let frames = frames.map(|(from, to)| from.local(to));
        let shape = self.shape.iter().zip(&other.shape);
        let steps = frames.chain(shape.map(|(from, to)| to - from));
        (steps.collect(), other.kappa - self.kappa)
    }

    /// The unknowns after a step of every slot and of the shared parameters.
    pub fn stepped(&self, step: &[FrameStep], shared: &Kappa) -> Self {
        let (of_frames, of_shape) = step.split_at(self.frames.len());
        let frames = self.frames.iter().zip(of_frames);
        let shape = self.shape.iter().zip(of_shape);
        Self {
            frames: frames.map(|(frame, step)| frame.retract(step)).collect(),
            kappa: self.kappa + shared,
            shape: shape.map(|(block, step)| block + step).collect(),
        }
    }
}
