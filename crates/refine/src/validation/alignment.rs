//! The measurements of a pair of frames.

use crate::validation::patch_correlation::PatchCorrelation;

/// Two frames against each other.
#[derive(Clone, Copy, Debug)]
pub struct Alignment {
    /// The earlier frame.
    pub a: usize,
    /// The later one.
    pub b: usize,
    /// Number of samples that they share.
    pub samples: f64,
    /// Their displacement.
    pub displacement: Displacement,
    /// Correlation of their contrast once they are aligned, without robust weights that could hide
    /// that they show different things; at the present poses where alignment fails.
    pub contrast: PatchCorrelation,
    /// Variance of the earlier frame's slopes over that of the later one's, gains and noise
    /// removed; None where noise drowns both.
    pub sharpness_ratio: Option<f64>,
}

/// The displacement of two frames against each other.
#[derive(Clone, Copy, Debug)]
pub struct Displacement {
    /// Its root mean square e, pixels of full size.
    pub error_px: f64,
    /// Its uncertainty σ, pixels of full size; infinite where the texture is too faint.
    pub sigma_px: f64,
}

impl Displacement {
    /// The displacement where there is too little texture to measure it.
    pub fn unknown() -> Self {
        Self {
            error_px: 0.0,
            sigma_px: f64::INFINITY,
        }
    }
}
