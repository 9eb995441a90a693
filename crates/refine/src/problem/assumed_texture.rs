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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::photometric_problem::PhotometricProblem;
    use crate::problem::test_ring::Ring;
    use tunnelstitch_geometry::surface::Surface;

    /// Frames of a wall have the information of a texture with its slopes.
    #[test]
    fn information_is_that_of_sampled_texture_with_equal_slopes() {
        let ring = Ring::new(0.0);
        // Of `waves`, along s and h: a wave of amplitude a has a/√2.
        let per_metre = std::f64::consts::TAU / ring.wall.circle.perimeter_m();
        let along_s = per_metre * (50.0f64 * 20.0).hypot(30.0 * 4.0);
        let along_h = (50.0f64 * 3.0).hypot(30.0 * 13.0);
        let texture = AssumedTexture {
            slope_grey_per_m: 0.5 * along_s.hypot(along_h),
            noise_grey: 1.0,
        };
        let information = |problem: &PhotometricProblem| -> f64 {
            let at = problem.linearise(&ring.estimates).unwrap();
            let of_pose = |k: usize| {
                let index = problem.pattern().block_index(k, k).unwrap();
                at.normal.blocks[index].fixed_view::<6, 6>(0, 0).trace()
            };
            (1..ring.estimates.len()).map(of_pose).sum()
        };
        let sampled = information(&ring.problem().with_known_noise(1.0));
        let assumed = information(&ring.problem().with_assumed_texture(texture));
        let ratio = assumed / sampled;
        assert!((0.8..1.25).contains(&ratio), "{ratio}");
    }
}
