//! How stiffly a wall that is solved for holds the frames that show it.
//!
//! If a frame is displaced by δ along s, its pixels read `δ W ∂x/∂s` more of the wall as it is, and
//! the wall follows: by `y = A⁻¹ Wᵀ Ω (δ W ∂x/∂s)`, A the matrix of its normal equations. What is
//! left, and what pulls the frame back, is `δ (W ∂x/∂s − W y)`. So of the second derivative of the
//! cost with the wall eliminated, a frame's own part is
//!
//! `K_ii = Σ_p a_i² ω (W ∂x/∂s)_p (W ∂x/∂s − W y)_p`
//!
//! over its pixels p. A wall that is the mean of what all frames show, point by point, follows by
//! the share `w̄_i/Σw̄`, which makes `K_ii = (w̄_i − w̄_i²/Σw̄) M_ss` ([`crate::refine::tiles::tile`]).
//! One that is finer than pixels has more to follow with: where few frames see it, detail between
//! their pixels explains much of a displacement. So the stiffness over that of a mean, κ, goes with
//! the number of frames: on bricks with noise of 1 grey level it is 0.69 for two, 0.83 for three
//! and 0.87 for five or more, with noise of 4, which hides such detail, more than 0.95. It is found
//! once, from a few blocks spread over the wall, for each number of frames, and the slopes in M are
//! multiplied by √κ.
//!
//! Without it Gauss–Newton would take steps as much too short, and the poses would be called surer
//! than they are.

use crate::refine::tiles::tile::TileMoments;
use nalgebra::Matrix4;

/// Numbers of frames that are told apart: from so many on, all are alike.
const MOST: usize = 12;
/// The least stiffness that is inliers.
const LEAST: f64 = 0.05;

/// Stiffnesses found, by the number of frames.
#[derive(Clone, Copy, Debug, Default)]
pub struct Probe {
    /// `Σ K_ii`.
    held: [f64; MOST + 1],
    /// The same if the wall were a mean.
    by_mean: [f64; MOST + 1],
}

/// κ, by the number of frames that are compared in a tile.
#[derive(Clone, Copy, Debug)]
pub struct Stiffness([f64; MOST + 1]);

/// The frames that are compared in a tile.
fn frames(tile: &TileMoments) -> usize {
    let compared = tile.observers.iter().filter(|o| o.weight > 0.0);
    compared.count().min(MOST)
}

impl Probe {
    /// Counts what holds a frame in a tile: `held` is K_ii along s (axis 0) or h (1).
    pub fn add(&mut self, tile: &TileMoments, observer: usize, axis: usize, held: f64) {
        let total: f64 = tile.observers.iter().map(|observer| observer.weight).sum();
        let own = tile.observers[observer].weight;
        if own > 0.0 {
            let by_mean = (own - own * own / total) * tile.features[(axis, axis)];
            self.held[frames(tile)] += held;
            self.by_mean[frames(tile)] += by_mean;
        }
    }

    /// That of two blocks.
    pub fn merge(self, other: &Self) -> Self {
        let sum = |a: [f64; MOST + 1], b: [f64; MOST + 1]| std::array::from_fn(|k| a[k] + b[k]);
        Self {
            held: sum(self.held, other.held),
            by_mean: sum(self.by_mean, other.by_mean),
        }
    }

    /// κ; of numbers of frames that were not met, that of the next lower one that was, or else of
    /// all together.
    pub fn stiffness(&self) -> Stiffness {
        let ratio = |held: f64, by_mean: f64| {
            if by_mean > 0.0 {
                (held / by_mean).clamp(LEAST, 1.0)
            } else {
                1.0
            }
        };
        let mut last = ratio(self.held.iter().sum(), self.by_mean.iter().sum());
        Stiffness(std::array::from_fn(|k| {
            if self.by_mean[k] > 0.0 {
                last = ratio(self.held[k], self.by_mean[k]);
            }
            last
        }))
    }
}

impl Stiffness {
    /// Multiplies the slopes in a tile's M by √κ.
    pub fn apply(&self, tile: &mut TileMoments) {
        let root = self.0[frames(tile)].sqrt();
        let scale = Matrix4::from_diagonal(&[root, root, 1.0, 1.0].into());
        tile.features = scale * tile.features * scale;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::refine::tiles::tile::ObserverMoments;

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
    fn stiffness_is_what_was_found_for_as_many_frames() {
        // By a mean, (1 − ½) 4 along s of each of two frames; a third that is not compared does not
        // count.
        let (two, three) = (tile(&[1.0, 1.0, 0.0]), tile(&[1.0, 1.0, 2.0]));
        let mut probe = Probe::default();
        probe.add(&two, 0, 0, 0.5);
        probe.add(&two, 1, 0, 0.5);
        probe.add(&two, 2, 0, 0.0);
        let stiffness = probe.merge(&Probe::default()).stiffness();
        for mut tile in [two, three] {
            stiffness.apply(&mut tile);
            assert!((tile.features[(0, 0)] - 1.0).abs() < 1e-12);
            assert!((tile.features[(1, 1)] - 2.0).abs() < 1e-12);
            assert_eq!(tile.features[(2, 2)], 1.0);
        }
    }
}
