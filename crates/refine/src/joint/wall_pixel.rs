//! Residual of a frame's pixel against the wall of the joint solve, and the moments of a tile.

use crate::tiles::residual_weighting::Loss;
use crate::tiles::tile_arrays::SAMPLES;
use crate::tiles::tile_moments::TileMoments;
use nalgebra::Vector4;

/// A pixel of a frame that is compared with the wall.
pub struct WallPixel {
    /// Index among the frame's footprints.
    pub index: usize,
    /// Index of its tile in the block.
    pub tile: usize,
    /// Index of its frame among the observers of the tile.
    pub observer: usize,
    /// `a_i`, shading included.
    pub gain: f64,
    /// `e_p`, grey levels.
    pub residual: f32,
    /// ω.
    pub omega: f64,
    /// `φ_p` without its constant 1.
    pub features: [f32; 3],
}

impl WallPixel {
    /// `a_i² ω`.
    pub fn weight(&self) -> f64 {
        self.gain * self.gain * self.omega
    }

    /// Adds the pixel to the moments of its frame and, weighted, to the features of the tile.
    pub fn add_to(&self, sigma: f32, tile: &mut TileMoments) {
        let (square, precision) = (self.residual * self.residual, sigma.powi(-2));
        let [s, h, value] = self.features.map(f64::from);
        let phi = Vector4::new(s, h, value, 1.0);
        let weight = self.weight();
        let moments = &mut tile.observers[self.observer];
        moments.gradient += phi * (self.gain * self.omega * f64::from(self.residual));
        moments.weight += weight / SAMPLES as f64;
        moments.cost += f64::from(Loss::relative_loss(square, precision) / precision);
        moments.square += self.omega * f64::from(square);
        moments.pixels += 1.0;
        moments.inliers += self.omega;
        tile.features += phi * phi.transpose() * weight;
    }
}

/// Divides the sum of the weighted features by the total weight, and removes the net force from the
/// frames (see [`crate::joint::joint_block`]).
pub fn normalise(tile: &mut TileMoments) {
    let total: f64 = tile.observers.iter().map(|observer| observer.weight).sum();
    let force: Vector4<f64> = tile
        .observers
        .iter()
        .map(|observer| observer.gradient)
        .sum();
    let inverse = 1.0 / total.max(1e-12);
    tile.features *= inverse;
    for observer in &mut tile.observers {
        observer.gradient -= force * (observer.weight * inverse);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tiles::tile_moments::ObserverMoments;
    use nalgebra::Matrix4;

    #[test]
    fn net_force_on_a_tile_vanishes() {
        let observer = |gradient: [f64; 4], weight: f64| ObserverMoments {
            gradient: gradient.into(),
            weight,
            ..ObserverMoments::default()
        };
        let mut tile = TileMoments {
            observers: vec![
                observer([1.0, 2.0, -3.0, 0.5], 1.0),
                observer([4.0, -1.0, 0.0, 0.0], 3.0),
            ],
            features: Matrix4::identity() * 8.0,
        };
        normalise(&mut tile);
        let [first, second] = [0, 1].map(|k| tile.observers[k].gradient);
        assert!((first + second).norm() < 1e-12);
        // The first has a quarter of the weight, and loses a quarter of (5, 1, −3, ½).
        assert!((first - Vector4::new(-0.25, 1.75, -2.25, 0.375)).norm() < 1e-12);
        assert_eq!(tile.features, Matrix4::identity() * 2.0);
    }
}
