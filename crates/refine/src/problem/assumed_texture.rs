//! Fisher information of a texture that is assumed rather than sampled: what pictures of a wall
//! would tell of poses and shape.
//!
//! With slopes of RMS g along either axis that are uncorrelated with each other and with the grey
//! level, a tile of n samples has `M = n diag(g², g², 1, 1)` ([`crate::tiles::tile`]), and every
//! pixel the weight 1. Exposures are then estimated beside poses and shape, but do not concern
//! them, whatever their own information is.

use crate::samples::observer::Observer;
use crate::tiles::tile_arrays::SAMPLES;
use crate::tiles::tile_moments::{ObserverMoments, TileMoments};
use nalgebra::{Matrix4, Vector4};

/// An assumed texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AssumedTexture {
    /// RMS of the slope along either axis of the wall, grey levels per metre.
    pub slope_grey_per_m: f64,
    /// Noise of a pixel, 1-σ in grey levels.
    pub noise_grey: f64,
}

impl AssumedTexture {
    /// Moments of a tile that these frames observe; its residuals are zero.
    pub fn moments(&self, observers: &[Observer]) -> TileMoments {
        let samples = SAMPLES as f64;
        let of = |observer: &Observer| ObserverMoments {
            weight: f64::from(observer.pixels),
            pixels: samples * f64::from(observer.pixels),
            inliers: samples * f64::from(observer.pixels),
            ..ObserverMoments::default()
        };
        let square = self.slope_grey_per_m.powi(2);
        let diagonal = Vector4::new(square, square, 1.0, 1.0) * samples;
        TileMoments {
            observers: observers.iter().map(of).collect(),
            features: Matrix4::from_diagonal(&diagonal),
        }
    }
}
