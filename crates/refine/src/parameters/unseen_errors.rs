//! Errors of all unknowns by deformation of the wall that the pixels do not see.
//!
//! A scale of the shape that is not seen is dropped, and yet its coefficients may not be zero:
//! `c ~ N(0, S)`. As likely as not there is nothing. If there is, the strength may be what the
//! pixels admit: the evidence L ([`crate::solver::shape_evidence`]) is flat where nothing is seen,
//! and falls as σ⁴, by ½ at s. The mean of σ² over `exp L` is `√2 Γ(3/4)/Γ(1/4) s² = 0.48 s²`, half
//! of which is S.
//!
//! With A the normal matrix of all unknowns and P = σ⁻² that strong a prior of these coefficients
//! that they are as good as dropped, the estimate is off by `−A⁻¹ P c`: poses, lens and the rest of
//! the shape take up what c displaces. Draws of c give the covariance `A⁻¹ P S P A⁻¹`, which adds
//! to that of noise, prior and model errors ([`crate::uncertainty::total_covariance`]).
//!
//! Source: the error of a least-squares estimate with a wrong prior; P. K. Kitanidis, "Parameter
//! uncertainty in estimation of spatial functions: Bayesian analysis", Water Resources Research
//! 22(4), 1986 (strengths that are not known).

use crate::parameters::calibration::Kappa;
use crate::parameters::frame_estimate::FrameStep;
use serde::{Deserialize, Serialize};
use std::iter::Sum;
use std::ops::Div;
use tunnelstitch_geometry::surface::RadialField;

/// Number of draws. The sum of six independent variances is known to 10 % by them (1-σ).
pub const UNSEEN_DRAWS: usize = 32;
/// S over the square of the strength that the pixels admit.
pub const EXPECTED_SQUARE: f64 = 0.24;

/// Draws of errors.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct UnseenErrors {
    /// The draws; none if there is no such deformation.
    pub draws: Vec<UnseenError>,
}

/// One draw.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct UnseenError {
    /// Errors of the frames.
    pub frames: Vec<FrameStep>,
    /// Errors of the shared parameters.
    pub shared: Kappa,
    /// Error of the displacement of the wall.
    pub displacement: RadialField,
}

impl UnseenErrors {
    /// The errors by two independent causes.
    pub fn plus(self, other: Self) -> Self {
        if self.draws.is_empty() {
            return other;
        }
        if other.draws.is_empty() {
            return self;
        }
        let pairs = self.draws.into_iter().zip(other.draws);
        let sum = |(a, b): (UnseenError, UnseenError)| UnseenError {
            frames: a.frames.iter().zip(b.frames).map(|(a, b)| a + b).collect(),
            shared: a.shared + b.shared,
            displacement: a.displacement.plus(&b.displacement),
        };
        Self {
            draws: pairs.map(sum).collect(),
        }
    }

    /// The mean of a figure over the draws; zero if there are none.
    pub fn mean<T: Sum + Div<f64, Output = T>>(&self, figure: impl Fn(&UnseenError) -> T) -> T {
        self.draws.iter().map(figure).sum::<T>() / self.draws.len().max(1) as f64
    }
}
