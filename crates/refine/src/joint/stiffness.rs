//! Stiffness of the frames against the wall of the joint solve: the reduced second derivative.
//!
//! If a frame is displaced by δ along s, its pixels change by `δ W ∂x/∂s` on the fixed wall, and
//! the wall responds by `δ y`, `y = A⁻¹ Wᵀ Ω W ∂x/∂s`, A the matrix of its normal equations. The
//! change `δ (W ∂x/∂s − W y)` remains. So the diagonal block of frame i in the second derivative of
//! the cost with the wall eliminated is
//!
//! `K_ii = Σ_p a_i² ω (W ∂x/∂s)_p (W ∂x/∂s − W y)_p`
//!
//! over its pixels p. A texture that is the mean of the frames, point by point, responds by the
//! share `w̄_i/Σw̄`, which gives `K_ii = (w̄_i − w̄_i²/Σw̄) M_ss` ([`crate::tiles::tile`]).
//! A wall finer than pixels responds more: where few frames observe it, detail between their pixels
//! explains much of a displacement. The ratio of the stiffness to that of a mean therefore depends
//! on the number of frames: on bricks with noise of 1 grey level it is 0.69 for two, 0.83 for three
//! and 0.87 for five or more; with noise of 4, which hides such detail, more than 0.95. It is
//! estimated once for each number of frames, from a few blocks spread over the wall, and the slopes
//! in M are multiplied by its root.
//!
//! Without the ratio the steps of Gauss–Newton would be too short by it, and the estimated
//! variances of the poses too small.

use crate::tiles::tile_moments::TileMoments;
use nalgebra::Matrix4;

/// Largest number of frames that is distinguished: a common table entry for more, as the ratio is
/// constant from five on.
const MAX_STIFFNESS_FRAMES: usize = 12;

/// Least ratio, which keeps the normal matrix positive definite if the sums are mostly noise. Those
/// of walls that are solved for are ten times as large.
const MIN_STIFFNESS_RATIO: f64 = 0.05;

/// Sums of stiffnesses, by the number of frames that are compared in a tile.
#[derive(Clone, Copy, Debug, Default)]
pub struct StiffnessSums {
    /// `Σ K_ii`.
    joint: [f64; MAX_STIFFNESS_FRAMES + 1],
    /// `Σ (w̄_i − w̄_i²/Σw̄) M`, the stiffness against a mean.
    by_mean: [f64; MAX_STIFFNESS_FRAMES + 1],
}

/// Ratio of the stiffness to that of a mean, by the number of frames that are compared in a tile.
#[derive(Clone, Copy, Debug)]
pub struct Stiffness([f64; MAX_STIFFNESS_FRAMES + 1]);

/// Number of frames that are compared in a tile, at most [`MAX_STIFFNESS_FRAMES`].
fn count_frames(tile: &TileMoments) -> usize {
    let compared = tile.observers.iter().filter(|o| o.weight > 0.0);
    compared.count().min(MAX_STIFFNESS_FRAMES)
}

impl StiffnessSums {
    /// Adds the stiffness K_ii of an observer of a tile along s (axis 0) or h (1).
    pub fn add(&mut self, tile: &TileMoments, observer: usize, axis: usize, stiffness: f64) {
        let total: f64 = tile.observers.iter().map(|observer| observer.weight).sum();
        let own = tile.observers[observer].weight;
        if own > 0.0 {
            let by_mean = (own - own * own / total) * tile.features[(axis, axis)];
            self.joint[count_frames(tile)] += stiffness;
            self.by_mean[count_frames(tile)] += by_mean;
        }
    }

    /// Adds the sums of another block.
    pub fn merge(self, other: &Self) -> Self {
        let sum = |a: [f64; MAX_STIFFNESS_FRAMES + 1], b: [f64; MAX_STIFFNESS_FRAMES + 1]| {
            std::array::from_fn(|k| a[k] + b[k])
        };
        Self {
            joint: sum(self.joint, other.joint),
            by_mean: sum(self.by_mean, other.by_mean),
        }
    }

    /// The ratios; a number of frames without tiles takes that of the next lower one that has some,
    /// or else of all tiles together.
    pub fn stiffness(&self) -> Stiffness {
        let ratio = |joint: f64, by_mean: f64| {
            if by_mean > 0.0 {
                (joint / by_mean).clamp(MIN_STIFFNESS_RATIO, 1.0)
            } else {
                1.0
            }
        };
        let mut last = ratio(self.joint.iter().sum(), self.by_mean.iter().sum());
        Stiffness(std::array::from_fn(|k| {
            if self.by_mean[k] > 0.0 {
                last = ratio(self.joint[k], self.by_mean[k]);
            }
            last
        }))
    }
}

impl Stiffness {
    /// Multiplies the slopes in a tile's M by the root of the ratio.
    pub fn apply(&self, tile: &mut TileMoments) {
        let root = self.0[count_frames(tile)].sqrt();
        let scale = Matrix4::from_diagonal(&[root, root, 1.0, 1.0].into());
        tile.features = scale * tile.features * scale;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tiles::tile_moments::ObserverMoments;

    fn tile(weights: &[f64]) -> TileMoments {
        let observer = |weight: &f64| ObserverMoments {
            weight: *weight,
            ..ObserverMoments::default()
        };
        TileMoments {
            observers: weights.iter().map(observer).collect(),
            features: Matrix4::from_diagonal(&[4.0, 8.0, 1.0, 1.0].into()),
        }
    }

    #[test]
    fn stiffness_is_that_of_the_number_of_frames() {
        // Against a mean, (1 − ½) 4 along s of each of two frames; a third without weight does not
        // count.
        let (two, three) = (tile(&[1.0, 1.0, 0.0]), tile(&[1.0, 1.0, 2.0]));
        let mut sums = StiffnessSums::default();
        sums.add(&two, 0, 0, 0.5);
        sums.add(&two, 1, 0, 0.5);
        sums.add(&two, 2, 0, 0.0);
        let stiffness = sums.merge(&StiffnessSums::default()).stiffness();
        for mut tile in [two, three] {
            stiffness.apply(&mut tile);
            assert!((tile.features[(0, 0)] - 1.0).abs() < 1e-12);
            assert!((tile.features[(1, 1)] - 2.0).abs() < 1e-12);
            assert_eq!(tile.features[(2, 2)], 1.0);
        }
    }
}
