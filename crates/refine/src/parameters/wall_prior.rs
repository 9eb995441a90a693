//! Prior of a wall whose deformation is a known random field.

use crate::parameters::shape::ShapeModel;
use crate::parameters::shape_functions::OVALITY;
use tunnelstitch_geometry::surface::WallPoint;

/// Distance of the nodes of a lattice over the length ℓ of a field with the correlation
/// `exp(−x²/2ℓ²)` that it stands for: independent cubic B-splines at a distance d correlate by
/// nearly that, with `ℓ² = 2 d²/3`.
///
/// Each is the density of four uniform variables of width d, of variance `d²/3`, and their
/// correlation the convolution of two.
const SPACING_PER_LENGTH: f64 = 1.224_744_871_391_589;

/// Deformation of a wall as a random field of known size.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WallPrior {
    /// Amplitude of the ovality, metres.
    pub ovality_m: f64,
    /// Undulation, root mean square, metres.
    pub undulation_m: f64,
    /// Length ℓ of the undulation's correlation `exp(−x²/2ℓ²)`, metres.
    pub undulation_length_m: f64,
}

impl WallPrior {
    /// The functions of such a wall between two chainages, metres, with their strengths.
    pub fn model(&self, perimeter_m: f64, extent_h_m: [f64; 2]) -> ShapeModel {
        let mut model = ShapeModel::empty(perimeter_m, WallPoint::default(), extent_h_m);
        if self.ovality_m > 0.0 {
            // The mean square of cos² and sin² is a half each.
            model.add(OVALITY, self.ovality_m * 0.5f64.sqrt());
        }
        if self.undulation_m > 0.0 {
            let spacing_m = SPACING_PER_LENGTH * self.undulation_length_m;
            let functions = model.lattice_functions(perimeter_m / spacing_m);
            model.add(functions, self.undulation_m / functions.rms());
        }
        model
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::shape::FunctionValue;
    use std::f64::consts::TAU;

    /// Variance and correlation of the undulation are those of the field.
    #[test]
    fn the_lattice_correlates_as_the_field_does() {
        let prior = WallPrior {
            undulation_m: 0.003,
            undulation_length_m: 0.48,
            ..WallPrior::default()
        };
        let model = prior.model(3.0 * TAU, [0.0, 12.0]);
        let sigmas_m = model.block_sigmas_m();
        let at = |s_m: f64| model.functions_at(WallPoint { s_m, h_m: 6.1 });
        let covariance = |a: f64, b: f64| -> f64 {
            let (a, b) = (at(a), at(b));
            let same = |of: &FunctionValue| {
                let mut others = b.iter();
                let other = others.find(|b| (b.block, b.component) == (of.block, of.component));
                other.map_or(0.0, |other| {
                    of.value * other.value * sigmas_m[of.block].powi(2)
                })
            };
            a.iter().map(same).sum()
        };
        let mean = |lag_m: f64| {
            let starts = (0..60).map(|k| 2.0 + 0.01 * f64::from(k));
            starts.map(|s_m| covariance(s_m, s_m + lag_m)).sum::<f64>() / 60.0
        };
        let variance = mean(0.0);
        assert!((variance.sqrt() / 0.003 - 1.0).abs() < 0.05, "{variance}");
        for lag_m in [0.2, 0.48, 0.8] {
            let expected = (-0.5 * (lag_m / 0.48f64).powi(2)).exp();
            assert!((mean(lag_m) / variance - expected).abs() < 0.05, "{lag_m}");
        }
    }
}
