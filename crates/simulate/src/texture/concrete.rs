//! Concrete texture: smooth stains of low contrast.

use crate::procedural_noise::{ValueNoise, derived_seed};
use crate::texture::wall_texture::WallTexture;

/// Mean grey level.
const MEAN: f32 = 128.0;
/// Stains: amplitude (grey levels) and cell size (metres) of each octave.
const STAINS: [(f32, f64); 4] = [(5.0, 1.2), (5.0, 0.3), (4.0, 0.060), (4.0, 0.015)];

/// Smooth stains of all sizes, of a few grey levels, that do not repeat along the tunnel.
pub(super) struct ConcreteWall {
    stains: Vec<ValueNoise>,
}

impl ConcreteWall {
    /// A wall of the given perimeter (metres).
    pub fn new(seed: u64, perimeter_m: f64) -> Self {
        let stains = (1..).zip(STAINS).map(|(purpose, (amplitude, cell_m))| {
            ValueNoise::unique(derived_seed(seed, purpose), amplitude, cell_m, perimeter_m)
        });
        Self {
            stains: stains.collect(),
        }
    }
}

impl WallTexture for ConcreteWall {
    fn fill_row(&self, h_m: f64, texel_m: f64, row: &mut [f32]) {
        row.fill(MEAN);
        for stain in &self.stains {
            stain.add_to_row(h_m, texel_m, row);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn contrast_is_low_but_there_is_some() {
        let perimeter_m = TAU * 3.0;
        let wall = ConcreteWall::new(1, perimeter_m);
        let mut values = Vec::new();
        for k in 0..400 {
            let mut row = vec![0.0; 2000];
            wall.fill_row(f64::from(k) * 0.02, perimeter_m / 2000.0, &mut row);
            values.extend(row.into_iter().map(f64::from));
        }
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64;
        assert!((mean - 128.0).abs() < 1.0, "{mean}");
        assert!((2.5..6.0).contains(&variance.sqrt()), "{}", variance.sqrt());
    }
}
